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
from device.beam.timoshenko import sections, system_matrix, waves
from device.beam.windows import Pattern, Sums, Window, window_means, window_width

_ROUNDING = 1e-14
_LEAST = 1e-250  # size of a wave, far from underflow


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """A beam's harmonic motion per volt.

    `state(x, count)` is deflection, m/V, and rotation, rad/V, with their first `count - 1`
    derivatives along the beam, at places x, shape (n,), in rising order: shape (2, count, n).

    `wave_number_per_m`, the largest one, says how finely to sample it; `rounding_m_per_v` is the
    largest rounding error of a deflection; it is not smooth at the inner `joints_m`.
    """

    length_m: float
    wave_number_per_m: float
    rounding_m_per_v: float
    joints_m: tuple[float, ...]
    state: Callable[[FloatArray, int], ComplexArray]


def _segment(
    exponent: ComplexArray, rotation: ComplexArray, weight: ComplexArray, ends_m: FloatArray
) -> Callable[[FloatArray, int], ComplexArray]:
    """Return `Motion.state` in the segment between two ends.

    Each of its waves e^{λ(x - x0)} has size 1 at the end x0 from which it decays.
    """
    both, turn = np.append(-exponent, exponent), np.append(-rotation, rotation)
    deflection = np.stack([weight * both**power for power in range(3)])
    columns = np.stack([deflection, deflection * turn])
    fade = np.exp(-exponent * (ends_m[1] - ends_m[0]))[:, None]
    in_range = np.abs(fade).min() > _LEAST

    def state(x_m: FloatArray, count: int) -> ComplexArray:
        waves = np.empty((4, x_m.size), dtype=np.complex128)
        np.multiply.outer(-exponent, x_m - ends_m[0], out=waves[:2])
        if in_range:  # a growing wave is then a quotient, which takes a fifth of the time
            np.exp(waves[:2], out=waves[:2])
            np.divide(fade, waves[:2], out=waves[2:])
        else:
            np.multiply.outer(exponent, x_m - ends_m[1], out=waves[2:])
            np.exp(waves, out=waves)
        return np.asarray(columns[:, :count] @ waves)

    return state


