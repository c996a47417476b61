"""The rigs that this process holds open: each is turned off however the process ends.

That does not hang on who opened a rig, or on who closes it, where and when: a rig stays in the list
`_held` until its output is read back as off, and every end that Python notices closes what is in
there. What Python does not notice, such as SIGKILL, is for the device's watchdog.
"""

import atexit
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

from device.rig import Rig
from protocol.errors import WorkFailed
from runner.people.terminal import visible
from runner.signals import TERMINATION, is_deferring, raise_soon, stops_deferred
from touchbeam.script_journal import Entries

OFF = "output off, read back"


def say(line: str) -> None:
    """Print `line` on standard error, unless there is none; the program's output is its own."""
    if sys.stderr is not None:
        print(f"touchbeam: {visible(line)}", file=sys.stderr, flush=True)


class HeldRig:
    """An open rig, until somebody closes it: its program, a collector of garbage, or the end.

    `stepped` is a simulated one without a thread, which works only while its program calls it.
    """

    def __init__(self, device: Rig, entries: Entries, stack: ExitStack, *, stepped: bool) -> None:
        self.device = device
        self.entries = entries
        self.is_open = True
        self.stopped_by = ""
        """The signal that stopped it, in words."""
        self._stack = stack
        self._stepped = stepped
        self._process = os.getpid()
        self._thread = threading.get_ident()
        self._closes = False
        self._one_closes = threading.RLock()
        if _ended.is_set():
            raise WorkFailed("the program is ending; no rig can be opened any more")
        _held.append(self)
        _closed_with_a_pool()

    @property
    def is_ours(self) -> bool:
        """Whether this process opened it; a fork of that process has neither port nor thread."""
        return self._process == os.getpid()

    def close(self, then: Callable[[], None] = lambda: None) -> None:
        """Turn the output off, read it back and give the rig back; a second time does nothing.

        `then` is called between. Raise RuntimeError if the device does not confirm that it is off.
        A signal waits. Whatever else breaks this off leaves the rig held, so that the end of the
        program tries again.
        """
        if not self.is_ours:
            return
        with stops_deferred(), self._one_closes:
            if self.is_open:
                self._closes = True
                try:
                    self._close(then)
                finally:
                    self._closes = False

    def _close(self, then: Callable[[], None]) -> None:
        unknown: Exception | None = None
        try:
            self.device.off()
        except Exception as error:
            unknown = error
        with self._released():
            if unknown is not None:
                with suppress(Exception):  # that the output may be on matters more
                    self.entries.over(confirmed=False)
                raise unknown
            try:
                try:
                    then()
                finally:
                    self.entries.over(confirmed=True)
            except Exception as error:
                if OFF not in str(error):
                    error.add_note(OFF)
                raise

    @contextmanager
    def _released(self) -> Iterator[None]:
        try:
            with self._stack:
                yield
        finally:
            self.is_open = False
            _held.remove(self)

    def forgotten(self) -> None:
        """Close a rig to which no name leads any more."""
        if not (self.is_open and self.is_ours):
            return
        self.entries.why = self.stopped_by or "the program forgot the rig"
        if threading.get_ident() == self._thread:
            self.close_or_say()
            return
        # Garbage is collected in any thread, also in the owner of the port, who cannot wait for
        # itself. Python waits for a thread that is no daemon; too late for one, the end closes it.
        with suppress(RuntimeError):
            threading.Thread(target=self.close_or_say, daemon=False).start()

    def close_or_say(self) -> None:
        """Close it where nobody takes an exception."""
        try:
            self.close()
        except Exception as error:
            say(" ".join(f"{error}".split()))

    def stop(self, why: str) -> None:
        """Turn the output off at once, from a signal's handler; whoever uses it gets an error."""
        if self._closes:
            return
        self.stopped_by = self.entries.why = why
        if not self._stepped:
            self.device.emergency_stop()


_held: list[HeldRig] = []
_ended = threading.Event()


# At the end Python waits for threads that are no daemons, which may go on to drive, and then calls
# this; daemons, such as the owner of a port, run until it returns.
@atexit.register
def _close_all() -> None:
    _ended.set()
    for held in tuple(_held):
        held.close_or_say()


def _closed_with_a_pool() -> None:
    """Have the end of a process of `multiprocessing` close all, too: it skips `atexit`."""
    processes = sys.modules.get("multiprocessing.process")
    if processes is not None and processes.parent_process() is not None:
        from multiprocessing.util import Finalize

        Finalize(None, _close_all, exitpriority=0)


# Signals. Python lets only the main thread set a handler, and runs it there.

_users: set[object] = set()
_before: dict[int, Any] = {}
"""The handlers that were there, by signal."""


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Have signals that would end the program turn off every rig first; its own handlers stay.

    They are taken while any rig is open and was opened by the main thread.
    """
    user = object()
    _users.add(user)
    if not _before and _is_main():
        for number in (getattr(signal, name) for name in TERMINATION if hasattr(signal, name)):
            if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
                _before[number] = signal.signal(number, _stopped)
    try:
        yield
    finally:
        _users.discard(user)
        if not _users and _is_main():
            _give_back()


def _is_main() -> bool:
    return threading.current_thread() is threading.main_thread()


def _give_back() -> None:
    while _before:
        number, handler = _before.popitem()
        if signal.getsignal(number) is _stopped:
            signal.signal(number, handler)


def _stopped(number: int, _: object) -> None:
    if not _users:  # another thread closed the last rig, and could not give this back
        _give_back()
        signal.raise_signal(number)
        return
    for held in tuple(_held):
        held.stop(f"the rig was stopped by {signal.Signals(number).name}")
    # From here on Python only waits for threads, and would lose an exception.
    if not threading.main_thread().is_alive():
        if not is_deferring():
            _close_all()
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)
        return
    raise_soon(KeyboardInterrupt() if number == signal.SIGINT else SystemExit(128 + number))


def _forget_the_parents() -> None:
    """In a fork: never let go of the rigs of the process that it was: that would close them."""
    if _held:
        import ctypes

        for held in _held:
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(held))
    _held.clear()
    _users.clear()
    _give_back()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_the_parents)
