"""Termination signals as exceptions, so that every exit of the program runs the same cleanup."""

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from protocol.errors import BadInput, WorkFailed

# Of all these, Windows has only SIGINT and SIGTERM.
TERMINATION = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT")
"""The signals that ask a program to end."""
_AGAIN_S = 0.01
"""Time until a stop request is raised again that could not be raised, or got lost."""


class Stopped(WorkFailed):
    """A signal ended the program."""


class _Stop:
    """The pending stop request; there is one per process, because signals belong to it."""

    def __init__(self) -> None:
        self.request: Stopped | None = None
        self.raised = False
        self.shields = 0
        self.suspension = False
        self.later: BaseException | None = None
        """What a handler of another kind raises once nothing defers it: see `raise_soon`."""

    def handle(self, number: int, frame: FrameType | None = None) -> None:
        """Take the first signal as the request; ignore later ones.

        Python calls this in the main thread, between any two bytecode instructions.
        """
        if self.request is None:
            self.request = Stopped(f"stopped by {signal.Signals(number).name}")
        # An interrupted import prints tracebacks of its own, or leaves half a module.
        if not (_importing(frame) and self.raise_later()):
            self.raise_request()

    def refuse_suspension(self, *_: object) -> None:
        """Take SIGTSTP, and keep it for `take_suspension`."""
        self.suspension = True

    def raise_later(self) -> bool:
        """Have `handle` called again in a moment; return whether this system can do so."""
        timer = hasattr(signal, "setitimer")
        if timer:
            signal.setitimer(signal.ITIMER_REAL, _AGAIN_S)
        return timer

    def lost(self, error: BaseException | None) -> bool:
        """Return whether `error`, which Python ignores, was the request; raise it again if so."""
        if error is None or error is not self.request:
            return False
        self.raised = False
        return self.raise_later()

    def raise_request(self) -> None:
        """Raise the request once, unless it is deferred."""
        if self.later is not None and self.shields == 0:
            later, self.later = self.later, None
            raise later
        if self.request is not None and not self.raised and self.shields == 0:
            self.raised = True
            raise self.request


def _importing(frame: FrameType | None) -> bool:
    while frame is not None and "importlib._bootstrap" not in frame.f_code.co_filename:
        frame = frame.f_back
    return frame is not None


_stop = _Stop()


def raise_if_stopped() -> None:
    """Raise the stop request again, unless there is none or it is deferred.

    The first exception can get lost if the signal arrives in foreign code, such as a finalizer.
    """
    if _stop.request is not None and _stop.shields == 0:
        raise _stop.request


def is_deferring() -> bool:
    """Return whether the main thread is in a `stops_deferred` block."""
    return _stop.shields > 0


def raise_soon(error: BaseException) -> None:
    """Raise `error`, in a handler of one's own, once no `stops_deferred` block runs any more."""
    _stop.later = _stop.later or error
    _stop.raise_request()


def is_stopping() -> bool:
    """Return whether there was a signal, deferred or not."""
    return _stop.request is not None


@contextmanager
def signals_raise() -> Iterator[None]:
    """Raise `Stopped` in the body on the first SIGINT, SIGTERM, SIGHUP or SIGQUIT.

    An internal error after a stop request is raised as the stop: an interrupted import, for
    example, raises an error of its own.
    """
    global _stop  # noqa: PLW0603 - see _Stop
    _stop = _Stop()
    names = (*TERMINATION, "SIGALRM")
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    before = {number: signal.signal(number, _stop.handle) for number in numbers}
    hook, lost = sys.unraisablehook, _stop.lost
    sys.unraisablehook = lambda ignored: None if lost(ignored.exc_value) else hook(ignored)
    try:
        yield
    except (WorkFailed, BadInput, OSError):  # more important than the stop: an unknown output
        raise
    except Exception as error:
        if _stop.request is None:
            raise
        raise _stop.request from error
    finally:
        sys.unraisablehook = hook
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0)
        for number, handler in before.items():
            signal.signal(number, handler)
        _stop = _Stop()


@contextmanager
def stops_deferred() -> Iterator[None]:
    """Defer signals until the end of the body.

    Storing an event and updating the state, or turning the device off and reading it back, must
    not be separated. Only the main thread gets signals, so that others have nothing to defer.
    """
    if threading.get_ident() != threading.main_thread().ident:
        yield
        return
    stop = _stop
    stop.shields += 1
    try:
        yield
    finally:
        stop.shields -= 1
    stop.raise_request()  # not in `finally`: an error of the body takes precedence


@contextmanager
def errors_are_last() -> Iterator[None]:
    """Let an error of the body be the last: signals are deferred until `signals_raise` ends.

    Else a signal that comes while things are closed for the error would take its place, and the
    operator would not read what is known of the output.
    """
    try:
        yield
    except BaseException:
        _stop.shields += 1
        raise


@contextmanager
def stops_allowed() -> Iterator[None]:
    """Allow signals to end the body, inside a `stops_deferred` block.

    Signals are deferred again before the body is left, so that no signal can skip the code that
    must follow it, such as turning the device off.
    """
    stop = _stop
    stop.shields -= 1
    try:
        stop.raise_request()
        yield
    finally:
        stop.shields += 1


@contextmanager
def never_suspended(*, ends: bool = False) -> Iterator[None]:
    """Let no signal but SIGSTOP suspend the program in the body: its device would go on driving.

    Ctrl-Z (SIGTSTP) is kept for `take_suspension`; if it `ends` the body, it raises as Ctrl-C does.
    In the background, reading from the terminal fails, and changing it does not wait.
    """
    _stop.suspension = False
    handlers: dict[str, Any] = {
        "SIGTSTP": _stop.handle if ends else _stop.refuse_suspension,
        # Ignored: with a handler, the call that caused the signal would be made again and again.
        "SIGTTIN": signal.SIG_IGN,
        "SIGTTOU": signal.SIG_IGN,
    }
    before = {
        number: signal.signal(number, handler)
        for name, handler in handlers.items()
        if (number := getattr(signal, name, None)) is not None
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def take_suspension() -> bool:
    """Return whether somebody wanted to suspend the program since the last call."""
    asked = _stop.suspension
    if asked:  # else a signal that comes just now would be forgotten
        _stop.suspension = False
    return asked
