"""The driven beam's complex motion along its length, its zones, and its pattern."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from device.beam import modes
from device.beam.beam import Beam
from device.beam.modes import BoolArray, ComplexArray, FloatArray
from device.beam.timoshenko import Waves, sections, system_matrix, waves_of
from device.beam.windows import Pattern, Sums, Window, window_means, window_width

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
    """A beam's harmonic motion per volt: `state` at places, shape (n,), in rising order.

    `wave_number_per_m`, the largest one, says how finely to sample it; `rounding_m_per_v` is the
    largest rounding error of a deflection; it is not smooth at the inner `joints_m`.
    """

    length_m: float
    wave_number_per_m: float
    rounding_m_per_v: float
    joints_m: tuple[float, ...]
    state: Callable[[FloatArray], MotionState]


def _segment(
    wave: Waves, weight: ComplexArray, length_m: float, start_m: float
) -> Callable[[FloatArray], ComplexArray]:
    """Return what tells the fields of `MotionState` at places in a segment, shape (n, 6).

    Each of its waves e^{λ(x - x0)} has size 1 at the end x0 from which it decays.
    """
    exponent, rotation = wave.exponent[0], wave.rotation[0]
    both, turn = np.concatenate([-exponent, exponent]), np.concatenate([-rotation, rotation])
    deflection = np.stack([weight * both**power for power in range(3)], axis=-1)
    columns = np.concatenate([deflection, deflection * turn[:, None]], axis=-1)
    origin_m = np.array([0.0, 0.0, length_m, length_m])

    def fields(x_m: FloatArray) -> ComplexArray:
        waves = ((x_m - start_m)[:, None] - origin_m) * both
        return np.asarray(np.exp(waves, out=waves) @ columns)

    return fields


def segmented_motion(beam: Beam, frequency_hz: float, *, patched: bool, shear: bool) -> Motion:
    """Return the motion under the patches' moment pair ±M0 per volt, solved without modes.

    Each of the three segments has four waves, whose weights follow from the joints. They cancel
    where the beam is almost at rest. The moment jumps at the patches' ends. Moduli are
    E(1 + 2jζ); for `patched` and `shear` see `timoshenko.segmented_natural_frequency_hz`.
    """
    parts = sections(beam, patched=patched, shear=shear)
    omega = np.array([2 * math.pi * frequency_hz])
    segment_waves = waves_of(parts, omega, beam.damping_ratio)
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
                fields[first:last] = segment(x_m[first:last])
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
    c = modes.mode_constants(order)
    shape, slope = modes.mode_shape(order, xi), modes.mode_slope(order, xi)
    clamp, tip = c.clamp_weight * np.exp(-c.root * xi), c.tip_weight * np.exp(-c.root * (1 - xi))
    # (11), mathematics/beam
    curvature = c.root**2 * (2 * (clamp + tip) - shape)
    third = c.root**2 * (2 * c.root * (tip - clamp) - slope)
    return np.stack([shape, slope, curvature, third])


def modal_motion(beam: Beam, frequency_hz: float, count: int) -> Motion:
    """Return the sum of the bare Euler-Bernoulli beam's modes 1 to `count`, without shear."""
    amplitudes = [
        modes.modal_amplitude_m_per_v(beam, order, frequency_hz) for order in range(1, count + 1)
    ]

    def state(x_m: FloatArray) -> MotionState:
        derivatives = np.zeros((4, x_m.size), dtype=np.complex128)
        for order, amplitude in enumerate(amplitudes, start=1):
            derivatives += amplitude * _shape_derivatives(order, x_m / beam.length_m)
        rows = [row / beam.length_m**power for power, row in enumerate(derivatives)]
        return MotionState(*rows[:3], *rows[1:])

    return Motion(
        length_m=beam.length_m,
        wave_number_per_m=modes.mode_constants(count).root / beam.length_m,
        rounding_m_per_v=_ROUNDING * max(map(abs, amplitudes)),
        joints_m=(),
        state=state,
    )


_SAMPLES_PER_RADIAN = 12
_STEPS, _SETTLED = 60, 1e-13
_SAME = 1e-15  # part of the length
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
    motion: Motion, curve: Curve, low_m: FloatArray, high_m: FloatArray, rising: BoolArray
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


