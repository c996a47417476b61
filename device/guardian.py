"""The program's sign of life, and the guardian that turns an output off without it.

A board has a watchdog of its own; a generator has none, and gets a process that holds the same
connection. Whatever ends or stops the program, also an interpreter that is stuck in foreign code:
the process hears nothing any more, and sends off.
"""

import os
import socket
import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack, suppress

from device import guardian_process
from device.errors import DeviceError
from device.guardian_process import ALARM, BEAT, READY

STARTS_S = 10.0
"""More than a guardian takes to start on a busy computer."""
_ENDS_S = 2.0


class Guardian:
    """A process that sends `off` to `descriptor` once it heard nothing for `limit_s`.

    The descriptor is that of the port; `off` begins with a line end, because the program may have
    died in the middle of a command.
    """

    def __init__(self, descriptor: int, off: bytes, limit_s: float) -> None:
        self._descriptor = descriptor
        self._off = off
        self._limit_s = limit_s
        self._socket: socket.socket | None = None
        self._is_deaf = False
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start the process, unless it runs; raise `DeviceError` if it does not get ready."""
        if self._process is not None and self._process.poll() is None:
            return
        self.close()
        import fcntl  # not on Windows, where no guardian is made

        ours, its = socket.socketpair()
        try:
            with its, ExitStack() as copies:
                # A program without standard streams may have its port at their numbers, and there
                # the process has /dev/null.
                numbers = []
                for number in (its.fileno(), self._descriptor):
                    numbers.append(fcntl.fcntl(number, fcntl.F_DUPFD_CLOEXEC, 3))
                    copies.callback(os.close, numbers[-1])
                arguments = (*numbers, self._limit_s, self._off.hex())
                self._process = subprocess.Popen(
                    # Isolated: neither the folder nor the environment gives it other modules.
                    [sys.executable, "-I", "-S", guardian_process.__file__, *map(str, arguments)],
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                    pass_fds=numbers,
                    start_new_session=True,  # no signal of a terminal reaches it
                )
            ours.settimeout(STARTS_S)
            is_ready = ours.recv(len(READY)) == READY
            ours.setblocking(False)
        except OSError as error:
            why, is_ready = str(error), False
        else:
            why = "it ended at once"
        if not is_ready:
            ours.close()
            self._ended()
            raise DeviceError(f"the guardian of the output cannot start: {why}")
        self._socket, self._is_deaf = ours, False

    def hears(self, at_s: float, *, on: bool) -> None:
        """Tell it that the program lives at `at_s`, and whether the output may be on."""
        if self._socket is None:
            return
        try:
            self._socket.send(BEAT.pack(on, at_s))
        except BlockingIOError:  # it has read none of some hundred
            self._is_deaf = True
        except OSError:  # it has ended: `has_tripped` says so
            return

    def has_tripped(self) -> bool:
        """Return whether it has turned the output off; raise `DeviceError` if it has ended."""
        if self._socket is None:
            return False
        try:
            heard = self._socket.recv(4096)
        except BlockingIOError:
            if self._is_deaf:
                raise DeviceError("the guardian of the output does not listen") from None
            return False
        except OSError:
            heard = b""
        if not heard:
            raise DeviceError("the guardian of the output has ended (was it killed?)")
        return ALARM in heard

    def close(self) -> None:
        """End the process; it turns off what may be on."""
        if self._socket is not None:
            with suppress(OSError):  # it has ended
                # Also where a fork of the program holds the connection open.
                self._socket.shutdown(socket.SHUT_RDWR)
            self._socket.close()
            self._socket = None
            self._ended()

    def _ended(self) -> None:
        if self._process is None:
            return
        try:
            self._process.wait(_ENDS_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._process = None


class Pulse:
    """The sign of life of the port's owner while the output may be on, and the gaps in it.

    `beat` looks at the gap before it, so that no stop of the program passes unseen, whatever it did
    at that moment. A guardian, if there is one, hears each beat.
    """

    def __init__(
        self, monotonic: Callable[[], float], limit_s: float, guardian: Guardian | None = None
    ) -> None:
        self._monotonic = monotonic
        self._limit_s = limit_s
        self._guardian = guardian
        self._on = False
        self._last_s = monotonic()
        self._stood_s = 0.0

    def start(self) -> None:
        """Have the guardian ready; raise `DeviceError` if it cannot start."""
        if self._guardian is not None:
            self._guardian.start()

    def watch(self) -> None:
        """The output may be on from now on."""
        if not self._on:
            self._last_s, self._on = self._monotonic(), True
        self.beat()

    def beat(self) -> None:
        """The program lives."""
        now_s = self._monotonic()
        if self._on and (gap_s := now_s - self._last_s) > self._limit_s:
            self._stood_s = max(self._stood_s, gap_s)
        self._last_s = now_s
        if self._guardian is not None:
            self._guardian.hears(now_s, on=self._on)

    def release(self) -> str:
        """The output is off, read back; return as `broken`."""
        self.beat()
        try:
            why = self.broken()
        except DeviceError as error:  # off is off, also without a guardian
            why = str(error)
        self._on = False
        self.beat()
        return why

    def broken(self) -> str:
        """Return, once, for how long all of the program stood still while it was watched, or ''.

        What stopped it cannot be known. Raise `DeviceError` if the guardian has ended.
        """
        tripped = self._guardian is not None and self._guardian.has_tripped()
        stood_s, self._stood_s = self._stood_s, 0.0
        if not (stood_s or tripped):
            return ""
        why = (
            f"the program stood still for {max(stood_s, self._limit_s):.1f} s (it was stopped, or "
            "the computer slept or was too busy)"
        )
        return why + "; its guardian turned the output off" * tripped

    def close(self) -> None:
        """End the guardian; it turns off what may be on."""
        if self._guardian is not None:
            self._guardian.close()


def guardian_of(descriptor: int | None, off: bytes, limit_s: float) -> Guardian | None:
    """Return a guardian, not started; None where no other process can hold the port (Windows)."""
    if descriptor is None or os.name != "posix":
        return None
    return Guardian(descriptor, off, limit_s)
