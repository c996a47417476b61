"""A command that is over in a moment: what it loads is kept until then, not searched for garbage.

Half of what a short command does is to load modules, whose hundred thousand objects stay until it
ends. Python's collector looks through them a few dozen times, and once more at the end, for
nothing: a seventh of the whole time of `touchbeam check`.
"""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def short_lived() -> Iterator[None]:
    """Run the body without the collector, and spare the interpreter its last search."""
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
        gc.freeze()
