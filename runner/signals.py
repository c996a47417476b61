"""Signals that end a program become exceptions, so that every way out is the same way out."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from protocol.errors import BadInput, WorkFailed

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
        """Take the first signal; later ones change nothing.

        Python calls this in the main thread, between any two instructions of whatever runs there.
        """
        if self.wish is None:
            self.wish = Stopped(f"stopped by {signal.Signals(number).name}")
        self.raise_wish()

    def raise_wish(self) -> None:
        """Raise the wish to stop, once, and not while anything is shielded."""
        if self.wish is not None and not self.raised and self.shields == 0:
            self.raised = True
            raise self.wish


_stop = _Stop()


def raise_if_stopped() -> None:
    """Raise the wish to stop again, if there is one and nothing is shielded.

    An exception that a signal raises in somebody else's code, such as a finalizer, can get lost.
    """
    if _stop.wish is not None and _stop.shields == 0:
        raise _stop.wish


@contextmanager
def signals_raise() -> Iterator[None]:
    """Raise `Stopped` in the body on the first SIGINT, SIGTERM, SIGHUP or SIGQUIT.

    An internal error of a body that was to stop is told as the stop: an import that is cut short,
    for one, makes an error of its own of it.
    """
    global _stop  # noqa: PLW0603 - see _Stop
    _stop = _Stop()
    numbers = [getattr(signal, name) for name in _SIGNALS if hasattr(signal, name)]
    before = {number: signal.signal(number, _stop.ask) for number in numbers}
    try:
        yield
    except (WorkFailed, BadInput, OSError):  # they say what happened: an output that is unknown
        raise
    except Exception as error:
        if _stop.wish is None:
            raise
        raise _stop.wish from error
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        _stop = _Stop()


@contextmanager
def stops_deferred() -> Iterator[None]:
    """Let no signal cut the body short; what came meanwhile is raised after it.

    Storing an event and knowing of it, turning the device off and reading it back, belong together.
    """
    stop = _stop
    stop.shields += 1
    try:
        yield
    finally:
        stop.shields -= 1
    stop.raise_wish()  # not in `finally`: an error of the body is told, not the signal


@contextmanager
def stops_allowed() -> Iterator[None]:
    """Let signals end the body, within what is `stops_deferred`.

    What has to follow the body, such as turning the device off, is then shielded before the body is
    over: no instruction lies between the two at which a signal could skip it.
    """
    stop = _stop
    stop.shields -= 1
    try:
        stop.raise_wish()
        yield
    finally:
        stop.shields += 1
