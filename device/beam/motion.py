"""The driven beam's complex motion along its length, and the places where its direction changes."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from device.beam.beam import Beam
from device.beam.modes import (
    ComplexArray,
    FloatArray,
    modal_amplitude_m_per_v,
    mode_constants,
    mode_shape,
    mode_slope,
)
from device.beam.timoshenko import Waves, sections, system_matrix, waves

_ROUNDING = 1e-14


@dataclass(frozen=True, eq=False)
class MotionState:
    """Deflection, m/V, and rotation, rad/V, at some places, with derivatives along the beam."""

    deflection: ComplexArray
    deflection_slope: ComplexArray
    deflection_curvature: ComplexArray
    rotation: ComplexArray
    rotation_slope: ComplexArray
    rotation_curvature: ComplexArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """A beam's harmonic motion per volt.

    Attributes:
        length_m: the beam's length.
        wave_number_per_m: the largest one in the motion; it says how finely to sample it.
        rounding_m_per_v: the largest rounding error of a deflection.
        joints_m: inner places at which the motion is not smooth.
        state: the motion at places, shape (n,), in rising order.
    """

    length_m: float
    wave_number_per_m: float
    rounding_m_per_v: float
    joints_m: tuple[float, ...]
    state: Callable[[FloatArray], MotionState]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Segment:
    """A segment's waves e^{λ(x - x0)}, each of size 1 at the end x0 from which it decays.

    `origin_m` is x0 from the segment's start and `exponent` λ, of shape (4,); `columns`, of shape
    (4, 6), are what a wave adds to the fields of `MotionState`.
    """

    start_m: float
    origin_m: FloatArray
    exponent: ComplexArray
    columns: ComplexArray

    def state(self, x_m: FloatArray) -> ComplexArray:
        """Return the fields of `MotionState`, shape (n, 6)."""
        wave = ((x_m - self.start_m)[:, None] - self.origin_m) * self.exponent
        return np.asarray(np.exp(wave, out=wave) @ self.columns)


def _segment(wave: Waves, weight: ComplexArray, length_m: float, start_m: float) -> _Segment:
    """Return one segment with the weights of its waves at the one frequency."""
    exponent, rotation = wave.exponent[0], wave.rotation[0]
    both, turn = np.concatenate([-exponent, exponent]), np.concatenate([-rotation, rotation])
    deflection = np.stack([weight * both**power for power in range(3)], axis=-1)
    columns = np.concatenate([deflection, deflection * turn[:, None]], axis=-1)
    origin_m = np.array([0.0, 0.0, length_m, length_m])
    return _Segment(start_m=start_m, origin_m=origin_m, exponent=both, columns=columns)


def segmented_motion(beam: Beam, frequency_hz: float, *, patched: bool, shear: bool) -> Motion:
    """Return the motion under the patches' moment pair ±M0 per volt, solved without modes.

    Each of the three segments has four waves, whose weights follow from the joints. They cancel
    where the beam is almost at rest. The moment jumps at the patches' ends. Moduli are
    E(1 + 2jζ); for `patched` and `shear` see `timoshenko.segmented_natural_frequency_hz`.
    """
    parts = sections(beam, patched=patched, shear=shear)
    omega = np.array([2 * math.pi * frequency_hz])
    segment_waves = [waves(part, omega, beam.damping_ratio) for part in parts]
    matrix = system_matrix(parts, segment_waves)[0]
    load = np.zeros(12, dtype=np.complex128)
    jump = beam.patch_moment_n_m_per_v / abs(segment_waves[0].moment[0, 0])
    # (24): rows 4 and 8 are the moments across the patches' ends, over the waves' scale.
    load[4], load[8] = jump, -jump
    weights = np.asarray(np.linalg.solve(matrix, load), dtype=np.complex128)
    lengths_m = [part.length_m for part in parts]
    joints_m = (lengths_m[0], lengths_m[0] + lengths_m[1])

    starts_m = (0.0, *joints_m)
    segments = list(map(_segment, segment_waves, np.split(weights, 3), lengths_m, starts_m))

    def state(x_m: FloatArray) -> MotionState:
        ends = [0, *np.searchsorted(x_m, joints_m).tolist(), x_m.size]
        fields = np.empty((x_m.size, 6), dtype=np.complex128)
        for segment, (first, last) in zip(segments, pairwise(ends), strict=True):
            if first < last:
                fields[first:last] = segment.state(x_m[first:last])
        return MotionState(*fields.T)

    return Motion(
        length_m=sum(lengths_m),
        wave_number_per_m=max(float(np.abs(wave.exponent).max()) for wave in segment_waves),
        rounding_m_per_v=_ROUNDING * float(np.abs(weights).max()),
        joints_m=joints_m,
        state=state,
    )


def _shape_derivatives(order: int, xi: FloatArray) -> FloatArray:
    """Return rows of φ and its first three derivatives; φ'' is φ with the waves' sign turned."""
    c = mode_constants(order)
    shape, slope = mode_shape(order, xi), mode_slope(order, xi)
    clamp, tip = c.clamp_weight * np.exp(-c.root * xi), c.tip_weight * np.exp(-c.root * (1 - xi))
    # (11), mathematics/beam
    curvature = c.root**2 * (2 * (clamp + tip) - shape)
    third = c.root**2 * (2 * c.root * (tip - clamp) - slope)
    return np.stack([shape, slope, curvature, third])


def modal_motion(beam: Beam, frequency_hz: float, count: int) -> Motion:
    """Return the sum of the bare Euler-Bernoulli beam's modes 1 … `count`, each with its response.

    The sum is smooth. The rotation is the slope, as there is no shear.
    """
    amplitudes = [
        modal_amplitude_m_per_v(beam, order, frequency_hz) for order in range(1, count + 1)
    ]

    def state(x_m: FloatArray) -> MotionState:
        derivatives = np.zeros((4, x_m.size), dtype=np.complex128)
        for order, amplitude in enumerate(amplitudes, start=1):
            derivatives += amplitude * _shape_derivatives(order, x_m / beam.length_m)
        rows = [row / beam.length_m**power for power, row in enumerate(derivatives)]
        return MotionState(*rows[:3], *rows[1:])

    return Motion(
        length_m=beam.length_m,
        wave_number_per_m=mode_constants(count).root / beam.length_m,
        rounding_m_per_v=_ROUNDING * max(map(abs, amplitudes)),
        joints_m=(),
        state=state,
    )


_SAMPLES_PER_RADIAN = 12
_STEPS, _SETTLED = 60, 1e-13
_CLAMP = 1e-5  # part of the length next to the clamp where rounding exceeds the motion

Curve = Callable[[MotionState], tuple[FloatArray, FloatArray]]


def direction(state: MotionState) -> tuple[FloatArray, FloatArray]:
    """Return -Re(W ψ*), (27) of mathematics/beam, and its derivative along the beam."""
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


def _refined(
    motion: Motion, curve: Curve, low_m: FloatArray, high_m: FloatArray, rising: NDArray[np.bool_]
) -> FloatArray:
    """Return roots between places of opposite sign, by Newton's method kept inside by bisection."""
    if not low_m.size:
        return low_m
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
    return _refined(motion, curve, places_m[cells], places_m[cells + 1], value[cells] < 0)


def zone_edges_m(motion: Motion, places_m: FloatArray) -> FloatArray:
    """Return the inner places at which the direction of motion changes, in rising order.

    Turning points of the direction are sampled too, so that no pair of edges between two places
    is missed.
    """
    turning = _signed_cells(motion, _direction_slope, places_m)
    return _signed_cells(motion, direction, np.union1d(places_m, turning))
