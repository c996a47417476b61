"""Fields of motion: how much a driven beam moves, and its pattern under a window."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from device.arrays import ComplexArray, FloatArray, IndexArray
from device.beam.beam import Beam
from device.beam.driven import FINENESS, DrivenMotion, Fineness, driven, moved
from device.beam.pattern import Pattern
from device.beam.spectral import natural_frequency_hz, spectrum_with_mode
from device.errors import OutOfRangeError


@dataclass(frozen=True, kw_only=True, eq=False)
class Field:
    """The driven beam's motion, as friction needs it.

    The pattern's magnitudes are relative to `displacement_m`, the rms |W| over the beam. The
    rotation is √(mean |ψ|²) of the section over the beam. Frequency, displacement and rotation have
    the shape of the scenes, or one that broadcasts.
    """

    pattern: Pattern
    frequency_hz: FloatArray
    displacement_m: FloatArray
    rotation: FloatArray

    def scaled(self, factor: FloatArray) -> "Field":
        """Return the field of a drive multiplied by `factor`."""
        return replace(
            self, displacement_m=self.displacement_m * factor, rotation=self.rotation * factor
        )

    def chosen(self, drive: IndexArray) -> "Field":
        """Return the fields of these drives, one for each scene."""
        return Field(
            pattern=self.pattern.chosen(drive),
            frequency_hz=self.frequency_hz[drive],
            displacement_m=self.displacement_m[drive],
            rotation=self.rotation[drive],
        )

    @property
    def angular_frequency_rad_s(self) -> FloatArray:
        return 2 * math.pi * self.frequency_hz

    def tip_speed_m_s(self, lever_m: FloatArray | float) -> FloatArray:
        """Return √2 ω · lever · rotation of a body with its tip `lever_m` from the neutral axis."""
        return math.sqrt(2.0) * self.angular_frequency_rad_s * lever_m * self.rotation


def require_below_cut_off(beam: Beam, frequency_hz: FloatArray) -> None:
    """Raise `OutOfRangeError` for a drive at which both waves of the beam travel."""
    cut_off_hz = beam.frequency_scale * beam.cut_off_hz
    beyond = np.flatnonzero(frequency_hz > cut_off_hz)
    if beyond.size:
        rule = f"must be at most the beam's cut-off, {cut_off_hz:.0f}"
        raise OutOfRangeError("frequency_hz", rule, float(frequency_hz[beyond[0]]), int(beyond[0]))


def driven_fields(
    beam: Beam, frequency_hz: FloatArray, damping_ratio: FloatArray, fineness: Fineness = FINENESS
) -> Iterator[tuple[IndexArray, Field]]:
    """Yield parts of the drives, shape (drives,), with their fields per volt.

    The pattern's `chosen` says which drive of the part a place asks about.
    """
    require_below_cut_off(beam, frequency_hz)
    for which, motion in driven(beam, frequency_hz, damping_ratio, fineness):
        yield (
            which,
            Field(
                pattern=motion.patterns,
                frequency_hz=frequency_hz[which],
                displacement_m=motion.deflection_m_per_v,
                rotation=motion.rotation_per_v,
            ),
        )


# One mode alone, of which the pattern is the same at every drive.


@dataclass(frozen=True, kw_only=True, eq=False)
class OneMode:
    """A mode's shape as a motion of weight 1, with the patches' force on it and its 1/μ.

    `peak_ratio` is the largest |W| over its rms; `wave_number_per_m` that of the bare beam without
    shear at its frequency, the paper's b/L.
    """

    shape: DrivenMotion
    peak_ratio: float
    frequency_hz: float
    force: float
    wave_number_per_m: float

    def amplitude_m_per_v(
        self, frequency_hz: FloatArray, damping_ratio: FloatArray, *, viscous: bool
    ) -> FloatArray:
        """Return the rms |W| per volt; damping is `viscous`, as the paper's, or structural."""
        own_hz = self.frequency_hz
        real = (own_hz - frequency_hz) * (own_hz + frequency_hz) / own_hz**2
        imaginary = 2 * damping_ratio * (frequency_hz / own_hz if viscous else 1.0)
        force = abs(self.force)
        return np.asarray(force * self.shape.deflection_m_per_v / np.hypot(real, imaginary))


@lru_cache(maxsize=64)
def _one_mode(beam: Beam, mode: int, fineness: Fineness, *, built: bool) -> OneMode:
    modes = spectrum_with_mode(beam, mode, fineness.mesh, patched=built, shear=built)
    place = beam.rigid_modes + mode - 1
    weights: ComplexArray = np.zeros((1, modes.values.size + 1), dtype=np.complex128)
    weights[0, place] = 1.0
    bare = beam.bare
    own_hz = modes.mode_hz(beam.rigid_modes, mode)
    wave_number = bare.wave_number_per_m(own_hz, shear=False)
    shape = moved(modes, weights, fineness)
    return OneMode(
        shape=shape,
        peak_ratio=float(shape.largest_m_per_v[0] / shape.deflection_m_per_v[0]),
        frequency_hz=own_hz,
        force=float(modes.forces[place]) / (modes.values[place] * (2 * math.pi * own_hz) ** 2),
        wave_number_per_m=wave_number,
    )


def one_mode(beam: Beam, mode: int, fineness: Fineness = FINENESS, *, built: bool) -> OneMode:
    """Return a mode of the beam as `built`, or of the bare Euler-Bernoulli beam, without scale."""
    return _one_mode(beam.undamped, mode, fineness, built=built)


def mode_field(
    beam: Beam,
    mode: int,
    frequency_hz: FloatArray,
    damping_ratio: FloatArray,
    *,
    built: bool,
) -> Field:
    """Return the field per volt of one mode; see `one_mode`. Drives have any one shape."""
    shape, scale = one_mode(beam, mode, built=built), beam.frequency_scale
    own_hz = frequency_hz / scale
    displacement_m = shape.amplitude_m_per_v(own_hz, damping_ratio, viscous=not built) / scale**2
    per_m = float(shape.shape.rotation_per_v[0] / shape.shape.deflection_m_per_v[0])
    return Field(
        pattern=shape.shape.patterns,
        frequency_hz=frequency_hz,
        displacement_m=displacement_m,
        # The paper's b/L neglects the ends' share.
        rotation=displacement_m * (per_m if built else shape.wave_number_per_m),
    )


def peak_ratio(beam: Beam, mode: int) -> float:
    """Return the largest |W| of a bare beam's mode over its rms; 2 at a cantilever's tip."""
    return one_mode(beam, mode, built=False).peak_ratio


def mode_share(beam: Beam, mode: int) -> float:
    """Return the rms |W| of a mode over that of all, driven at the mode's resonance."""
    frequency_hz = np.array([natural_frequency_hz(beam, mode)])
    damping_ratio = np.array([beam.damping_ratio])
    alone = mode_field(beam, mode, frequency_hz, damping_ratio, built=True)
    ((_, field),) = driven_fields(beam, frequency_hz, damping_ratio)
    return float(alone.displacement_m[0] / field.displacement_m[0])
