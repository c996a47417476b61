"""Where a complex motion changes direction.

With a phase along the beam, bodies move right where -Re(W ψ*) > 0 (Eq 1 with a complex field).
"""

from collections.abc import Callable

import numpy as np

from device.mode_shapes import FloatArray
from device.motion import Motion, MotionState

_SAMPLES_PER_RADIAN = 12
_STEPS, _SETTLED = 60, 1e-13
_CLAMP = 1e-5  # part of the length next to the clamp where the motion is lost in rounding

Curve = Callable[[MotionState], tuple[FloatArray, FloatArray]]


def direction(state: MotionState) -> tuple[FloatArray, FloatArray]:
    """-Re(W ψ*) and its derivative along the beam."""
    turned = np.conj(state.rotation)
    value = -(state.deflection * turned).real
    slope = -(
        state.deflection_slope * turned + state.deflection * np.conj(state.rotation_slope)
    ).real
    return value, slope


def _direction_slope(state: MotionState) -> tuple[FloatArray, FloatArray]:
    """The derivative of `direction` and its own derivative."""
    _, slope = direction(state)
    turned = np.conj(state.rotation)
    bend = state.deflection_curvature * turned + state.deflection * np.conj(
        state.rotation_curvature
    )
    cross = state.deflection_slope * np.conj(state.rotation_slope)
    return slope, -(bend + 2 * cross).real


def _refined(motion: Motion, curve: Curve, low_m: FloatArray, high_m: FloatArray) -> FloatArray:
    """Roots between places of opposite sign, by Newton's method kept inside by bisection."""
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
    """Places close enough together to see every zone, tip and joints included."""
    count = int(motion.wave_number_per_m * motion.length_m * _SAMPLES_PER_RADIAN) + 48
    even = np.linspace(0.0, motion.length_m, count)
    even[0] = _CLAMP * motion.length_m
    return np.union1d(even, motion.joints_m)


def _signed_cells(motion: Motion, curve: Curve, places_m: FloatArray) -> FloatArray:
    """Roots of a curve that changes sign between neighbouring places."""
    value = curve(motion.state(places_m))[0]
    cells = np.flatnonzero((value[:-1] > 0) != (value[1:] > 0))
    return _refined(motion, curve, places_m[cells], places_m[cells + 1])


def zone_edges_m(motion: Motion, places_m: FloatArray) -> FloatArray:
    """The inner places at which the direction of motion changes, in rising order.

    Turning points of the direction are sampled too, so that no pair of edges between two places
    is missed.
    """
    turning = _signed_cells(motion, _direction_slope, places_m)
    return _signed_cells(motion, direction, np.union1d(places_m, turning))
