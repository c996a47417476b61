"""Signals that end a program become exceptions, so that every way out is the same way out."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from protocol.errors import WorkFailed

_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")  # the last one does not exist on Windows


class Stopped(WorkFailed):
    """Somebody ended the session from outside."""


@contextmanager
def stops_raise() -> Iterator[None]:
    """Raise `Stopped` in the body on the first SIGINT, SIGTERM or SIGHUP; no later one counts.

    Turning the device off and writing it down must not be interrupted by an impatient hand.
    """
    stopped = False

    def stop(number: int, _frame: FrameType | None) -> None:
        nonlocal stopped
        if not stopped:
            stopped = True
            raise Stopped(
                f"stopped by {signal.Signals(number).name}; a session goes on with the same command"
            )

    numbers = [getattr(signal, name) for name in _SIGNALS if hasattr(signal, name)]
    before = {number: signal.signal(number, stop) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
