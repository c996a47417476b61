"""What is asked of a device and what it says: plain records, SI units."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What the driver never lets through, whoever asks."""

    max_voltage_v: float
    max_frequency_hz: float
    ramp_v_per_s: float
    watchdog_s: float


@dataclass(frozen=True, kw_only=True)
class Setpoint:
    """A drive: amplitude (peak, V), frequency (Hz), and how fast the amplitude moves there."""

    voltage_v: float
    frequency_hz: float
    ramp_v_per_s: float

    def checked(self, limits: Limits) -> "Setpoint":
        """Return this setpoint if it stays within `limits`.

        Raises:
            ValueError: it does not; nothing is clipped.
        """
        _require("voltage_v", self.voltage_v, 0, limits.max_voltage_v)
        _require("frequency_hz", self.frequency_hz, 1e-6, limits.max_frequency_hz)
        _require("ramp_v_per_s", self.ramp_v_per_s, 1e-3, limits.ramp_v_per_s)
        return self


@dataclass(frozen=True, kw_only=True)
class Identity:
    """Who answered, how often it has booted, and its time."""

    idn: str
    boot: int
    device_time_s: float


@dataclass(frozen=True, kw_only=True)
class ReadBack:
    """The drive as the device reports it, its monitor and its sensors."""

    output: bool
    voltage_v: float
    frequency_hz: float
    monitor_v: float
    force_n: float
    position_m: float
    device_time_s: float


def _require(name: str, value: float, lowest: float, highest: float) -> None:
    if not (math.isfinite(value) and lowest <= value <= highest):
        raise ValueError(f"{name} must lie in [{lowest:g}, {highest:g}], got {value:g}")
