"""The server of a simulated device: its wire, its control socket, and its end by a signal.

One thread. It ends when its host is gone, after the watchdog has taken the output to 0 V; a
generator has none, and is switched off at the end.
"""

import os
import re
import select
import signal
import time
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from types import FrameType
from typing import Any

from device.errors import DeviceError
from device.link.codec import LineBuffer, text
from device.simulator.device import SimulatedDevice
from device.simulator.models.scpi import ScpiError
from device.simulator.transports import ControlDoor, Line, LineKind, PtyLine, TcpLine
from protocol.errors import BadInput


class GaugeLine:
    """A gauge on a line: lines in, answers out, as far as the faults let them."""

    def __init__(self, device: SimulatedDevice, line: Line) -> None:
        self._device = device
        self._active = device.broken.active
        self.line = line
        self._buffer = LineBuffer()
        self.there = True
        self.gone = False
        """Whether its host has hung up, and nobody has come since."""

    def serve(self) -> None:
        if not self.there:
            return
        received = self.line.receive()
        self.gone = received is None
        for line in _lines(self._buffer, received, lambda: None):
            self._answer(line)

    def _answer(self, line: bytes) -> None:
        self._device.pass_time()
        try:
            answer = self._device.gauge.answer(text(line))
        except DeviceError:
            answer = None
        if answer is None or "gauge-silent" in self._active:
            return
        data = answer.encode("ascii")
        if "gauge-garbled-once" in self._active and line.startswith(b"DATA?"):
            self._active.discard("gauge-garbled-once")
            data = data.replace(b"0", b"1")
        self.line.send(data + b"\n")


def _is_there(line: Line, was: bool, present: bool) -> bool:
    """Let a line come back or vanish, as a fault wants it; return whether it is there."""
    if present and not was:
        line.come_back()
    elif was and not present:
        line.hang_up()
    return present


def _lines(buffer: LineBuffer, received: bytes | None, overrun: Callable[[], None]) -> list[bytes]:
    """Return the lines that end in what came; None is a host that is gone, maybe within a line."""
    if received is None:
        buffer.clear()
    try:
        return buffer.feed(received or b"")
    except DeviceError:
        overrun()
        return []


LATE_S = 0.6
DRIP_S = 0.05
FLOOD = b"unasked 1.0\n" * 40
_STAND_INS = {
    "reply-nan": "NAN",
    "reply-inf": "INF",
    "reply-overflow": "9.91E+37",
    "reply-underscore": "1_000",
    "reply-empty": "",
}
_VALUES = re.compile(r"FREQ|VOLT|MEAS", re.IGNORECASE)
_NUMERIC = re.compile(r"[+-]?\d+(\.\d*)?(E[+-]?\d+)?")
_LINE_ENDS = {"line-end-cr": b"\r", "line-end-crlf": b"\r\n"}


