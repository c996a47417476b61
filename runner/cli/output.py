"""A table on standard output."""

import errno
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import typer

from protocol.errors import BadInput, WorkFailed
from runner.people.terminal import at_terminal

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


@contextmanager
def progress(what: str, total: int) -> Iterator[Callable[[], None]]:
    """Yield a function to call after each of `total` steps."""
    from rich.console import Console
    from rich.progress import Progress

    shown = at_terminal(sys.stderr)
    with Progress(console=Console(stderr=True), transient=True, disable=not shown) as bar:
        task = bar.add_task(what, total=total)
        yield lambda: bar.advance(task)


WORK_FAILED = 1
BAD_INPUT = 2

_PATHS_GIVEN_WRONG = {
    errno.EACCES,
    errno.EEXIST,
    errno.EISDIR,
    errno.ELOOP,
    errno.ENAMETOOLONG,
    errno.ENOENT,
    errno.ENOTDIR,
    errno.EPERM,
}


def complaint(error: BaseException) -> tuple[str, int]:
    """Return the line that tells a user what `error` means, and the exit code of the command."""
    line, code = _told(error)
    notes = [note for note in getattr(error, "__notes__", ()) if note not in line]
    return " ".join("; ".join([line, *notes]).split()), code


def _told(error: BaseException) -> tuple[str, int]:
    match error:
        case typer.TyperException():
            return f"{error.format_message()} (see touchbeam --help)", error.exit_code
        case BadInput():
            return str(error), BAD_INPUT
        case WorkFailed():
            return str(error), WORK_FAILED
        case OSError(filename=str() as path, strerror=str() as why):
            code = BAD_INPUT if error.errno in _PATHS_GIVEN_WRONG else WORK_FAILED
            return f"{path}: {why}", code
        case OSError(errno=errno.ENOSPC | errno.EFBIG | errno.EDQUOT, strerror=str() as why):
            return f"standard output cannot be written ({why})", WORK_FAILED
    return f"internal error, {type(error).__name__}: {error} (--debug shows where)", WORK_FAILED
