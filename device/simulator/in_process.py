"""A simulated device in the caller's process and thread, on simulated time.

The bytes, the driver and the models are those of a device in a process of its own. There are no
sockets and no threads, and time passes only while somebody waits: a whole session runs as fast as
the machine allows, and always in the same way.
"""

import math
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass, field
from typing import Unpack

from device.drivers.driver import driver_of
from device.drivers.limits import Limits
from device.errors import DeviceError
from device.gauges.owner import GaugeDriver, GaugeOwner
from device.link.link import Link
from device.link.port import WRITE_TIMEOUT_S
from device.resonance import Resonance
from device.rig import Rig
from device.simulator.client import BeamControl, Touched
from device.simulator.device import SimulatedDevice
from device.simulator.server import GaugeLine, Server

DELAY_S = 0.0005
BUFFER = 4096
"""Most bytes that a line holds of what nobody reads."""
_MOMENT_S = 1e-6
"""The least step of time, so that rounding cannot stop it."""
_BEAT_S = 0.005
"""A tenth of the shortest watchdog: how often a hand that lets time pass says that it is alive."""
Unbroken = Callable[[], AbstractContextManager[None]]
"""Keeps signals away while it lasts: no Ctrl-C may leave half a command in a device."""


class InProcessDevice(BeamControl):
    """A simulated device and the line to it.

    `delay_s` returns how long each piece of data is on its way: with 0 s only waiting takes time,
    so that a fault which answers without end needs more. `cuts` returns where some number of bytes
    is cut into pieces. `work_s` returns how long the device works at each line, one after the
    other. The rest is as in `device.SimulatedDevice`.
    """

    def __init__(
        self,
        seed: int,
        dialect: str = "board",
        delay_s: Callable[[], float] = lambda: DELAY_S,
        cuts: Callable[[int], Sequence[int]] = lambda _: (),
        work_s: Callable[[], float] = lambda: 0.0,
        **friction: Unpack[Touched],
    ) -> None:
        self._now_s = 0.0
        self.unbroken: Unbroken = nullcontext
        """Surrounds each piece of work, of the device and of whoever owns its port."""
        self._line, self._gauge_line = (
            _Line(_Pieces(self.now_s, delay_s, cuts, work_s), _Pieces(self.now_s, delay_s, cuts))
            for _ in range(2)
        )
        self.inside: SimulatedDevice = SimulatedDevice(seed, self.now_s, dialect, **friction)
        self._gauge = GaugeLine(self.inside, self._gauge_line)
        self._server = Server(self.inside, self._line, None, self.now_s, self._gauge)
        self.on_step: Callable[[], None] = lambda: None
        """Called after everything that happens; it may look at what is inside."""

    def now_s(self) -> float:
        return self._now_s

    def advance(self, seconds: float) -> None:
        """Let `seconds` pass: data arrive, and the watchdog trips, each at its moment."""
        end_s = self._now_s + seconds
        while self._now_s < end_s:
            with self.unbroken():  # not the whole wait: a long one must end by Ctrl-C, too
                self.step_towards(end_s)

    def step_towards(self, end_s: float) -> None:
        """Let time pass until something happens, or until `end_s`."""
        now_s = self._now_s
        device_s = next_s = now_s + self._server.idle_s(end_s - now_s)
        for line in (self._line, self._gauge_line):
            if line.to_device.waiting:
                device_s = min(device_s, line.to_device.next_s(now_s))
            if line.to_host.waiting:
                next_s = min(next_s, line.to_host.next_s(now_s))
        next_s = min(next_s, device_s)
        self._now_s = min(max(next_s, now_s + _MOMENT_S), end_s)
        if device_s <= self._now_s:
            self.happen()

    def happen(self) -> None:
        self._server.step()
        if self._gauge_line.to_device.waiting:
            self._gauge.serve()
        self.inside.pass_time()
        self.on_step()

    def gauge_port(self) -> "InProcessPort":
        """Return the host's end of the gauge's line; as `port`."""
        return InProcessPort(self, self._gauge_line)

    def port(self) -> "InProcessPort":
        """Return the host's end, newly opened and alone; raise `OSError` if it has vanished."""
        return InProcessPort(self, self._line)

    def answer(self, line: str) -> str:
        with self.unbroken():
            answer = self._server.answer_control(line)
            self.on_step()
        return answer

    _answer = answer


class InProcessPort:
    """The host's end of the line, until another one is opened or the device hangs up."""

    def __init__(self, device: InProcessDevice, line: "_Line") -> None:
        line.open()
        self._device = device
        self._line = line
        self._opening = line.openings

    def receive(self, timeout_s: float) -> bytes:
        device, to_host = self._device, self._line.to_host
        end_s = device.now_s() + timeout_s
        self._require_open()
        while not (data := to_host.arrived()) and device.now_s() < end_s:
            device.step_towards(end_s)
            self._require_open()
        return data

    def send(self, data: bytes) -> None:
        self._require_open()
        if self._line.to_device.waiting + len(data) > BUFFER:
            self._device.advance(WRITE_TIMEOUT_S)
            raise OSError("Write timeout")
        self._line.to_device.add(data)
        if self._line.to_device.has_arrived():
            self._device.happen()

    def close(self) -> None:
        """Close the port; what is on its way to the device arrives."""
        self._opening = -1

    def _require_open(self) -> None:
        line = self._line
        if self._opening != line.openings or not line.there:
            raise OSError("the port is closed or has vanished")