def _once(places: FloatArray, more: FloatArray | tuple[float, ...]) -> FloatArray:
    """Return all these places in rising order, those that differ by rounding alone once."""
    # Not np.union1d, which loads masked arrays: that takes longer than to set a motion up.
    every = np.sort(np.concatenate([places, more]))
    once: FloatArray = every[np.concatenate([[True], np.diff(every) > _SAME * every[-1]])]
    once[-1] = every[-1]
    return once


def sample_places(motion: Motion) -> FloatArray:
    """Return places close enough to resolve every zone, including the tip and the joints."""
    count = int(motion.wave_number_per_m * motion.length_m * _SAMPLES_PER_RADIAN) + 48
    even = np.linspace(0.0, motion.length_m, count)
    even[0] = _CLAMP * motion.length_m
    return _once(even, motion.joints_m)


def _signed_cells(motion: Motion, curve: Curve, places_m: FloatArray) -> FloatArray:
    """Return roots of a curve that changes sign between neighbouring places."""
    value = curve(motion.state(places_m))[0]
    cells = np.flatnonzero((value[:-1] > 0) != (value[1:] > 0))
    return _refined(motion, curve, places_m[cells], places_m[cells + 1], value[cells] < 0)


def zone_edges_m(motion: Motion, places_m: FloatArray) -> FloatArray:
    """Return the inner places where the direction changes, in rising order; no pair is missed."""
    turning = _signed_cells(motion, _direction_slope, places_m)
    return _signed_cells(motion, direction, _once(places_m, turning))


# The pattern of a motion, set up once and then evaluated at any number of places.
#
# |W| has no closed integral. It is stored as polynomials on cells that are halved towards its
# minima, where it is almost a corner if the damping is small; sums of their integrals give the mean
# over a window.


# Gauss and Legendre's, as np.polynomial.legendre.leggauss(6) gives them: numpy's polynomials take
# as long to import as the motion takes to solve.
_OUTER = np.array([0.9324695142031519, 0.6612093864662645, 0.2386191860831969])
_SHARES = np.array([0.17132449237917027, 0.3607615730481387, 0.46791393457269104])
_NODES, _WEIGHTS = np.append(-_OUTER, _OUTER[::-1]), np.append(_SHARES, _SHARES[::-1])
_CELLS_PER_RADIAN = 4
_ROUGH, _FLOOR, _HALVINGS = 3e-8, 1e-11, 26
_NARROW = 1e-5  # part of the length below which a window is summed on its own
_MONOMIALS = np.linalg.inv(np.vander(_NODES, increasing=True))

_POWERS = np.arange(1, _NODES.size + 1)
_OF_POWERS = _MONOMIALS / _POWERS[:, None]
_ANTIDERIVATIVE = np.vstack([-((-1.0) ** _POWERS) @ _OF_POWERS, _OF_POWERS])
"""From values at the nodes to the antiderivative's coefficients of t⁰ … t⁶; it is 0 at t = -1."""


class _Pieces(NamedTuple):
    """Polynomials between neighbouring ends, from t = -½ to ½ in each: rows of t⁰, t¹ …."""

    ends_m: FloatArray
    rows: FloatArray

    def within(self, low_m: FloatArray, high_m: FloatArray) -> FloatArray:
        """Return the rows of parts of the pieces, by Taylor's shift."""
        middle_m = (low_m + high_m) / 2
        piece = np.searchsorted(self.ends_m[1:-1], middle_m, side="right")
        start_m, stop_m = self.ends_m[piece], self.ends_m[piece + 1]
        width_m = stop_m - start_m
        offset, part = (middle_m - (start_m + stop_m) / 2) / width_m, (high_m - low_m) / width_m
        rows = np.take(self.rows, piece, axis=1)
        for first in range(len(rows)):
            for power in range(len(rows) - 2, first - 1, -1):
                rows[power] += offset * rows[power + 1]
            rows[first + 1 :] *= part
        return rows


