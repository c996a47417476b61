"""The server of a simulated device: its wire, its control socket, and its end by a signal.

One thread. It ends when its host is gone, after the watchdog has taken the output to 0 V; a
generator has none, and is switched off at the end.
"""

import os
import select
import signal
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from types import FrameType
from typing import Any

from device.errors import DeviceError
from device.link.codec import LineBuffer
from device.simulator.device import SimulatedDevice
from device.simulator.gauge_line import GaugeLine
from device.simulator.models.scpi import ScpiError
from device.simulator.transports import ControlDoor, Line, LineKind, PtyLine, TcpLine
from device.simulator.wire import Wire
from protocol.errors import BadInput

TICK_S = 0.01
"""How often the host and the watchdog are looked at, at least."""
_OVERRUN = ScpiError(-363, "Input buffer overrun")


class Server:
    """A device on a line, with a door for hands."""

    def __init__(
        self,
        device: SimulatedDevice,
        line: Line,
        door: ControlDoor | None,
        wall_s: Callable[[], float] = time.monotonic,
        gauge: GaugeLine | None = None,
    ) -> None:
        self._gauge = gauge
        self._device = device
        self._line = line
        self._door = door
        self._wall_s = wall_s
        self._wire = Wire(line, device.broken.active, wall_s)
        self._buffer = LineBuffer()
        self._there = True
        self._announced: set[str] = set()

    def serve(self, *, keep: bool = False, orphaned: Callable[[], bool] = lambda: False) -> None:
        """Serve until the host is gone and the output is off; for ever if `keep`.

        `orphaned` says whether whoever started us is gone, so that a host which never came is no
        reason to wait for ever.
        """
        gone, instrument = False, self._device.instrument
        while keep or not gone or (instrument.output and instrument.watchdog_s is not None):
            self._wait(listening=not gone)
            gone = self.step() or orphaned()
            if self._gauge is not None:
                self._gauge.serve()
            if self._door is not None:
                self._door.serve(self.answer_control)

    def step(self) -> bool:
        """Do what is due now; return whether the host is gone."""
        gone = self._hear()
        self._device.instrument.watch(self._wall_s())
        self._wire.wait()
        return gone

    def idle_s(self, longest_s: float) -> float:
        """Return how long nothing is due, `longest_s` at most."""
        left_s = self._device.instrument.silence_left_s(self._wall_s())
        return self._wire.idle_s(longest_s if left_s is None else min(max(left_s, 0.0), longest_s))

    def answer_control(self, line: str) -> str:
        """Do what a hand asks for; it is done when this returns."""
        answer = self._device.answer_control(line)
        self._vanish_or_come_back()
        if self._gauge is not None:
            self._gauge.vanish_or_come_back()
        self._announce()
        return answer

    def _wait(self, *, listening: bool) -> None:
        """Wait until somebody does something or something is due, a tick at most.

        A line that hung up is nobody.
        """
        faults = self._device.broken.active
        listening = listening and self._there and "deaf" not in faults
        sources: list[Any] = [self._line] if listening else []
        sources += self._door.sockets() if self._door else []
        sources += [self._gauge.line] if self._gauge and self._gauge.listens else []
        if sources:
            select.select(sources, [], [], self.idle_s(TICK_S))
        else:  # Windows cannot wait for nothing
            time.sleep(self.idle_s(TICK_S))

    def _hear(self) -> bool:
        """Answer what came; return whether the host is gone."""
        if not self._there or "deaf" in self._device.broken.active:
            return False
        received = self._line.receive()
        for line in self._lines(self._wire.heard(received)) if received else ():
            answer = self._device.answer_bytes(line, self._wall_s())
            if answer is not None:
                self._wire.reply(line.decode("ascii", "replace"), answer)
        if received is None:
            self._buffer.clear()  # of a line that the host did not end
        return received is None

    def _lines(self, received: bytes) -> list[bytes]:
        try:
            return self._buffer.feed(received)
        except DeviceError:
            self._device.complain(_OVERRUN)
            return []

    def _vanish_or_come_back(self) -> None:
        there = "vanish" not in self._device.broken.active
        if there and not self._there:
            self._line.come_back()
        elif self._there and not there:
            self._line.hang_up()
        self._there = there

    def _announce(self) -> None:
        """A device that starts may have something to say."""
        starting = self._device.broken.active & {"banner", "brown-out"}
        banner = self._device.dialect.banner
        if starting - self._announced and banner and self._there:
            self._wire.announce(banner)
        self._announced = starting


def simulate(
    wire: LineKind,
    place: str,
    control: Path | None,
    make: Callable[[], SimulatedDevice],
    *,
    gauge: str | None = None,
    keep: bool,
    say: Callable[[str], None],
) -> None:
    """Serve a simulated device until SIGTERM or Ctrl-C, or, unless `keep`, until its host is gone.

    `make` returns the device, `place` is the path of the pseudo-terminal's link, or a loopback
    port (0: any), `gauge` is such a place for a gauge on the same beam, if there is to be one, and
    `control` is the path of a socket for hands. `say` is called with `gauge URL`, if there is one,
    and then with `ready URL`.

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
        device, gauge_line = make(), None
        device.beam.set_up()
        if gauge is not None:
            gauge_line = GaugeLine(device, _line(wire, gauge))
            stack.callback(gauge_line.line.close)
            say(f"gauge {gauge_line.line.url}")
        server = Server(device, line, door, gauge=gauge_line)
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


def _line(wire: LineKind, place: str) -> Line:
    if wire == "tcp" and not (place.isdecimal() and int(place) <= 65_535):
        raise BadInput(f"a port must be a whole number in [0, 65535], got {place!r}")
    if wire == "pty" and not hasattr(os, "openpty"):
        raise BadInput("this system has no pseudo-terminals; use: touchbeam simulate-device tcp 0")
    try:
        return PtyLine(Path(place)) if wire == "pty" else TcpLine(int(place))
    except OSError as error:
        raise BadInput(f"{place}: cannot be used ({error.strerror}); name another place") from error


def _door(path: Path) -> ControlDoor:
    try:
        return ControlDoor(path)
    except OSError as error:
        raise BadInput(f"{path}: cannot be made ({error.strerror or error})") from error
