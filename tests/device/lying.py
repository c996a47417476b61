"""A simulated device in the test's own process that can be made to lie, one answer at a time."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace

from device.drivers.driver import Driver, driver_of
from device.drivers.limits import Limits, Setpoint
from device.errors import DeviceError, LimitExceeded
from device.gauges.owner import GaugeOwner
from device.link.link import Link
from device.resonance import Resonance
from device.rig import RAMP_STEP_S, Rig
from device.simulator.device import SimulatedDevice
from tests.device.rigs import LIMITS
from tests.device.scripted import ticking

LINE_S = 5e-4
"""How long a line takes."""


class SteppedClock:
    """Seconds that pass by `advance` alone."""

    def __init__(self) -> None:
        self._now_s = 0.0

    def __call__(self) -> float:
        return self._now_s

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        self._now_s += seconds


class LyingPort:
    """A port with a simulated device behind it; what `lies` has for a query is answered instead.

    A list is used up one answer after the other; its last one stays. `line_lie` is applied to every
    whole line that is answered. Lines in `unknown` are not understood, those in `silent` not
    answered. An answer to what begins as a key of `slow_s` is that late. `sent` are the lines that
    came. Device time is that of `clock`, where there is one, and passes while somebody waits; else
    it passes by `advance` alone.
    """

    def __init__(self, dialect: str = "board", clock: SteppedClock | None = None) -> None:
        self._clock = clock
        self.device = SimulatedDevice(seed=1, wall_s=self._now_s, dialect=dialect)
        self.lies: dict[str, list[str]] = {}
        self.line_lie: Callable[[str], str] = str
        self.unknown: set[str] = set()
        self.silent: set[str] = set()
        self.slow_s: dict[str, float] = {}
        self.sent: list[str] = []
        self.off_s: float | None = None
        """When the output went off last."""
        self._pending = b""
        self._ready_s = 0.0

    def receive(self, timeout_s: float) -> bytes:
        if self._clock is not None and not (self._pending and self._now_s() >= self._ready_s):
            self._clock.advance(timeout_s)
            return b""
        data, self._pending = self._pending, b""
        return data

    def send(self, data: bytes) -> None:
        line = data.decode().strip()
        self.sent.append(line)
        if self._clock is not None:
            self._clock.advance(LINE_S)
        was_on = self.device.instrument.output
        answer = self.device.answer("FROB?" if line in self.unknown else line, self._now_s())
        if was_on and not self.device.instrument.output:
            self.off_s = self._now_s()
        if answer is not None and line not in self.silent:
            late_s = (late for start, late in self.slow_s.items() if line.startswith(start))
            self._ready_s = self._now_s() + next(late_s, 0.0)
            self._pending += self.line_lie(self._lied(line, answer)).encode("latin-1") + b"\n"

    def close(self) -> None: ...

    def advance(self, seconds: float) -> None:
        self.device.answer_control(f"advance {seconds}")

    def _now_s(self) -> float:
        return 0.0 if self._clock is None else self._clock()

    def _lied(self, line: str, answer: str) -> str:
        queries = [part.lstrip(":") for part in line.split(";") if "?" in part]
        answers = answer.split(";") if len(queries) > 1 else [answer]
        return ";".join(self._told(*pair) for pair in zip(queries, answers, strict=True))

    def _told(self, query: str, answer: str) -> str:
        lies = self.lies.get(query, [])
        return answer if not lies else lies.pop(0) if len(lies) > 1 else lies[0]


def unarmed(limits: Limits, dialect: str = "board") -> tuple[Driver, LyingPort]:
    """Return a driver, not armed yet, of a device that lies on demand, and its port."""
    port = LyingPort(dialect)
    clock = ticking(1e-3)
    return driver_of(dialect)(Link(port, monotonic=clock), limits, clock), port


def lying(limits: Limits, dialect: str = "board") -> tuple[Driver, LyingPort]:
    """Return an armed driver of a device that lies on demand, and its port."""
    driver, port = unarmed(limits, dialect)
    driver.arm()
    return driver, port


@dataclass(frozen=True, kw_only=True)
class WatchedRig:
    """A rig on a device that may lie, and the clock that both live by."""

    rig: Rig
    port: LyingPort
    clock: SteppedClock

    def live(self, seconds: float) -> None:
        """Let the session live on for a while, or until the rig fails, which it raises."""
        for _ in range(round(seconds / RAMP_STEP_S)):
            self.clock.advance(RAMP_STEP_S)
            for _ in range(2):  # the rig does what is due after one call and before the next
                with suppress(LimitExceeded):
                    self.rig.drive(_TOO_MUCH)


_TOO_MUCH = Setpoint(voltage_v=1e6, frequency_hz=1e3, ramp_v_per_s=1.0)
"""Is refused before anything is sent."""


@contextmanager
def watched(
    limits: Limits,
    dialect: str,
    clock: SteppedClock | None = None,
    gauge: GaugeOwner | None = None,
    calibration: Resonance | None = None,
) -> Iterator[WatchedRig]:
    """A rig, not armed yet, whose device may lie; it is closed afterwards, whatever it says."""
    clock = clock or SteppedClock()
    port = LyingPort(dialect, clock)
    driver = driver_of(dialect)(Link(port, monotonic=clock), limits, clock)
    rig = Rig(driver, limits, calibration, clock, gauge)
    try:
        yield WatchedRig(rig=rig, port=port, clock=clock)
    finally:
        with suppress(DeviceError):
            rig.close()


def stepped(
    dialect: str = "board", watchdog_s: float = 0.5, clock: SteppedClock | None = None
) -> tuple[Driver, LyingPort]:
    """An armed driver by whose clock its device lives."""
    clock = clock or SteppedClock()
    port = LyingPort(dialect, clock)
    link = Link(port, monotonic=clock)
    driver = driver_of(dialect)(link, replace(LIMITS, watchdog_s=watchdog_s), clock)
    driver.arm()
    return driver, port