@dataclass(frozen=True, kw_only=True, eq=False)
class _MotionSums(Sums):
    """`Sums` of a motion: two polynomials, with the rows `right` and `area`, in each piece.

    Piece k goes from k - ½ to k + ½ in `numbers`, so that one look-up tells both piece and t.
    """

    ends_m: FloatArray
    numbers: FloatArray
    right: FloatArray
    area: FloatArray

    def at(self, x_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `Sums`."""
        t = np.interp(x_m, self.ends_m, self.numbers)
        nearest = np.rint(t)
        t -= nearest
        piece = nearest.astype(np.intp)

        def value(rows: FloatArray) -> FloatArray:
            total: FloatArray = rows[-1].take(piece)
            for row in rows[-2::-1]:
                total *= t
                total += row.take(piece)
            return total

        return value(self.right), value(self.area)

    def of_windows(self, width_m: float) -> "_MotionSums":
        """See `Sums`."""
        later = self.ends_m + width_m
        ends_m = _once(self.ends_m, later[later < self.ends_m[-1]])
        parts = _Pieces(self.ends_m, self.right), _Pieces(self.ends_m, self.area)
        return _motion_sums(ends_m, parts, width_m)


def _motion_sums(
    ends_m: FloatArray, parts: tuple[_Pieces, _Pieces], width_m: float = 0.0
) -> _MotionSums:
    """Return the sums between common ends, in windows of `width_m` unless it is 0."""
    low_m, high_m = ends_m[:-1], ends_m[1:]
    right, area = (part.within(low_m, high_m) for part in parts)
    if width_m:
        low_m, high_m = low_m - width_m, high_m - width_m
        begun = low_m + high_m > 0  # earlier windows begin at the clamp
        right, area = (
            until - begun * part.within(low_m, high_m)
            for until, part in zip((right, area), parts, strict=True)
        )
    numbers = np.arange(-0.5, ends_m.size - 1, dtype=np.float64)
    numbers[-1] = np.nextafter(numbers[-1], 0.0)  # the last end is in the last piece
    return _MotionSums(ends_m=ends_m, numbers=numbers, right=right, area=area)


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionPattern(Pattern):
    """Direction and magnitude of a motion along the beam; |W| is relative to its rms.

    Attributes:
        motion: for windows narrower than any cell.
        rms_m_per_v: of |W| over the beam; `rotation_per_v` that of the rotation, rad/V.
        edges_m: zone edges, from 0 to the length; `moves_right` is 1 or 0 for each zone.
        before: the right-moving length and ∫|W|dx/rms between the clamp and each place.
    """

    motion: Motion
    rms_m_per_v: float
    rotation_per_v: float
    edges_m: FloatArray
    moves_right: FloatArray
    before: _MotionSums

    def window(self, x_m: FloatArray, contact_m: FloatArray | float) -> Window:
        width_m, least_m = window_width(x_m, contact_m), _NARROW * self.length_m
        right, mean = window_means(self.before, x_m, width_m, contact_m, least_m)
        narrow = (width_m < least_m).nonzero()[0]
        if narrow.size:
            some = width_m[narrow] > 0
            right[narrow[~some]] = mean[narrow[~some]] = 0.0  # at the clamp
            narrow = narrow[some]
        if narrow.size:
            mean[narrow] = self._narrow_mean(x_m[narrow], width_m[narrow])
        return Window(right=right, left=1.0 - right, mean=mean)

    def _narrow_mean(self, x_m: FloatArray, width_m: FloatArray) -> FloatArray:
        """Return the mean over narrow windows from the motion itself."""
        places = x_m[:, None] + np.multiply.outer(width_m, (_NODES - 1) / 2)
        order = np.argsort(places, axis=None)
        magnitude = np.empty(places.size)
        magnitude[order] = np.abs(self.motion.state(places.ravel()[order]).deflection)
        means = magnitude.reshape(places.shape) @ _WEIGHTS / (2 * self.rms_m_per_v)
        return np.asarray(means)


class _Cells(NamedTuple):
    """Ends of cells and, at each cell's nodes, the motion's magnitudes, shape (cells, 6)."""

    low_m: FloatArray
    high_m: FloatArray
    deflection: FloatArray
    rotation: FloatArray

    @property
    def half_m(self) -> FloatArray:
        """Half of each cell's width, shape (cells, 1)."""
        return np.asarray((self.high_m - self.low_m)[:, None] / 2)

    def rough(self, floor_m_per_v: float) -> BoolArray:
        """Return whether |W|'s highest coefficient is still large beside |W| in the cell."""
        highest = np.abs(self.deflection @ _MONOMIALS[-1])
        limit = np.maximum(_ROUGH * self.deflection.max(axis=1), floor_m_per_v)
        return np.asarray(highest > limit)


def _measured(motion: Motion, low_m: FloatArray, high_m: FloatArray) -> _Cells:
    """Return cells from `low_m` to `high_m`, in rising order, with the motion at their nodes."""
    half = (high_m - low_m)[:, None] / 2
    nodes = (high_m + low_m)[:, None] / 2 + half * _NODES
    state = motion.state(nodes.ravel())
    sizes = (np.abs(field).reshape(nodes.shape) for field in (state.deflection, state.rotation))
    return _Cells(low_m, high_m, *sizes)


def _cells(motion: Motion) -> _Cells:
    """Return even cells, split at the joints and halved until |W| is smooth in each."""
    length_m = motion.length_m
    count = int(motion.wave_number_per_m * length_m * _CELLS_PER_RADIAN) + 16
    edges = _once(np.linspace(0.0, length_m, count + 1), motion.joints_m)
    open_cells = _measured(motion, edges[:-1], edges[1:])
    done, smooth = [open_cells], []
    floor = max(motion.rounding_m_per_v, _FLOOR * float(open_cells.deflection.max()))
    for _ in range(_HALVINGS):
        rough = open_cells.rough(floor)
        smooth.append(~rough)
        if not rough.any():
            break
        low, high = open_cells.low_m[rough], open_cells.high_m[rough]
        middle = (low + high) / 2
        ends = np.stack([low, middle, middle, high], axis=-1).reshape(-1, 2)
        open_cells = _measured(motion, ends[:, 0], ends[:, 1])
        done.append(open_cells)
    else:
        smooth.append(np.ones(open_cells.low_m.size, dtype=np.bool_))
    kept = np.flatnonzero(np.concatenate(smooth))
    low_m, *others = (np.concatenate(column) for column in zip(*done, strict=True))
    order = kept[np.argsort(low_m[kept])]
    return _Cells(low_m[order], *(column[order] for column in others))


def _before(
    cells: _Cells, rms_m_per_v: float, edges_m: FloatArray, moves_right: FloatArray
) -> _MotionSums:
    """Return `MotionPattern.before`, with cells cut at the zone edges too."""
    area = cells.half_m * cells.deflection / rms_m_per_v
    whole = _ANTIDERIVATIVE @ area.T
    whole[0, 1:] += np.cumsum(area @ _WEIGHTS)[:-1]
    whole *= 2.0 ** np.arange(len(whole))[:, None]  # from t in [-1, 1]
    ends_m = np.append(cells.low_m, cells.high_m[-1])
    right_m = np.diff(edges_m) * moves_right
    middle_m = np.cumsum(right_m) - right_m / 2
    parts = _Pieces(edges_m, np.stack([middle_m, right_m])), _Pieces(ends_m, whole)
    return _motion_sums(_once(ends_m, edges_m), parts)


def motion_pattern(motion: Motion) -> MotionPattern:
    """Return the pattern of a motion; this is the work that all places share."""
    places = sample_places(motion)
    inner = zone_edges_m(motion, places)
    edges = np.concatenate([[0.0], inner, [motion.length_m]])
    moves_right = (direction(motion.state((edges[1:] + edges[:-1]) / 2))[0] > 0).astype(np.float64)
    cells = _cells(motion)
    length_m = motion.length_m
    rms, rotation = (
        float(np.sqrt(np.sum(cells.half_m * values**2 * _WEIGHTS) / length_m))
        for values in (cells.deflection, cells.rotation)
    )
    return MotionPattern(
        length_m=length_m,
        motion=motion,
        rms_m_per_v=rms,
        rotation_per_v=rotation,
        edges_m=edges,
        moves_right=moves_right,
        before=_before(cells, rms, edges, moves_right),
    )
