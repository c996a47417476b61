"""The driven beam's complex motion along its length, and the places where its direction changes."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from device.beam.beam import Beam
from device.beam.modes import (
    ComplexArray,
    FloatArray,
    modal_amplitude_m_per_v,
    mode_constants,
    mode_shape,
    mode_slope,
)
from device.beam.timoshenko import Section, Waves, sections, system_matrix, waves

_ROUNDING = 1e-14


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionState:
    """Deflection, m/V, and rotation, rad/V, at some places, with derivatives along the beam."""

    deflection: ComplexArray
    deflection_slope: ComplexArray
    deflection_curvature: ComplexArray
    rotation: ComplexArray
    rotation_slope: ComplexArray
    rotation_curvature: ComplexArray


class Motion(Protocol):
    """A beam's harmonic motion per volt."""

    @property
    def length_m(self) -> float:
        """The beam's length."""
        ...

    @property
    def wave_number_per_m(self) -> float:
        """The largest wave number in the motion, which determines how finely it is sampled."""
        ...

    @property
    def rounding_m_per_v(self) -> float:
        """The largest rounding error of a deflection."""
        ...

    @property
    def joints_m(self) -> tuple[float, ...]:
        """Inner places at which the motion is not smooth."""
        ...

    def state(self, x_m: FloatArray) -> MotionState:
        """Return the motion at `x_m`, shape (n,), in rising order."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class SegmentedMotion:
    """The motion of the three-segment beam: four waves in each segment, with their weights."""

    parts: Sequence[Section]
    segment_waves: Sequence[Waves]
    weights: ComplexArray

    @property
    def length_m(self) -> float:
        """The beam's length."""
        return sum(part.length_m for part in self.parts)

    @property
    def wave_number_per_m(self) -> float:
        """See `Motion`."""
        return max(float(np.abs(wave.exponent).max()) for wave in self.segment_waves)

    @property
    def rounding_m_per_v(self) -> float:
        """See `Motion`: the waves cancel where the beam is almost at rest."""
        return _ROUNDING * float(np.abs(self.weights).max())

    @property
    def joints_m(self) -> tuple[float, ...]:
        """The patches' ends, where moment jumps."""
        first, second, _ = (part.length_m for part in self.parts)
        return first, first + second

    def state(self, x_m: FloatArray) -> MotionState:
        """See `Motion`."""
        cuts = np.searchsorted(x_m, self.joints_m)
        starts = (0.0, *self.joints_m)
        pieces = [
            self._segment_state(index, place - start)
            for index, (place, start) in enumerate(zip(np.split(x_m, cuts), starts, strict=True))
        ]
        return MotionState(**dict(zip(_FIELDS, np.concatenate(pieces).T, strict=True)))

    def _segment_state(self, index: int, place_m: FloatArray) -> ComplexArray:
        """Return the six fields in one segment, shape (n, 6), places from the segment's start."""
        wave, length_m = self.segment_waves[index], self.parts[index].length_m
        exponent, rotation = wave.exponent[0], wave.rotation[0]
        decaying = np.exp(np.multiply.outer(place_m, -exponent))
        growing = np.exp(np.multiply.outer(place_m - length_m, exponent))
        both, turn = np.concatenate([-exponent, exponent]), np.concatenate([-rotation, rotation])
        weight = self.weights[4 * index : 4 * index + 4]
        deflection = np.stack([weight * both**power for power in range(3)], axis=-1)
        columns = np.concatenate([deflection, deflection * turn[:, None]], axis=-1)
        return np.asarray(np.concatenate([decaying, growing], axis=-1) @ columns)


_FIELDS = (
    "deflection",
    "deflection_slope",
    "deflection_curvature",
    "rotation",
    "rotation_slope",
    "rotation_curvature",
)


def segmented_motion(
    beam: Beam, frequency_hz: float, *, patched: bool, shear: bool
) -> SegmentedMotion:
    """Return the motion under the patches' moment pair ±M0 per volt, solved without modes.

    Args:
        beam: the beam, its damping (moduli E(1 + 2jζ)) and its patches.
        frequency_hz: frequency of the drive, above 0.
        patched: whether the patches' stiffness and mass count.
        shear: Timoshenko's beam (True) or Euler-Bernoulli's.
    """
    parts = sections(beam, patched=patched, shear=shear)
    omega = np.array([2 * math.pi * frequency_hz])
    segment_waves = [waves(part, omega, beam.damping_ratio) for part in parts]
    matrix = system_matrix(parts, segment_waves)[0]
    load = np.zeros(12, dtype=np.complex128)
    jump = beam.patch_moment_n_m_per_v / abs(segment_waves[0].moment[0, 0])
    load[4], load[8] = jump, -jump
    weights = np.asarray(np.linalg.solve(matrix, load), dtype=np.complex128)
    return SegmentedMotion(parts=parts, segment_waves=segment_waves, weights=weights)