class Wire:
    """Sends answers when they are due; `active` are the faults that are on."""

    def __init__(self, line: Line, active: set[str], wall_s: Callable[[], float]) -> None:
        self._line = line
        self._active = active
        self._wall_s = wall_s
        self._due: deque[tuple[float, bytes]] = deque()
        self._first_block = b""
        self._mixed = cycle((b"\n", b"\r\n", b"\r"))

    def heard(self, data: bytes) -> bytes:
        """Return what gets through of what came."""
        if "dead-peer" in self._active:
            return b""
        if "echo" in self._active and data:
            self._line.send(data)
        return data

    def reply(self, query: str, answer: str) -> None:
        """Send `answer`, a letter for each byte, as far as the faults let it."""
        is_block = answer.startswith("#")
        if not (self._active or is_block):
            self.send(answer.encode("latin-1") + b"\n")
            return
        opc = "opc-silent" in self._active and "*OPC?" in query.upper()
        if opc or self._active & {"silent", "dead-peer"}:
            return
        data = self._stood_in(query, answer).encode("latin-1")
        if self._taken("garbled") or (is_block and self._taken("block-garbled")):
            data = bytes(byte ^ 0x80 if place % 3 == 0 else byte for place, byte in enumerate(data))
        if "truncated-reply" in self._active or (is_block and self._taken("block-truncated")):
            data = data[: len(data) // 2]
        else:
            data += self._line_end()
        if is_block:
            data = self._of_blocks(data)
        self.send(data)

    def _of_blocks(self, data: bytes) -> bytes:
        self._first_block = self._first_block or data
        if "block-stale" in self._active:
            return self._first_block
        if self._taken("block-lost"):
            return b""
        return 2 * data if self._taken("block-doubled") else data

    def wait(self) -> None:
        if "flood" in self._active:
            self._line.send(FLOOD)
        while self._due and self._due[0][0] <= self._wall_s():
            self._line.send(self._due.popleft()[1])

    def forget(self) -> None:
        """Send nothing that is late, nor an old block, as after power has come."""
        self._due.clear()
        self._first_block = b""

    def idle_s(self, longest_s: float) -> float:
        """Return how long nothing is due, `longest_s` at most."""
        if "flood" in self._active:
            return 0.001
        if not self._due:
            return longest_s
        return min(max(self._due[0][0] - self._wall_s(), 0.0), longest_s)

    def send(self, data: bytes) -> None:
        """Send a line; those that are late keep their order."""
        late_s = LATE_S if self._active and self._taken("late-reply") else 0.0
        drip = "slow-drip" in self._active
        if not (late_s or drip or self._due):
            self._line.send(data)
            return
        start_s = max(self._wall_s() + late_s, self._due[-1][0] if self._due else 0.0)
        pieces = [bytes([byte]) for byte in data] if drip else [data]
        self._due += [(start_s + DRIP_S * number, piece) for number, piece in enumerate(pieces)]

    def _stood_in(self, query: str, answer: str) -> str:
        for name, word in _STAND_INS.items():
            if name in self._active and _VALUES.search(query):
                fields = answer.split(";")
                return ";".join(word if _NUMERIC.fullmatch(field) else field for field in fields)
        return answer

    def _line_end(self) -> bytes:
        if "line-end-mixed" in self._active:
            return next(self._mixed)
        return next((end for name, end in _LINE_ENDS.items() if name in self._active), b"\n")

    def _taken(self, name: str) -> bool:
        """Whether a fault is on; one that comes once is used up by being asked for."""
        once = f"{name}-once"
        if once in self._active:
            self._active.discard(once)
            return True
        return name in self._active


TICK_S = 0.01
"""How often the host and the watchdog are looked at, at least."""
_OVERRUN = ScpiError(-363, "Input buffer overrun")


@dataclass
class Server:
    """A device on a line, with a door for hands."""

    device: SimulatedDevice
    line: Line
    door: ControlDoor | None
    wall_s: Callable[[], float] = time.monotonic
    gauge: GaugeLine | None = None

    def __post_init__(self) -> None:
        self._wire = Wire(self.line, self.device.broken.active, self.wall_s)
        self._buffer = LineBuffer()
        self._there = True
        self._announced: set[str] = set()

    def serve(self, *, keep: bool = False, orphaned: Callable[[], bool] = lambda: False) -> None:
        """Serve until the host is gone and the output is off; for ever if `keep`.

        `orphaned` says whether who started us is gone: a host may never come.
        """
        gone, instrument = False, self.device.instrument
        while keep or not gone or (instrument.output and instrument.watchdog_s is not None):
            self._wait(listening=not gone)
            gone = self.step() or orphaned()
            if self.gauge is not None:
                self.gauge.serve()
            if self.door is not None:
                self.door.serve(self.answer_control)

    def step(self) -> bool:
        """Do what is due now; return whether the host is gone."""
        gone = self._hear()
        self.device.instrument.watch(self.wall_s())
        self._wire.wait()
        return gone

    def idle_s(self, longest_s: float) -> float:
        left_s = self.device.instrument.silence_left_s(self.wall_s())
        return self._wire.idle_s(longest_s if left_s is None else min(max(left_s, 0.0), longest_s))

    def answer_control(self, line: str) -> str:
        """Do what a hand asks for; it is done when this returns."""
        answer = self.device.answer_control(line)
        if line.split() == ["reset"]:
            self._wire.forget()
        present = "vanish" not in self.device.broken.active
        self._there = _is_there(self.line, self._there, present)
        if (gauge := self.gauge) is not None:
            present = "gauge-vanish" not in self.device.broken.active
            gauge.there = _is_there(gauge.line, gauge.there, present)
        # A device that starts may have something to say.
        starting = self.device.broken.active & {"banner", "brown-out"}
        banner = self.device.dialect.banner
        if starting - self._announced and banner and self._there:
            self._wire.send(banner.encode("ascii") + b"\n")
        self._announced = starting
        return answer

    def _wait(self, *, listening: bool) -> None:
        """Wait until something happens or is due, a tick at most; a line that hung up is nobody."""
        faults = self.device.broken.active
        listening = listening and self._there and "deaf" not in faults
        sources: list[Any] = [self.line] if listening else []
        sources += self.door.sockets() if self.door else []
        if self.gauge and self.gauge.there and not self.gauge.gone:
            sources.append(self.gauge.line)
        if sources:
            select.select(sources, [], [], self.idle_s(TICK_S))
        else:  # Windows cannot wait for nothing
            time.sleep(self.idle_s(TICK_S))

    def _hear(self) -> bool:
        """Answer what came; return whether the host is gone."""
        if not self._there or "deaf" in self.device.broken.active:
            return False
        received = self.line.receive()
        heard = self._wire.heard(received) if received else received
        complain = self.device.dialect.status.complain
        for line in _lines(self._buffer, heard, lambda: complain(_OVERRUN)):
            answer = self.device.answer_bytes(line, self.wall_s())
            if answer is not None:
                self._wire.reply(line.decode("ascii", "replace"), answer)
        return received is None


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

    `make` returns the device. `place`, and `gauge` for a gauge on the same beam, is the path of the
    pseudo-terminal's link, or a loopback port (0: any), and `control` that of a socket for hands.
    `say` gets `gauge URL`, if there is one, then `ready URL`. Raise `BadInput` for an unusable
    place.
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
    """The wish that the device ends: heeded only while it serves, also one from before."""

    def __init__(self) -> None:
        self._asked = self._serving = False

    def ask(self, _number: int, _frame: FrameType | None) -> None:
        self._asked = True
        if self._serving:
            self._serving = False
            raise KeyboardInterrupt

    def ends(self, serve: Callable[[], None]) -> None:
        """Serve until it is over or a signal comes."""
        with suppress(KeyboardInterrupt):
            self._serving = True
            if not self._asked:
                serve()
            self._serving = False


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
