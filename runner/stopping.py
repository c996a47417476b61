"""Signals that end a program become exceptions, so that every way out is the same way out."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from protocol.errors import WorkFailed

# SIGHUP and SIGQUIT do not exist on Windows.
_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT")


class Stopped(WorkFailed):
    """Somebody ended the program from outside."""


class _Stop:
    """The one wish to stop that a process can have: signals belong to the process."""

    def __init__(self) -> None:
        self.wish: Stopped | None = None
        self.raised = False
        self.shields = 0

    def ask(self, number: int, _frame: FrameType | None = None) -> None:
        """Take the first signal; later ones change nothing."""
        if self.wish is None:
            self.wish = Stopped(f"stopped by {signal.Signals(number).name}; run it again to go on")
        self.raise_wish()

    def raise_wish(self) -> None:
        """Raise the wish to stop, once, and not while anything is shielded."""
        if self.wish is not None and not self.raised and self.shields == 0:
            self.raised = True
            raise self.wish


_stop = _Stop()


@contextmanager
def stops_raise() -> Iterator[None]:
    """Raise `Stopped` in the body on the first SIGINT, SIGTERM, SIGHUP or SIGQUIT."""
    global _stop  # noqa: PLW0603 - see _Stop
    _stop = _Stop()
    numbers = [getattr(signal, name) for name in _SIGNALS if hasattr(signal, name)]
    before = {number: signal.signal(number, _stop.ask) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Let no signal cut the body short; what came meanwhile is raised after it.

    Storing an event and knowing of it, turning the device off and reading it back, belong together.
    """
    stop = _stop
    stop.shields += 1
    try:
        yield
    finally:
        stop.shields -= 1
    stop.raise_wish()


@contextmanager
def interruptible() -> Iterator[None]:
    """Let signals end the body, inside what is `uninterrupted`.

    What a signal would else skip, if it came just as the shield goes up, stands behind the shield.
    """
    stop = _stop
    stop.shields -= 1
    try:
        stop.raise_wish()
        yield
    finally:
        stop.shields += 1
