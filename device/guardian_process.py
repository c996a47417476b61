"""The process of a guardian: it turns an output off when its program falls silent or ends.

It is run by its path and imports nothing of touchbeam, so that it starts in some 20 ms and nothing
of the program that it watches can hold it up.
"""

import os
import signal
import socket
import struct
import sys
import time

BEAT = struct.Struct("<?d")
"""Whether the output may be on, and when the program said so on the clock `passed_s`."""
READY = b"+"
ALARM = b"!"
"""The output was turned off, because the program was silent."""
ALIVE_EVERY_S = 1.0
"""How often it looks whether the program is there while nothing is on."""
LEAST_WAIT_S = 0.001
SENT_AGAIN_S = 0.1
_SEND_S = 1.0
_IGNORED = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGTSTP", "SIGTTIN", "SIGTTOU", "SIGPIPE")
_COUNTS_SLEEP = getattr(time, "CLOCK_BOOTTIME", None)


def passed_s() -> float:
    """Return seconds since some moment; on Linux they pass while the computer sleeps, too."""
    return time.monotonic() if _COUNTS_SLEEP is None else time.clock_gettime(_COUNTS_SLEEP)


class Watch:
    """What the beats of a program say.

    They carry their own times, so that neither a slow guardian nor a late look at them matters: the
    longest gap between two beats counts, also one that is over when it is read.
    """

    def __init__(self, limit_s: float) -> None:
        self.on, self._last_s, self._limit_s, self._tripped = False, passed_s(), limit_s, False

    @property
    def wait_s(self) -> float:
        """For how long the program may be silent from now on."""
        return self._last_s + self._limit_s - passed_s() if self.on else ALIVE_EVERY_S

    def trips(self, on: bool, at_s: float) -> bool:
        """Return whether the program was silent for too long before the beat at `at_s`."""
        self._tripped = self.on and at_s - self._last_s > self._limit_s
        self.on, self._last_s = on, at_s
        return self._tripped

    def goes_on(self, on: bool) -> bool:
        """Return whether the next beat is the first after such a silence, with the output on."""
        return self._tripped and on


def guard(program: socket.socket, device: int, off: bytes, limit_s: float, parent: int) -> None:
    """Send `off` to `device` when the program was silent for `limit_s`, or ended, while it was on.

    The connection to `program` alone does not tell: a fork of `parent` may hold it open for ever.
    """
    watch, unread = Watch(limit_s), b""
    while True:
        is_there = os.getppid() == parent
        heard = _received(program, max(watch.wait_s * is_there, LEAST_WAIT_S))
        # What it said last is read first.
        if heard == b"" or (heard is None and not is_there):
            break
        unread += heard or b""
        whole = len(unread) // BEAT.size * BEAT.size
        beats, unread = list(BEAT.iter_unpack(unread[:whole])), unread[whole:]
        for on, at_s in beats if heard else [(watch.on, passed_s())]:
            again = watch.goes_on(on) and heard is not None
            if watch.trips(on, at_s):
                if _send(device, off):
                    _alarm(program)
            elif again:
                # A command that was stopped on its way may have gone out as the program went on.
                _send(device, off)
    if watch.on:
        _send(device, off)
        # The program died perhaps between two halves of a line, or its last line came between.
        time.sleep(SENT_AGAIN_S)
        _send(device, off)


def _received(program: socket.socket, wait_s: float) -> bytes | None:
    """Return what comes within `wait_s`, None if nothing does, and nothing at the end."""
    program.settimeout(wait_s)
    try:
        return program.recv(4096)
    except TimeoutError:
        return None
    except OSError:  # reset, because the program died with an alarm unread
        return b""


def _alarm(program: socket.socket) -> None:
    try:
        program.send(ALARM, getattr(socket, "MSG_DONTWAIT", 0))
    except OSError:  # nobody is there to be told: the next read says so
        return


def _send(device: int, data: bytes) -> bool:
    """Write `data`, return whether all of it went out.

    The descriptor is shared, so that it must stay as the program set it.
    """
    until_s = passed_s() + _SEND_S
    while data and passed_s() < until_s:
        try:
            data = data[os.write(device, data) :]
        except BlockingIOError:
            time.sleep(LEAST_WAIT_S)
        except OSError:  # the port is gone
            return False
    return not data


def main() -> None:
    """Guard as the arguments say: the two descriptors, the limit in s, and off in hexadecimal."""
    # A closed terminal, a logout, Ctrl-C and Ctrl-Z end or stop the program, and not this process.
    for name in _IGNORED:
        signal.signal(getattr(signal, name), signal.SIG_IGN)
    program, device, limit_s, off = sys.argv[1:]
    parent = os.getppid()  # before it is told that all is ready, after which it may end
    with socket.socket(fileno=int(program)) as beats:
        beats.send(READY)
        guard(beats, int(device), bytes.fromhex(off), float(limit_s), parent)


if __name__ == "__main__":
    main()
