"""A progress bar on standard error, where a terminal can show it."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from runner.at_terminal import at_terminal


@contextmanager
def progress(what: str, total: int) -> Iterator[Callable[[], None]]:
    """Yield a function to call after each of `total` steps."""
    from rich.console import Console
    from rich.progress import Progress

    shown = at_terminal(sys.stderr)
    with Progress(console=Console(stderr=True), transient=True, disable=not shown) as bar:
        task = bar.add_task(what, total=total)
        yield lambda: bar.advance(task)
