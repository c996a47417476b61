"""A field: how a rung of the ladder says that the driven beam moves."""

import math
from dataclasses import dataclass, replace

import numpy as np

from device.beam import Beam
from device.mode_shapes import FloatArray, mode_constants
from device.patterns import Pattern
from device.response import modal_displacement_m, natural_frequency_hz


@dataclass(frozen=True, kw_only=True, eq=False)
class Field:
    """The driven beam's motion, as friction needs it.

    Attributes:
        pattern: directions, and magnitudes relative to `displacement_m`, along the beam.
        frequency_hz: of the drive.
        displacement_m: |q|, the rms amplitude over the beam (of one mode: its modal amplitude).
        rotation: √(mean |ψ|²) of the section's rotation over the beam; b|q|/L for one mode.
    """

    pattern: Pattern
    frequency_hz: FloatArray
    displacement_m: FloatArray
    rotation: FloatArray

    @property
    def angular_frequency_rad_s(self) -> FloatArray:
        """2πf."""
        return 2 * math.pi * self.frequency_hz

    def scaled(self, factor: FloatArray) -> "Field":
        """The field of a drive that is larger by a factor."""
        return replace(
            self,
            displacement_m=self.displacement_m * factor,
            rotation=self.rotation * factor,
        )

    def tip_speed_m_s(self, lever_m: FloatArray | float) -> FloatArray:
        """√2 ω · lever · rotation, of a body whose tip is `lever_m` from the neutral axis."""
        return math.sqrt(2.0) * self.angular_frequency_rad_s * lever_m * self.rotation


@dataclass(frozen=True, kw_only=True, eq=False)
class Signal:
    """The drive's voltage and frequency, numbers or arrays of shape (n,).

    A `frequency_hz` of None is the resonance; a `damping_ratio` of None is the beam's own.
    """

    voltage_v: FloatArray | float
    frequency_hz: FloatArray | float | None
    damping_ratio: FloatArray | float | None = None


def modal_field(beam: Beam, mode: int, pattern: Pattern, signal: Signal) -> Field:
    """The field of one mode of the bare Euler-Bernoulli beam."""
    frequency_hz = signal.frequency_hz
    if frequency_hz is None:
        frequency_hz = natural_frequency_hz(beam, mode)
    displacement_m = modal_displacement_m(
        beam, mode, signal.voltage_v, frequency_hz, signal.damping_ratio
    )
    return Field(
        pattern=pattern,
        frequency_hz=np.asarray(frequency_hz, dtype=np.float64),
        displacement_m=displacement_m,
        rotation=displacement_m * (mode_constants(mode).root / beam.length_m),
    )
