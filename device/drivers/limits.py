"""Setpoints, and the limits of driver and amplifier that they must keep."""

import math
from dataclasses import dataclass, field

from device.errors import LimitExceeded, not_negative, positive
from protocol.journal.records import CommandedDrive
from protocol.study.touch import slew_v_per_us


@dataclass(frozen=True, kw_only=True)
class Amplifier:
    """Its gain, and what it and the generator before it can do; None where nobody has said.

    The gain is output over input voltage; a board has its amplifier inside and needs none.
    `max_vpp` is what the generator gives into an open circuit, V. Slew (V/µs) and peak current (A)
    are from the amplifier's datasheet; `load_f` is the capacitance of the actuators, F.
    """

    gain: float | None = None
    max_vpp: float | None = None
    max_slew_v_per_us: float | None = None
    max_current_a: float | None = None
    load_f: float = 0.0

    def __post_init__(self) -> None:
        not_negative("load_f", self.load_f)
        for name in ("gain", "max_vpp", "max_slew_v_per_us", "max_current_a"):
            if (value := getattr(self, name)) is not None:
                positive(f"amplifier {name}", value)

    def vpp(self, amplitude_v: float) -> float:
        """Return the generator's setting for an amplitude; `LimitExceeded` without a gain.

        >>> Amplifier(gain=20).vpp(200.0)
        20.0
        """
        return 2 * amplitude_v / self._known_gain()

    def amplitude_v(self, vpp: float) -> float:
        """Return the amplitude at the beam for a peak-to-peak setting, V. Raises as `vpp`."""
        return vpp * self._known_gain() / 2

    def check(self, amplitude_v: float, frequency_hz: float) -> None:
        """Raise `LimitExceeded` for a drive beyond slew, current or the generator's voltage."""
        # Checked even where the study file was: the frequency is now the measured resonance.
        slew = slew_v_per_us(amplitude_v, frequency_hz)
        _within("slew_v_per_us", slew, self.max_slew_v_per_us)
        # I = C dV/dt: the largest slope of a sine gives the largest current into a capacitance.
        _within("current_a", 1e6 * slew * self.load_f, self.max_current_a)
        if self.gain is not None:
            _within("peak-to-peak voltage", self.vpp(amplitude_v), self.max_vpp)

    def _known_gain(self) -> float:
        if self.gain is None:
            raise LimitExceeded("a generator needs rig.amplifier_gain: volts out per volt in")
        return self.gain


def _within(name: str, value: float, most: float | None) -> None:
    if most is not None and value > most:
        raise LimitExceeded(f"{name} must not exceed {most:.12g}, got {value:.12g}")


# The slowest that a board accepts. At 0 V/s an amplitude would never arrive.
SLOWEST_RAMP_V_PER_S = 1e-3


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What the driver never lets through, whoever asks."""

    max_voltage_v: float
    max_frequency_hz: float
    ramp_v_per_s: float
    watchdog_s: float
    max_temperature_c: float | None = None
    amplifier: Amplifier = field(default_factory=Amplifier)


class Setpoint(CommandedDrive):
    """A drive that can be checked against the limits of a rig."""

    def checked(self, limits: Limits) -> "Setpoint":
        """Return this setpoint; raise `LimitExceeded` beyond `limits`, as nothing is clipped."""
        # Checked here as well as in study, plan and device, because each of these can be wrong.
        _require("voltage_v", self.voltage_v, 0, limits.max_voltage_v)
        _require("frequency_hz", self.frequency_hz, 1, limits.max_frequency_hz)
        _require("ramp_v_per_s", self.ramp_v_per_s, SLOWEST_RAMP_V_PER_S, limits.ramp_v_per_s)
        limits.amplifier.check(self.voltage_v, self.frequency_hz)
        return self


def _require(name: str, value: float, lowest: float, highest: float) -> None:
    if not (math.isfinite(value) and lowest <= value <= highest):
        raise LimitExceeded(f"{name} must lie in [{lowest:.12g}, {highest:.12g}], got {value:.12g}")
