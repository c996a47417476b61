"""What is asked of a device and what it says: plain records, SI units."""

import math
from dataclasses import dataclass, field

from device.amplifier import Amplifier
from device.errors import LimitExceeded

SLOWEST_RAMP_V_PER_S = 1e-3


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What the driver never lets through, whoever asks."""

    max_voltage_v: float
    max_frequency_hz: float
    ramp_v_per_s: float
    watchdog_s: float
    amplifier: Amplifier = field(default_factory=Amplifier)


@dataclass(frozen=True, kw_only=True)
class Setpoint:
    """A drive: amplitude (peak, V), frequency (Hz), and how fast the amplitude moves there."""

    voltage_v: float
    frequency_hz: float
    ramp_v_per_s: float

    def checked(self, limits: Limits) -> "Setpoint":
        """Return this setpoint if it stays within `limits`.

        Raises:
            LimitExceeded: it does not; nothing is clipped.
        """
        _require("voltage_v", self.voltage_v, 0, limits.max_voltage_v)
        _require("frequency_hz", self.frequency_hz, 1, limits.max_frequency_hz)
        _require("ramp_v_per_s", self.ramp_v_per_s, SLOWEST_RAMP_V_PER_S, limits.ramp_v_per_s)
        limits.amplifier.check(self.voltage_v, self.frequency_hz)
        return self


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """A linear sweep of the frequency at the amplitude that is on; it ends at `stop_hz`."""

    start_hz: float
    stop_hz: float
    duration_s: float

    @property
    def range_hz(self) -> tuple[float, float]:
        """The lowest and the highest frequency of it."""
        return min(self.start_hz, self.stop_hz), max(self.start_hz, self.stop_hz)

    def checked(self, limits: Limits, voltage_v: float) -> "Sweep":
        """Return this sweep if both ends stay within `limits` at this amplitude.

        Raises:
            LimitExceeded: it does not; nothing is clipped.
        """
        for frequency_hz in (self.start_hz, self.stop_hz):
            _require("frequency_hz", frequency_hz, 1, limits.max_frequency_hz)
            limits.amplifier.check(voltage_v, frequency_hz)
        _require("duration_s", self.duration_s, 1e-3, 500)
        return self


@dataclass(frozen=True, kw_only=True)
class Identity:
    """Who answered, how often it has booted, its time, and what a person should know of it.

    `cleared_errors` stood in the device's error queue before we came.
    """

    idn: str
    boot: int | None
    device_time_s: float | None
    dialect: str = "board"
    cleared_errors: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class ReadBack:
    """The drive as the device reports it, its monitor and its sensors; None where it has none."""

    output: bool
    voltage_v: float
    frequency_hz: float
    monitor_v: float | None = None
    force_n: float | None = None
    position_m: float | None = None
    device_time_s: float | None = None


def _require(name: str, value: float, lowest: float, highest: float) -> None:
    if not (math.isfinite(value) and lowest <= value <= highest):
        raise LimitExceeded(f"{name} must lie in [{lowest:.12g}, {highest:.12g}], got {value:.12g}")
