"""`touchbeam simulate-device`: the simulated device in the foreground."""

import os
import signal
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from types import FrameType

from device.simulator.device import simulated_device
from device.simulator.door import ControlDoor
from device.simulator.lines import Line, PtyLine, TcpLine
from device.simulator.server import Server
from protocol.errors import BadInput


def simulate(
    wire: str,
    place: str,
    control: Path | None,
    *,
    dialect: str,
    keep: bool,
    seed: int,
    say: Callable[[str], None],
) -> None:
    """Serve a simulated device until its host is gone, or until SIGTERM or Ctrl-C.

    Args:
        wire: `pty` or `tcp`.
        place: the path of the pseudo-terminal's link, or a loopback port (0: any).
        control: where to make the control socket, if anywhere.
        dialect: one of `device.simulator.device.DIALECTS`.
        keep: stay when the host is gone.
        seed: what the hidden properties of the beam follow from.
        say: called once with `ready URL`.

    Raises:
        BadInput: the place is taken or cannot be used.
    """
    ending = _Ending()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, ending.ask)
    parent = os.getppid()
    with ExitStack() as stack:
        line = _line(wire, place)
        stack.callback(line.close)
        door = None
        if control is not None:
            door = _door(control)
            stack.callback(door.close)
        server = Server(simulated_device(seed, dialect=dialect), line, door)
        say(f"ready {line.url}")
        ending.ends(lambda: server.serve(keep=keep, orphaned=lambda: os.getppid() != parent))


class _Ending:
    """The wish that the device ends: heeded while it serves, not while it is made or cleared away.

    One that comes before ends it as soon as it would serve.
    """

    def __init__(self) -> None:
        self._asked = False
        self._serving = False

    def ask(self, _number: int, _frame: FrameType | None) -> None:
        """Take a signal."""
        self._asked = True
        if self._serving:
            self._serving = False
            raise KeyboardInterrupt

    def ends(self, serve: Callable[[], None]) -> None:
        """Serve until it is over or a signal comes."""
        try:
            self._serving = True
            if not self._asked:
                serve()
            self._serving = False
        except KeyboardInterrupt:
            return


def _line(wire: str, place: str) -> Line:
    try:
        return PtyLine(Path(place)) if wire == "pty" else TcpLine(_port(place))
    except OSError as error:
        raise BadInput(f"{place}: cannot be used ({error.strerror}); name another place") from error


def _port(text: str) -> int:
    if not text.isdecimal() or int(text) > 65_535:
        raise BadInput(f"a port must be a whole number in [0, 65535], got {text!r}")
    return int(text)


def _door(path: Path) -> ControlDoor:
    try:
        return ControlDoor(path)
    except OSError as error:
        raise BadInput(f"{path}: cannot be made ({error.strerror or error})") from error
