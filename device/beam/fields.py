"""Fields of motion: the size of the motion, and its pattern under a window of the beam."""

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from device.beam.beam import Beam
from device.beam.eq15 import Overlap, same_direction_ratio
from device.beam.modes import FloatArray, modal_displacement_m, mode_constants, natural_frequency_hz
from device.beam.windows import ModeSums, Pattern, Window, mode_window, window_means, window_width


@dataclass(frozen=True, kw_only=True)
class ModePattern(Pattern):
    """The exact mode shape of a bare Euler-Bernoulli beam."""

    mode: int

    def window(self, x_m: FloatArray, contact_m: FloatArray | float) -> Window:
        return mode_window(self.mode, self.length_m, x_m, contact_m)


@lru_cache(maxsize=256)
def _sinusoid_sums(mode: int, length_m: float) -> ModeSums:
    """Return the sums of √2 sin(bξ - π/4), of which |sin| is (10) of mathematics/beam."""
    unit_m = length_m / mode_constants(mode).root
    halves = np.arange(2 * mode + 1)  # the first from 0 to λ/8, the others λ/4 long
    starts_m = np.asarray((0.5 * halves - 0.25) * math.pi * unit_m, dtype=np.float64)
    # What follows a node moves left, and all before 3λ/8.
    slope = np.where((halves % 2 == 0) & (halves > 0), 1.0, 0.0)
    lobe = (halves - 1) // 2
    complete = np.maximum(lobe, 0) * (math.pi / 2 * unit_m)
    return ModeSums(
        order=mode,
        length_m=length_m,
        inner_m=starts_m[1:],
        slope=slope,
        offset_m=complete - slope * starts_m,
        size_m=math.sqrt(2.0) * unit_m * np.where(lobe % 2, -1.0, 1.0),
        lag=np.full(lobe.size, 0.75 * math.pi),
        rest_m=np.asarray(unit_m * (math.sqrt(2.0) * (2 * lobe + 2) - 1)),  # 0 at the clamp
    )


@dataclass(frozen=True, kw_only=True)
class SinusoidPattern(Pattern):
    """φ ≈ √2 sin(bξ - π/4), the mode shape far from both ends.

    Zones of λ/4 begin at 3λ/8, with λ = 2πL/b; before 3λ/8 everything moves left.
    """

    mode: int

    def window(self, x_m: FloatArray, contact_m: FloatArray | float) -> Window:
        width_m = window_width(x_m, contact_m)
        sums = _sinusoid_sums(self.mode, self.length_m)
        right, mean = window_means(sums, x_m, width_m, contact_m, sums.least_m)
        mean[width_m == 0] = 1.0  # √2 sin(-π/4) at the clamp
        return Window(right=right, left=1.0 - right, mean=mean)


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

    @cached_property
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
