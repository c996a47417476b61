"""A rig without a thread; its driver records its calls, and its clock stands still."""

from collections.abc import Callable
from typing import Any, cast

from device.drivers.driver import Driver, Reading
from device.drivers.limits import Limits, Setpoint
from device.drivers.pace import Pace
from device.errors import (
    ForeignOutput,
)
from device.resonance import Resonance
from device.rig import Rig
from protocol.journal.records import Identity, ReadBack
from tests.device.lying import SteppedClock

LIMITS = Limits(max_voltage_v=120, max_frequency_hz=40_000, ramp_v_per_s=400, watchdog_s=0.5)
DRIVE = Setpoint(voltage_v=100, frequency_hz=24_000, ramp_v_per_s=400)
FEED_S = LIMITS.watchdog_s / 5
SHOWN = ReadBack(output=True, voltage_v=100, frequency_hz=24_000)
IDENTITY = Identity(idn="recorded", boot=1, device_time_s=0.0)
AT_ONCE = Pace(answer_s=0.001, watch_s=0.002, begin_s=0.02, end_s=0.006, late_s=0.01)
CALIBRATION = Resonance(frequency_hz=24_100, tip_m_per_v=1e-8)


class RecordedLink:
    def __init__(self) -> None:
        self.stopped = False
        self.alive: Callable[[], None] = lambda: None

    def stop(self) -> None:
        self.stopped = True

    def go_on(self) -> None:
        self.stopped = False


class RecordedDriver:
    """Records its calls; what `does` has for one of them is done instead."""

    def __init__(self, *, has_watchdog: bool = True, measures_vibration: bool = True) -> None:
        self.has_watchdog = has_watchdog
        self.measures_vibration = measures_vibration
        self.link = RecordedLink()
        self.driven: Setpoint | None = None
        self.foreign: ForeignOutput | None = None
        self.calls: list[str] = []
        self.does: dict[str, Callable[[], Any]] = {}
        self.asked: list[Setpoint] = []
        self.shown = SHOWN
        self.reading: Reading | None = None

    def _called(self, name: str, result: object = None) -> Any:
        self.calls.append(name)
        return self.does.get(name, lambda: result)()

    def arm(self) -> Identity:
        self.driven = None
        return cast(Identity, self._called("arm", IDENTITY))

    def pace(self) -> Pace:
        return AT_ONCE

    def drive(self, setpoint: Setpoint) -> ReadBack:
        self._called("drive")
        self.driven = setpoint
        self.asked.append(setpoint)
        return self.shown

    def read_back(self) -> ReadBack:
        return cast(ReadBack, self._called("read_back", SHOWN))

    def check(self) -> None:
        self._called("check")

    def carry_on(self) -> bool:
        return bool(self._called("carry_on", False))

    def vibration_m(self) -> float:
        return cast(float, self._called("vibration_m", 1e-7))

    def watchdog_trips(self) -> bool:
        return bool(self._called("watchdog_trips", True))

    def off(self) -> None:
        self.driven = None
        self._called("off")

    def send_off(self) -> None:
        self._called("send_off")

    def confirm_off(self) -> None:
        self._called("confirm_off")

    def close(self) -> None:
        self._called("close")


def raising(error: BaseException) -> Callable[[], Any]:
    def fail() -> None:
        raise error

    return fail


class Bench:
    """A rig without a thread, its driver and its clock."""

    def __init__(self, driver: RecordedDriver, calibration: Resonance | None = None) -> None:
        self.driver = driver
        self.clock = SteppedClock()
        self.clock.advance(100)
        self.rig = Rig(cast(Driver, driver), LIMITS, calibration, self.clock)

    def calls(self) -> list[str]:
        """What was called since this was asked last."""
        made, self.driver.calls = self.driver.calls, []
        return made

    def after(self, seconds: float, *, beats: bool = True) -> list[str]:
        """What the owner does after so long, with or without a beat of the session."""
        self.clock.advance(seconds)
        if beats:
            self.rig.beat()
        self.rig.step()
        return self.calls()