def segmented_motion(beam: Beam, frequency_hz: float, *, patched: bool, shear: bool) -> Motion:
    """Return the motion under the patches' moment pair ±M0 per volt, solved without modes.

    Each of the three segments has four waves, whose weights follow from the joints. They cancel
    where the beam is almost at rest. The moment jumps at the patches' ends. Moduli are
    E(1 + 2jζ); for `patched` and `shear` see `timoshenko.segmented_natural_frequency_hz`.
    """
    parts = sections(beam, patched=patched, shear=shear)
    wave = waves(parts, np.array([2 * math.pi * frequency_hz]), beam.damping_ratio)
    load = np.zeros(12, dtype=np.complex128)
    jump = beam.patch_moment_n_m_per_v / abs(wave.moment[0, 0, 0])
    # (24): rows 4 and 8 are the moments across the patches' ends, over the waves' scale.
    load[4], load[8] = jump, -jump
    weights = np.asarray(np.linalg.solve(system_matrix(parts, wave)[..., 0], load))
    ends_m = np.concatenate([[0.0], np.cumsum(parts.length_m)])
    segments = [
        _segment(wave.exponent[k, :, 0], wave.rotation[k, :, 0], weight, ends_m[k : k + 2])
        for k, weight in enumerate(np.split(weights, 3))
    ]

    def state(x_m: FloatArray, count: int) -> ComplexArray:
        places = [0, *np.searchsorted(x_m, ends_m[1:3]).tolist(), x_m.size]
        found = np.empty((2, count, x_m.size), dtype=np.complex128)
        for segment, (first, last) in zip(segments, pairwise(places), strict=True):
            if first < last:
                found[..., first:last] = segment(x_m[first:last], count)
        return found

    return Motion(
        length_m=float(ends_m[3]),
        wave_number_per_m=float(np.abs(wave.exponent).max()),
        rounding_m_per_v=_ROUNDING * float(np.abs(weights).max()),
        joints_m=(float(ends_m[1]), float(ends_m[2])),
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

    def state(x_m: FloatArray, count: int) -> ComplexArray:
        derivatives = np.zeros((4, x_m.size), dtype=np.complex128)
        for order, amplitude in enumerate(amplitudes, start=1):
            derivatives += amplitude * _shape_derivatives(order, x_m / beam.length_m)
        rows = derivatives / beam.length_m ** np.arange(4)[:, None]
        return np.stack([rows[:count], rows[1 : count + 1]])

    return Motion(
        length_m=beam.length_m,
        wave_number_per_m=modes.mode_constants(count).root / beam.length_m,
        rounding_m_per_v=_ROUNDING * max(map(abs, amplitudes)),
        joints_m=(),
        state=state,
    )


_SAMPLES_PER_RADIAN = 12
_STEPS = 60
_SETTLED = 1e-9, 1e-13  # parts of the length: turning points only lie between the edges of a pair
_SAME = 1e-15  # part of the length
_CLAMP = 1e-5  # part of the length next to the clamp where rounding exceeds the motion

Curve = Callable[[ComplexArray], FloatArray]


def direction(state: ComplexArray) -> FloatArray:
    """Return -Re(W ψ*), (27) of mathematics/beam, and as far as `state` goes its derivatives."""
    deflection, turned = state[0], np.conj(state[1])
    rows = [deflection[0] * turned[0]]
    if len(deflection) > 1:
        rows.append(deflection[1] * turned[0] + deflection[0] * turned[1])
    if len(deflection) > 2:
        bend = deflection[2] * turned[0] + deflection[0] * turned[2]
        rows.append(bend + 2 * deflection[1] * turned[1])
    return -np.stack(rows).real


def _roots(motion: Motion, order: int, places_m: FloatArray, values: FloatArray) -> FloatArray:
    """Return roots of a derivative of `direction`, 0 or 1, that has these values at places.

    They follow from secants by Newton's method, kept by bisection between places of opposite sign.
    """
    cells = np.flatnonzero((values[:-1] > 0) != (values[1:] > 0))
    low_m, high_m = places_m[cells], places_m[cells + 1]
    start, stop = values[cells], values[cells + 1]
    rising, place = start < 0, low_m + (high_m - low_m) * (start / (start - stop))
    for _ in range(_STEPS if cells.size else 0):
        value, slope = direction(motion.state(place, order + 2))[order:]
        below = (value < 0) == rising
        low_m, high_m = np.where(below, place, low_m), np.where(below, high_m, place)
        newton = place - value / np.where(slope == 0, 1.0, slope)
        inside = (newton >= low_m) & (newton <= high_m) & (slope != 0)
        former, place = place, np.where(inside, newton, (low_m + high_m) / 2)
        if np.abs(place - former).max() <= _SETTLED[1 - order] * motion.length_m:
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


def zone_edges_m(motion: Motion, places_m: FloatArray) -> FloatArray:
    """Return the inner places where the direction changes, in rising order; no pair is missed."""
    values, slopes = direction(motion.state(places_m, 2))
    turning = _roots(motion, 1, places_m, slopes)
    places = np.append(places_m, turning)
    values = np.append(values, direction(motion.state(turning, 1)))
    order = np.argsort(places)
    return _roots(motion, 0, places[order], values[order])


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
_ANTIDERIVATIVE *= 2.0 ** np.arange(_NODES.size + 1)[:, None]
"""From values at the nodes to the antiderivative's coefficients of t⁰ … t⁶; 0 at t = -½."""


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
        every = self.rows.take(piece, axis=1)
        cut = np.flatnonzero(part != 1)
        rows, offset, part = every[:, cut], offset[cut], part[cut]
        for first in range(len(rows)):
            for power in range(len(rows) - 2, first - 1, -1):
                rows[power] += offset * rows[power + 1]
            rows[first + 1 :] *= part
        every[:, cut] = rows
        return every


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
        magnitude[order] = np.abs(self.motion.state(places.ravel()[order], 1)[0, 0])
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
    sizes = np.abs(motion.state(nodes.ravel(), 1)[:, 0])
    return _Cells(low_m, high_m, *sizes.reshape(2, *nodes.shape))


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
    middles = motion.state((edges[1:] + edges[:-1]) / 2, 1)
    moves_right = (direction(middles)[0] > 0).astype(np.float64)
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