@dataclass
class _Line:
    """The device's end of the line."""

    url = "in process"
    to_device: "_Pieces"
    to_host: "_Pieces"
    there: bool = field(default=True, init=False)
    openings: int = field(default=0, init=False)

    def open(self) -> None:
        if not self.there:
            raise OSError("no such port")
        self.openings += 1
        self.to_host.clear()

    def fileno(self) -> int:
        raise OSError("an in-process line has no descriptor")

    def receive(self) -> bytes:
        return self.to_device.arrived()

    def send(self, data: bytes) -> None:
        if self.to_host.waiting <= BUFFER:
            self.to_host.add(data)

    def hang_up(self) -> None:
        self.there = False
        self.openings += 1
        self.to_device.clear()
        self.to_host.clear()

    def come_back(self) -> None:
        self.there = True

    close = hang_up


@dataclass
class _Pieces:
    """Data on their way in one direction; they keep their order."""

    now_s: Callable[[], float]
    delay_s: Callable[[], float]
    cuts: Callable[[int], Sequence[int]]
    work_s: Callable[[], float] = lambda: 0.0
    waiting: int = field(default=0, init=False)
    _last_s: float = field(default=0.0, init=False)
    _pieces: deque[tuple[float, bytes]] = field(default_factory=deque, init=False)

    def add(self, data: bytes) -> None:
        if not data:
            return
        now_s, begin = self.now_s(), 0
        for end in (*self.cuts(len(data)), len(data)):
            begin_s = max(now_s + self.delay_s(), self._last_s)
            self._last_s = begin_s + self.work_s()
            self._pieces.append((self._last_s, data[begin:end]))
            begin = end
        self.waiting += len(data)

    def next_s(self, now_s: float) -> float:
        """Return when the next piece arrives; those that wait to be read have arrived."""
        return next((at_s for at_s, _ in self._pieces if at_s > now_s), math.inf)

    def has_arrived(self) -> bool:
        return bool(self._pieces) and self._pieces[0][0] <= self.now_s()

    def arrived(self) -> bytes:
        pieces, now_s, data = self._pieces, self.now_s(), b""
        while pieces and pieces[0][0] <= now_s:
            data += pieces.popleft()[1]
        self.waiting -= len(data)
        return data

    def clear(self) -> None:
        self._pieces.clear()
        self.waiting = 0


def in_process_rig(
    device: InProcessDevice,
    limits: Limits,
    dialect: str = "board",
    calibration: Resonance | None = None,
    gauge: type[GaugeDriver] | None = None,
) -> Rig:
    """Return the rig on a new port of `device`, without a thread; a `gauge` records the forces."""
    now_s, owner = device.now_s, None
    if gauge is not None:
        owner = GaugeOwner(gauge(Link(device.gauge_port(), now_s)))
        owner.unbroken = device.unbroken
    driver = driver_of(dialect)(Link(device.port(), now_s), limits, now_s)
    rig = Rig(driver, limits, calibration, now_s, owner)
    rig.unbroken = device.unbroken
    return rig


class InProcessHand(BeamControl):
    """The hand on a device and its rig; while time passes, the owner of the port works."""

    def __init__(self, device: InProcessDevice, rig: Rig) -> None:
        self._device = device
        self._rig = rig
        self.now_s = device.now_s

    def advance(self, seconds: float) -> None:
        """Let `seconds` pass; whoever asks for that is alive, so that the watchdog stays quiet."""
        if not 0 <= seconds < math.inf:
            raise DeviceError(f"a step must be 0 s or more, got {seconds}")
        end_s = self._device.now_s() + seconds
        while (left_s := end_s - self._device.now_s()) > 0:
            with suppress(DeviceError):  # the next call raises it, too
                self._rig.beat()
            self.pass_time(min(left_s, _BEAT_S))

    def pass_time(self, seconds: float) -> None:
        """Let `seconds` pass, more if the owner is busy; a beat alone keeps the watchdog quiet."""
        device, rig = self._device, self._rig
        end_s = device.now_s() + seconds
        while (left_s := end_s - device.now_s()) > 0:
            idle_s = rig.idle_s()
            # A moment at least: a wait that rounding makes too short to add would never end.
            device.advance(left_s if idle_s is None else min(left_s, max(idle_s, _MOMENT_S)))
            if idle_s is not None and idle_s <= left_s:
                rig.step()

    def _answer(self, line: str) -> str:
        return self._device.answer(line)
