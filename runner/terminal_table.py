"""A table on standard output."""

import sys
from collections.abc import Sequence

from runner.at_terminal import at_terminal

WIDE = 10_000


def print_table(title: str, lines: Sequence[Sequence[str]]) -> None:
    """Print `lines`: a header, rows, and a last row set apart."""
    from rich import box
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    header, *rows, last = lines
    table = Table(
        title=title, box=box.SIMPLE_HEAD, show_footer=True, title_justify="left", padding=0
    )
    for place, (name, foot) in enumerate(zip(header, last, strict=True)):
        table.add_column(escape(name), escape(foot), justify="right" if place else "left")
    for row in rows:
        table.add_row(*(escape(cell) for cell in row))
    # A pipe has no width to fit into; rich heeds one only with a height, where TERM is dumb.
    console = Console() if at_terminal(sys.stdout) else Console(width=WIDE, height=1)
    console.print(table)
