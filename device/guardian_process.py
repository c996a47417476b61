"""The process of a guardian: it turns an output off when its program falls silent or ends.

It is run by its path and imports nothing of touchbeam, so that it starts in some 20 ms and nothing
of the program that it watches can hold it up.
"""

import os
import select
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
SENT_AGAIN_S = 0.1
_SEND_S = 1.0
_IGNORED = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGTSTP", "SIGTTIN", "SIGTTOU", "SIGPIPE")
_COUNTS_SLEEP = getattr(time, "CLOCK_BOOTTIME", None)


def passed_s() -> float:
    """Return seconds since some moment; on Linux they pass while the computer sleeps, too."""
    return time.monotonic() if _COUNTS_SLEEP is None else time.clock_gettime(_COUNTS_SLEEP)


def guard(program: socket.socket, device: int, off: bytes, limit_s: float) -> None:
    """Send `off` to `device` when `program` was silent for `limit_s`, or ended, while it was on.

    Beats carry their own times, so that neither a slow guardian nor a late look at them matters:
    what counts is the longest gap between two beats, also one that is over when it is read.
    """
    parent, watching, last_s, unread = os.getppid(), False, passed_s(), b""
    # The connection alone does not tell: a fork of the program may hold it open for ever.
    while os.getppid() == parent:
        wait_s = max(last_s + limit_s - passed_s(), 0.0) if watching else ALIVE_EVERY_S
        if select.select([program], [], [], wait_s)[0]:
            heard = _received(program)
            if not heard:
                break
            unread += heard
            whole = len(unread) // BEAT.size * BEAT.size
            beats, unread = list(BEAT.iter_unpack(unread[:whole])), unread[whole:]
        else:
            beats = [(watching, passed_s())]
        for on, at_s in beats:
            if watching and at_s - last_s > limit_s:
                _send(device, off)
                _alarm(program)
            watching, last_s = on, at_s
    if watching:
        _send(device, off)
        # The program died perhaps between two halves of a line, or its last line came between.
        time.sleep(SENT_AGAIN_S)
        _send(device, off)


def _received(program: socket.socket) -> bytes:
    try:
        return program.recv(4096)
    except OSError:  # reset, because the program died with an alarm unread
        return b""


def _alarm(program: socket.socket) -> None:
    try:
        program.send(ALARM, getattr(socket, "MSG_DONTWAIT", 0))
    except OSError:  # nobody is there to be told: the next read says so
        return


def _send(device: int, data: bytes) -> None:
    """Write all of `data`; the descriptor is shared, so that it must stay as the program set it."""
    until_s = passed_s() + _SEND_S
    while data and passed_s() < until_s:
        try:
            data = data[os.write(device, data) :]
        except BlockingIOError:
            select.select([], [device], [], SENT_AGAIN_S)
        except OSError:  # the port is gone
            return


def main() -> None:
    """Guard as the arguments say: the two descriptors, the limit in s, and off in hexadecimal."""
    # A closed terminal, a logout, Ctrl-C and Ctrl-Z end or stop the program, and not this process.
    for name in _IGNORED:
        signal.signal(getattr(signal, name), signal.SIG_IGN)
    program, device, limit_s, off = sys.argv[1:]
    with socket.socket(fileno=int(program)) as beats:
        beats.send(READY)
        guard(beats, int(device), bytes.fromhex(off), float(limit_s))


if __name__ == "__main__":
    main()
