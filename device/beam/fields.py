"""Fields of motion: the size of the motion, and its pattern under a window of the beam."""

import math
from dataclasses import dataclass, replace

import numpy as np

from device.beam.beam import Beam
from device.beam.eq15 import Overlap, same_direction_ratio
from device.beam.modes import FloatArray, modal_displacement_m, mode_constants, natural_frequency_hz
from device.beam.windows import Pattern, Window, mode_window, window_width


@dataclass(frozen=True, kw_only=True)
class ModePattern(Pattern):
    """The exact mode shape of a bare Euler-Bernoulli beam."""

    mode: int

    def window(self, x_m: FloatArray, contact_m: FloatArray | float) -> Window:
        return mode_window(self.mode, self.length_m, x_m, window_width(x_m, contact_m))


def _folded_sine_integral(angle: FloatArray) -> FloatArray:
    """Return ∫₀^angle |sin|, (10) of mathematics/beam, for any sign of the angle."""
    lobe = np.floor(angle / math.pi)
    return np.asarray(2.0 * lobe + 1.0 - np.cos(angle - math.pi * lobe))


@dataclass(frozen=True, kw_only=True)
class SinusoidPattern(Pattern):
    """φ ≈ √2 sin(bξ - π/4), the mode shape far from both ends.

    Zones of λ/4 begin at 3λ/8, with λ = 2πL/b; before 3λ/8 everything moves left.
    """

    mode: int

    @property
    def _wave_number_per_m(self) -> float:
        return mode_constants(self.mode).root / self.length_m

    def window(self, x_m: FloatArray, contact_m: FloatArray | float) -> Window:
        width_m = window_width(x_m, contact_m)
        places = np.concatenate([x_m - width_m, x_m])
        width = np.where(width_m > 0, width_m, 1.0)
        right = np.clip(_difference(self._right_before_m(places)) / width, 0.0, 1.0)
        angles = places * self._wave_number_per_m - math.pi / 4
        magnitude = _difference(_folded_sine_integral(angles)) / (width * self._wave_number_per_m)
        mean = np.where(width_m > 0, math.sqrt(2.0) * magnitude, 1.0)  # √2 sin(-π/4) at the clamp
        return Window(right=right, left=1.0 - right, mean=mean)

    def _right_before_m(self, place_m: FloatArray) -> FloatArray:
        half_wave_m = math.pi / self._wave_number_per_m
        period = np.maximum(place_m / half_wave_m - 0.75, 0.0)
        complete = np.floor(period)
        return np.asarray(half_wave_m * (0.5 * complete + np.minimum(period - complete, 0.5)))


def _difference(ends: FloatArray) -> FloatArray:
    """Return the second half of an array less its first."""
    half = ends.size // 2
    return ends[half:] - ends[:half]


@dataclass(frozen=True, kw_only=True)
class Eq15Pattern(SinusoidPattern):
    """Eq 15's a/u; the far field's magnitude, and ratio for the whole beam, which Eq 15 lacks."""

    overlap: Overlap = "first"

    def window(self, x_m: FloatArray, contact_m: FloatArray | float) -> Window:
        """See `Pattern`; a/u divides by the whole contact at the clamp too, as printed."""
        ratio = same_direction_ratio(x_m, contact_m, self.overlap)
        mean = super().window(x_m, contact_m).mean
        return Window(right=ratio, left=1.0 - ratio, mean=mean)

    def whole(self) -> Window:
        return super().window(np.array([self.length_m]), self.length_m)


@dataclass(frozen=True, kw_only=True, eq=False)
class Field:
    """The driven beam's motion, as friction needs it.

    The pattern's magnitudes are relative to `displacement_m`, the rms |q| over the beam (of one
    mode: its modal amplitude). The rotation is √(mean |ψ|²) of the section over the beam; b|q|/L
    for one mode.
    """

    pattern: Pattern
    frequency_hz: FloatArray
    displacement_m: FloatArray
    rotation: FloatArray

    @property
    def angular_frequency_rad_s(self) -> FloatArray:
        return 2 * math.pi * self.frequency_hz

    def scaled(self, factor: FloatArray) -> "Field":
        """Return the field of a drive multiplied by `factor`."""
        return replace(
            self, displacement_m=self.displacement_m * factor, rotation=self.rotation * factor
        )

    def tip_speed_m_s(self, lever_m: FloatArray | float) -> FloatArray:
        """Return √2 ω · lever · rotation of a body with its tip `lever_m` from the neutral axis."""
        return math.sqrt(2.0) * self.angular_frequency_rad_s * lever_m * self.rotation


@dataclass(frozen=True, kw_only=True, eq=False)
class Signal:
    """Voltage and frequency, (n,) or numbers; None: the resonance, and the beam's own damping."""

    voltage_v: FloatArray | float
    frequency_hz: FloatArray | float | None
    damping_ratio: FloatArray | float | None = None


def modal_field(beam: Beam, mode: int, pattern: Pattern, signal: Signal) -> Field:
    """Return the field of one mode of the bare Euler-Bernoulli beam."""
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