@dataclass(frozen=True, kw_only=True, eq=False)
class ModalMotion:
    """The sum of the bare Euler-Bernoulli beam's first modes, each with its response."""

    beam: Beam
    amplitudes: tuple[complex, ...]

    @property
    def length_m(self) -> float:
        """The beam's length."""
        return self.beam.length_m

    @property
    def wave_number_per_m(self) -> float:
        """The highest mode's b/L."""
        return mode_constants(len(self.amplitudes)).root / self.length_m

    @property
    def rounding_m_per_v(self) -> float:
        """See `Motion`."""
        return _ROUNDING * max(abs(amplitude) for amplitude in self.amplitudes)

    @property
    def joints_m(self) -> tuple[float, ...]:
        """Empty: a finite sum of modes is smooth."""
        return ()

    def state(self, x_m: FloatArray) -> MotionState:
        """See `Motion`; the rotation is the slope, as there is no shear."""
        derivatives = np.zeros((4, x_m.size), dtype=np.complex128)
        for order, amplitude in enumerate(self.amplitudes, start=1):
            derivatives += amplitude * _shape_derivatives(order, x_m / self.length_m)
        deflection, slope, curvature, third = (
            row / self.length_m**power for power, row in enumerate(derivatives)
        )
        return MotionState(
            deflection=deflection,
            deflection_slope=slope,
            deflection_curvature=curvature,
            rotation=slope,
            rotation_slope=curvature,
            rotation_curvature=third,
        )


def _shape_derivatives(order: int, xi: FloatArray) -> FloatArray:
    """Return rows of φ and its first three derivatives; φ'' is φ with the waves' sign turned."""
    c = mode_constants(order)
    shape, slope = mode_shape(order, xi), mode_slope(order, xi)
    clamp, tip = c.clamp_weight * np.exp(-c.root * xi), c.tip_weight * np.exp(-c.root * (1 - xi))
    curvature = c.root**2 * (2 * (clamp + tip) - shape)
    third = c.root**2 * (2 * c.root * (tip - clamp) - slope)
    return np.stack([shape, slope, curvature, third])


def modal_motion(beam: Beam, frequency_hz: float, count: int) -> ModalMotion:
    """Return the response of modes 1 … `count` per volt."""
    amplitudes = tuple(
        modal_amplitude_m_per_v(beam, order, frequency_hz) for order in range(1, count + 1)
    )
    return ModalMotion(beam=beam, amplitudes=amplitudes)


_SAMPLES_PER_RADIAN = 12
_STEPS, _SETTLED = 60, 1e-13
_CLAMP = 1e-5  # part of the length next to the clamp where rounding exceeds the motion

Curve = Callable[[MotionState], tuple[FloatArray, FloatArray]]


def direction(state: MotionState) -> tuple[FloatArray, FloatArray]:
    """Return -Re(W ψ*) and its derivative along the beam."""
    turned = np.conj(state.rotation)
    value = -(state.deflection * turned).real
    slope = -(
        state.deflection_slope * turned + state.deflection * np.conj(state.rotation_slope)
    ).real
    return value, slope


def _direction_slope(state: MotionState) -> tuple[FloatArray, FloatArray]:
    """Return the derivative of `direction` and its own derivative."""
    _, slope = direction(state)
    turned = np.conj(state.rotation)
    bend = state.deflection_curvature * turned + state.deflection * np.conj(
        state.rotation_curvature
    )
    cross = state.deflection_slope * np.conj(state.rotation_slope)
    return slope, -(bend + 2 * cross).real


def _refined(motion: Motion, curve: Curve, low_m: FloatArray, high_m: FloatArray) -> FloatArray:
    """Return roots between places of opposite sign, by Newton's method kept inside by bisection."""
    if not low_m.size:
        return low_m
    rising = curve(motion.state(low_m))[0] < 0
    place = (low_m + high_m) / 2
    for _ in range(_STEPS):
        value, slope = curve(motion.state(place))
        below = (value < 0) == rising
        low_m, high_m = np.where(below, place, low_m), np.where(below, high_m, place)
        step = value / np.where(slope == 0, 1.0, slope)
        newton = place - step
        inside = (newton >= low_m) & (newton <= high_m) & (slope != 0)
        former, place = place, np.where(inside, newton, (low_m + high_m) / 2)
        if np.abs(place - former).max() <= _SETTLED * motion.length_m:
            break
    return place


def sample_places(motion: Motion) -> FloatArray:
    """Return places close enough to resolve every zone, including the tip and the joints."""
    count = int(motion.wave_number_per_m * motion.length_m * _SAMPLES_PER_RADIAN) + 48
    even = np.linspace(0.0, motion.length_m, count)
    even[0] = _CLAMP * motion.length_m
    return np.union1d(even, motion.joints_m)


def _signed_cells(motion: Motion, curve: Curve, places_m: FloatArray) -> FloatArray:
    """Return roots of a curve that changes sign between neighbouring places."""
    value = curve(motion.state(places_m))[0]
    cells = np.flatnonzero((value[:-1] > 0) != (value[1:] > 0))
    return _refined(motion, curve, places_m[cells], places_m[cells + 1])


def zone_edges_m(motion: Motion, places_m: FloatArray) -> FloatArray:
    """Return the inner places at which the direction of motion changes, in rising order.

    Turning points of the direction are sampled too, so that no pair of edges between two places
    is missed.
    """
    turning = _signed_cells(motion, _direction_slope, places_m)
    return _signed_cells(motion, direction, np.union1d(places_m, turning))
