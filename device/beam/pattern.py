"""The direction and magnitude of any motion along a beam, under any window.

A motion is given by deflection and rotation at places along the beam, each with three
derivatives; between, both are polynomials of degree 7. From it follow the zone edges, where
-Re(W ψ*) changes its sign, and ∫|W|dx, on pieces that are graded towards the minima of |W|. (25) to
(35) of docs/mathematics/beam.md.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from device.arrays import BoolArray, FloatArray, IndexArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Window:
    """The motion under a finger: the parts that move right and left, in [0, 1], and its magnitude.

    `mean` is that of |W| over its rms along the beam. The window is `[max(0, x - l_s), x]` with x
    the finger's right edge; of one without a width the limit x → 0+ is taken.
    """

    right: FloatArray
    left: FloatArray
    mean: FloatArray


class Pattern(Protocol):
    """The direction and relative magnitude of a motion along a beam."""

    def window(self, x_m: FloatArray, contact_m: FloatArray | float) -> Window:
        """Return the window of a finger of `contact_m` with its right edge at `x_m`, shape (n,)."""
        ...

    def whole(self) -> Window:
        """Return the window of a hand that covers the whole beam, shape (1,) or (n,)."""
        ...

    def chosen(self, motion: IndexArray) -> "Pattern":
        """Return the patterns of these motions, one for each place."""
        ...


_STEPS = 60
_SETTLED = 1e-5
"""Of a bracket: the cubic steps of `_roots` leave the cube of it."""
_HALVINGS = 24
_ROUNDING = 4e-15
"""Part of its largest coefficient below which a coefficient has no sign."""
_CORNER = 1e-10
"""Where |W| is smaller than its slope times this many radians it is 0 with a corner."""
_NEWTON = 6
_AT_END = 1 / 256
"""Part of a cell to which pieces become small at an end towards which |W| falls."""


def _hermite(conditions: int) -> FloatArray:
    """Return the matrix from value and derivatives at 0, then at 1, to coefficients by τ.

    There are so many conditions at each end; (26). Times 6 all numbers are whole.
    """
    size = 2 * conditions
    at_0 = np.diag([math.factorial(k) for k in range(size)])[:conditions]
    at_1 = [[math.perm(n, k) for n in range(size)] for k in range(conditions)]
    return np.asarray(np.round(6 * np.linalg.inv(np.concatenate([at_0, at_1]))) / 6)


_TERMS, _DEGREE = 8, 14
"""Of a motion in a cell, and of the product of two."""
_SEPTIC = _hermite(_TERMS // 2)
_AREA = _hermite(3) / np.arange(1, 7)[:, None]
_ORDERS = np.arange(_DEGREE + 1)
_SUMS = np.add.outer(np.arange(_TERMS), np.arange(_TERMS)).ravel()
_PAIRS = np.equal.outer(_ORDERS, _SUMS) * 1.0
"""Sums the products of two motions' coefficients up to those of τ⁰ … τ¹⁴."""
_CHOICES = np.array([[math.comb(n, k) for k in _ORDERS] for n in _ORDERS], dtype=np.float64)
_BERNSTEIN = _CHOICES / _CHOICES[_DEGREE]
"""From coefficients of τ⁰ … τ¹⁴ to Bernstein's; (27)."""
_HALF = _CHOICES / 2.0 ** _ORDERS[:, None]
_HALVES = np.concatenate([_HALF, _HALF[::-1, ::-1]])
"""From Bernstein's coefficients to those of the left and the right half."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Motions:
    """Motions of one beam at common places, in phase and in quadrature.

    Attributes:
        length_m: of the beam.
        wave_number_per_m: the largest.
        places_m: rising, shape (places,), from end to end; a joint stands twice, as derivatives may
            jump there.
        deflection: W in any unit, W', W'' and W''' per m, m² and m³, shape (4, 2, motions x
            places), all the places of a motion in one row; what is held at an end is 0 there.
        rotation: ψ, alike.
    """

    length_m: float
    wave_number_per_m: float
    places_m: FloatArray
    deflection: FloatArray
    rotation: FloatArray

    @cached_property
    def count(self) -> int:
        return int(self.deflection.shape[2]) // self.places_m.size

    @cached_property
    def row_m(self) -> FloatArray:
        """The places of all motions."""
        return np.tile(self.places_m, self.count)

    @cached_property
    def width_m(self) -> FloatArray:
        """From each place in the row to the next: cells; 0 at joints, negative after a motion."""
        return np.diff(self.row_m)

    def cells_of(self, motion: IndexArray, place_m: FloatArray) -> IndexArray:
        """Return the cells of places."""
        inner = self.places_m[1:-1].searchsorted(place_m, side="right")
        return np.asarray(motion * self.places_m.size + inner)


def _powers(of: FloatArray, count: int) -> FloatArray:
    """Return the powers 0 … count - 1, shape (count, n)."""
    powers = np.ones((count, of.size))
    np.multiply.accumulate(np.broadcast_to(of, (count - 1, of.size)), out=powers[1:])
    return powers


def _dot(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return Re(a b*) of values in phase and in quadrature, shape (2, n) each."""
    return np.asarray(np.einsum("pn,pn->n", one, other))


def _curves(state: FloatArray, cell: IndexArray, width_m: FloatArray) -> FloatArray:
    """Return the coefficients by τ of a motion in cells, shape (8, 2, n); (26)."""
    powers = _powers(width_m, _TERMS // 2)[:, None]
    ends = np.concatenate([state.take(at, axis=2) * powers for at in (cell, cell + 1)])
    return np.asarray((_SEPTIC @ ends.reshape(_TERMS, -1)).reshape(ends.shape))


def _at(curves: FloatArray, tau: FloatArray) -> FloatArray:
    """Return value, slope and bend by τ of motions in cells, shape (3, 2, n), by Horner."""
    out = np.zeros((3, *curves.shape[1:]))
    value, slope, bend = out
    value += curves[-1]
    for row in curves[-2::-1]:
        bend *= tau
        bend += slope
        slope *= tau
        slope += value
        value *= tau
        value += row
    bend *= 2
    return out


def _product(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the coefficients of Re(a b*) of two motions in cells, shape (15, n)."""
    pairs = np.einsum("ipn,jpn->ijn", one, other)
    return np.asarray(_PAIRS @ pairs.reshape(_SUMS.size, -1))


def _slope(curves: FloatArray) -> FloatArray:
    """Return the coefficients of a derivative, of the same shape."""
    return np.concatenate([curves[1:] * _ORDERS[1:, None], np.zeros_like(curves[:1])])


def _roots(curves: FloatArray, low: FloatArray, high: FloatArray, rising: BoolArray) -> FloatArray:
    """Return τ where polynomials of shape (15, n) are 0 between places of opposite sign.

    Halley's method, kept by bisection; (28).
    """
    tau, settled = (low + high) / 2, _SETTLED * (high - low)
    slopes = _slope(curves)
    bends = _slope(slopes)
    for _ in range(_STEPS if tau.size else 0):
        powers = _powers(tau, len(curves))
        value, slope, bend = (
            np.einsum("kn,kn->n", rows, powers) for rows in (curves, slopes, bends)
        )
        below = (value < 0) == rising
        low, high = np.where(below, tau, low), np.where(below, high, tau)
        divisor = slope * slope - value * bend / 2
        step = value * slope / np.where(divisor == 0, np.inf, divisor)
        inside = (tau - step >= low) & (tau - step <= high)
        former, tau = tau, np.where(inside, tau - step, (low + high) / 2)
        if (np.abs(tau - former) <= settled).all():
            break
    return tau


class _Points(NamedTuple):
    """Places in cells: motion and place, m, of each; value, slope and bend there, (3, 2, n)."""

    motion: IndexArray
    place_m: FloatArray
    state: FloatArray


def _points(motions: Motions, cell: IndexArray, tau: FloatArray, curves: FloatArray) -> _Points:
    """Return the points τ in cells, from the polynomials of their deflection."""
    width_m = motions.width_m[cell]
    state = _at(curves, tau) / _powers(width_m, 3)[:, None]
    return _Points(cell // motions.places_m.size, motions.row_m[cell] + tau * width_m, state)


def _places(motions: Motions, at: IndexArray) -> _Points:
    """Return the points at places in the row."""
    state = motions.deflection[:3].take(at, axis=2)
    return _Points(at // motions.places_m.size, motions.row_m[at], state)


def _joined(parts: Sequence[_Points]) -> _Points:
    return _Points(*(np.concatenate(column, axis=-1) for column in zip(*parts, strict=True)))


class _Brackets(NamedTuple):
    """Brackets with one root each: of which curve, between which τ, and whether it rises there."""

    curve: IndexArray
    low: FloatArray
    high: FloatArray
    rising: BoolArray


def _brackets(curves: FloatArray, ends: FloatArray) -> _Brackets:
    """Return the roots of polynomials, shape (15, n), in (0, 1), each in a bracket of its own.

    (27): where Bernstein's coefficients change sign once there is one root, else cells are halved.
    `ends`, shape (2, n), are the signs at 0 and 1, 0 for a root that does not count.
    """
    rows = _BERNSTEIN @ curves
    rounding = _ROUNDING * np.abs(rows).max(axis=0, initial=0.0)
    curve, low, width = np.arange(rows.shape[1]), np.zeros(rows.shape[1]), 1.0
    single = []
    for halving in range(_HALVINGS):
        signs = np.where(np.abs(rows) > rounding[curve], np.sign(rows), 0.0)
        signs[[0, _DEGREE]] = ends
        # A coefficient without a sign takes the one before it; in front of all it keeps none.
        last = np.maximum.accumulate(np.where(signs != 0, _ORDERS[:, None], 0), axis=0)
        signs = np.take_along_axis(signs, last, axis=0)
        turns = ((signs[1:] != signs[:-1]) & (signs[:-1] != 0)).sum(axis=0)
        alone = (turns == 1) & (ends != 0).all(axis=0)
        several = np.flatnonzero((turns > 0) & ~alone)
        if halving == _HALVINGS - 1:
            alone = turns % 2 == 1
        single.append((curve[alone], low[alone], low[alone] + width, signs[_DEGREE, alone] > 0))
        if not several.size:
            break
        width /= 2
        halves = (_HALVES @ rows[:, several]).reshape(2, _DEGREE + 1, -1)
        middle = np.where(halves[0, _DEGREE] > 0, 1.0, -1.0)
        start, stop = ends[:, several]
        ends = np.concatenate([[start, middle], [middle, stop]], axis=1)
        rows = np.concatenate(halves, axis=1)
        curve = np.tile(curve[several], 2)
        low = np.concatenate([low[several], low[several] + width])
    return _Brackets(*(np.concatenate(column) for column in zip(*single, strict=True)))


def _signs(values: FloatArray, motions: Motions) -> FloatArray:
    """Return the signs at the places in the row, 0 only where one of the beam's ends has none."""
    signs = np.where(values > 0, 1.0, -1.0)
    for end in (0, -1):
        at_end = slice(end % motions.places_m.size, None, motions.places_m.size)
        signs[at_end][values[at_end] == 0] = 0.0
    return signs


def _zeros(motions: Motions) -> tuple[_Points, _Points, BoolArray]:
    """Return the zone edges, the minima of |W|, and whether each motion goes right at its left end.

    (25) and (31) at each place, (27) between two.
    """
    width_m, (w, w1), (psi, psi1) = motions.width_m, motions.deflection[:2], motions.rotation[:2]
    direction, slope = -_dot(w, psi), np.abs(_dot(w1, psi) + _dot(w, psi1))
    growth, size, speed = _dot(w, w1), np.sqrt(_dot(w, w)), np.sqrt(_dot(w1, w1))
    signs = _signs(direction, motions), _signs(growth, motions)

    def cells(turns: BoolArray, values: FloatArray, slopes: FloatArray) -> IndexArray:
        """Return the cells in which something turns, and those in which a value may come near 0."""
        least, most = np.minimum(values[:-1], values[1:]), np.maximum(slopes[:-1], slopes[1:])
        return np.flatnonzero((width_m > 0) & (turns | (least <= most * width_m)))

    turns, rises = signs[0][1:] != signs[0][:-1], (growth[:-1] < 0) & (growth[1:] > 0)
    turning, low = cells(turns, np.abs(direction), slope), cells(rises, size, 2 * speed)
    cell, edges = np.concatenate([turning, low]), turning.size
    deflection = _curves(motions.deflection, cell, width_m[cell])
    rotation = _curves(motions.rotation, turning, width_m[turning])
    curves = _product(deflection, np.concatenate([-rotation, deflection[:, :, edges:]], axis=2))
    curves[:, edges:] = _slope(curves[:, edges:])
    ends = [np.concatenate([signs[0][turning + k], signs[1][low + k]]) for k in (0, 1)]
    curve, low_end, high_end, rising = _brackets(curves, np.array(ends))
    tau = _roots(curves[:, curve], low_end, high_end, rising)

    def points(which: IndexArray, joints: IndexArray) -> _Points:
        at = curve[which]
        inner = _points(motions, cell[at], tau[which], deflection[:, :, at])
        return _joined([inner, _places(motions, joints + 1)])

    # Between the two places of a joint the direction may turn by rounding, and |W| begin to rise.
    joints = np.flatnonzero(width_m == 0)
    turned, risen = joints[turns[joints]], joints[rises[joints]]
    count, is_edge = motions.places_m.size, curve < edges
    first, number = np.divmod(cell[curve[is_edge]], count)
    in_first = np.bincount(first[number == 0], minlength=motions.count)
    begins_right = (direction[1::count] > 0) ^ (in_first % 2 == 1)
    # Of the roots of the slope of |W|², those at which it rises.
    minima = np.flatnonzero(~is_edge & rising)
    return points(np.flatnonzero(is_edge), turned), points(minima, risen), begins_right


# The magnitude |W|: pieces are small near its minima, where it is almost a corner.


def _shoulders(motions: Motions, minima: _Points) -> tuple[_Points, FloatArray]:
    """Return places beside which W is 0 in the complex plane, without a minimum, and how far off.

    Of each cell it is the place next to the zero of its polynomial, which Newton's method finds.
    Cells with a minimum, and those beside them, are left out.
    """
    size, speed = (np.sqrt(_dot(part, part)) for part in motions.deflection[:2])
    width_m, reach = motions.width_m, size / np.where(speed > 0, speed, 1.0)
    near = (width_m > 0) & (np.minimum(reach[:-1], reach[1:]) < 2 * width_m)
    least = motions.cells_of(minima.motion, minima.place_m)
    for beside in (-1, 0, 1):
        near[np.clip(least + beside, 0, near.size - 1)] = False
    cell = np.flatnonzero(near)
    curves = _curves(motions.deflection, cell, width_m[cell])
    series = curves[:, 0] + 1j * curves[:, 1]
    tau = np.full(cell.size, 0.5, dtype=np.complex128)
    for _ in range(_NEWTON):
        value, slope = np.zeros_like(tau), np.zeros_like(tau)
        for row in series[::-1]:
            slope = slope * tau + value
            value = value * tau + row
        step = value / np.where(slope == 0, 1.0, slope)
        tau -= step / np.maximum(1.0, np.abs(step))
    place = np.clip(tau.real, 0.0, 1.0)
    aside = np.abs(tau - place)
    kept = (aside < 1) & (np.abs(step) < 0.1)
    points = _points(motions, cell[kept], place[kept], curves[:, :, kept])
    return points, aside[kept] * width_m[cell[kept]]


def _graded(motions: Motions, minima: _Points, theta: float) -> _Points:
    """Return the ends of pieces that become small towards minima of |W|; (31) and (32)."""
    count, cell_m = motions.places_m.size, float(motions.width_m.max())
    growth = _dot(*motions.deflection[:2]).reshape(-1, count)
    ends = [np.flatnonzero(growth[:, 0] >= 0) * count, np.flatnonzero(growth[:, -1] <= 0) * count]
    shoulders, aside_m = _shoulders(motions, minima)
    at_ends = _places(motions, np.concatenate([ends[0], ends[1] + count - 1]))
    centres = _joined([minima, at_ends, shoulders])
    size, slope = (np.sqrt(_dot(part, part)) for part in centres.state[:2])
    away_m = size / np.where(slope == 0, 1.0, slope)
    first, last = minima.place_m.size, centres.place_m.size - aside_m.size
    away_m[first:last] = np.maximum(away_m[first:last], _AT_END * cell_m)
    away_m[last:] = np.maximum(aside_m, _AT_END * cell_m)
    near = away_m * motions.wave_number_per_m >= _CORNER
    part, step = np.where(near, away_m, 1.0) / cell_m, theta / 6
    steps = np.where(near, (1 - (3 * step * part) ** (1 / 7)) / step, 0.0)
    number = np.arange(1.0, steps.max(initial=0.0) + 1)
    centre, place = np.nonzero(number <= steps[:, None])
    power = (1 - number[place] * step) ** 6
    grown_m = away_m[centre] / 2 * (1 / power - power)
    around_m = centres.place_m[centre] + np.stack([grown_m, -grown_m])
    within = (around_m > 0) & (around_m < motions.length_m)
    motion = np.broadcast_to(centres.motion[centre], around_m.shape)[within]
    place_m = around_m[within]
    cell = motions.cells_of(motion, place_m)
    width_m = motions.width_m[cell]
    tau = (place_m - motions.row_m[cell]) / width_m
    return _points(motions, cell, tau, _curves(motions.deflection, cell, width_m))


def _magnitude(state: FloatArray, corner_m: float) -> tuple[FloatArray, FloatArray]:
    """Return |W| and its two derivatives as seen from the right and from the left; (29) and (30).

    Where |W| is at most `corner_m` times the slope it counts as 0, and one-sided limits apply.
    """
    w, w1, w2 = state
    square, speed2 = _dot(w, w), _dot(w1, w1)
    out = np.empty((3, square.size))
    size, slope, bend = out
    np.sqrt(square, out=size)
    at_rest = np.flatnonzero(square <= corner_m**2 * speed2)
    some = size.copy()
    some[at_rest] = 1.0
    np.divide(_dot(w1, w), some, out=slope)
    bend[:] = (speed2 + _dot(w2, w) - slope**2) / some
    other = out
    if at_rest.size:
        w1, w2, speed = w1[:, at_rest], w2[:, at_rest], np.sqrt(speed2[at_rest])
        turn = _dot(w2, w1) / np.where(speed > 0, speed, 1.0)
        other = out.copy()
        out[:, at_rest], other[:, at_rest] = (0 * speed, speed, turn), (0 * speed, -speed, -turn)
    return out, other


@dataclass(frozen=True, kw_only=True, eq=False)
class Patterns:
    """The patterns of several motions, in one row of pieces; `of` says which a place asks about.

    Attributes:
        length_m: of the beam.
        stride_m: what a motion's number counts in `keys`.
        keys: where each piece begins, m, plus the motion's number times `stride_m`; (pieces,).
        pieces: of each where it begins, m, 1 or 0 if it moves right or left, what moves right
            before it, m, and ∫|W|dx over the rms |W|, m, before it and in it, as the coefficients
            of a polynomial of degree 6 in m from its start; shape (pieces, 10).
        at_end: direction and |W|/rms at the left end, of each motion; shape (2, motions).
        of: the motion, shape (1,) or one for each place.
    """

    length_m: float
    stride_m: float
    keys: FloatArray
    pieces: FloatArray
    at_end: FloatArray
    of: IndexArray

    def chosen(self, motion: IndexArray) -> "Patterns":
        """Return the same with the motion that each place asks about; one alone is all drives'."""
        return self if self.at_end.shape[1] == 1 else replace(self, of=motion)

    def _before(self, x_m: FloatArray, motion: IndexArray) -> tuple[FloatArray, FloatArray]:
        """Return what moves right, m, and ∫|W|dx/rms, m, up to each place; (33)."""
        piece = self.keys.searchsorted(x_m + motion * self.stride_m, side="right") - 1
        start_m, moves, right_m, *area = self.pieces.take(piece, axis=0).T
        along_m = x_m - start_m
        right_m = right_m + moves * along_m
        total = area[-1]
        for row in area[-2::-1]:
            total = total * along_m
            total += row
        return right_m, total

    def window(self, x_m: FloatArray, contact_m: FloatArray | float) -> Window:
        """See `Pattern`; (34) and (35)."""
        width_m, count = np.minimum(x_m, contact_m), x_m.size
        motion = self.of if self.of.size == 1 else np.concatenate([self.of, self.of])
        ends = self._before(np.concatenate([x_m - width_m, x_m]), motion)
        right, mean = (values[count:] - values[:count] for values in ends)
        if width_m.size and width_m.min() <= 0:
            narrow = width_m <= 0
            width_m = np.where(narrow, 1.0, width_m)
            right, mean = np.where(narrow, self.at_end[:, self.of], [right, mean])
        right /= width_m
        mean /= width_m
        np.clip(right, 0.0, 1.0, out=right)
        return Window(right=right, left=1.0 - right, mean=mean)

    def whole(self) -> Window:
        """See `Pattern`."""
        return self.window(np.full(self.of.size, self.length_m), self.length_m)


def _sums(values: FloatArray, first: IndexArray) -> FloatArray:
    """Return the sum before each piece, from about 0 at the first piece of each motion.

    Only differences within a motion count: each begins with the rounding of those before it.
    """
    steps = np.append(0.0, values[:-1])
    steps[first[1:]] -= np.add.reduceat(values, first)[:-1]
    return np.cumsum(steps)


def patterns(motions: Motions, rms: FloatArray, theta: float) -> Patterns:
    """Return the patterns of motions, |W| relative to `rms`, shape (motions,).

    `theta` is the length of the first piece at a minimum of |W| over |W/W'| there; (32).
    """
    edges, minima, begins_right = _zeros(motions)
    inner = (edges, minima, _graded(motions, minima, theta))
    number = np.repeat(np.arange(motions.count), motions.places_m.size)
    motion = np.concatenate([number, *(points.motion for points in inner)])
    place_m = np.concatenate([motions.row_m, *(points.place_m for points in inner)])
    states = [motions.deflection[:3], *(points.state for points in inner)]
    turns = np.zeros(place_m.size, dtype=np.intp)
    turns[number.size : number.size + edges.place_m.size] = 1

    order = np.lexsort((place_m, motion))
    place_m, motion = place_m[order], motion[order]
    state = np.concatenate(states, axis=2).take(order, axis=2)
    starts = np.flatnonzero((place_m[:-1] < place_m[1:]) & (motion[:-1] == motion[1:]))
    start_m, width_m, motion = place_m[starts], np.diff(place_m)[starts], motion[starts]
    first = np.searchsorted(motion, np.arange(motions.count))
    turned = np.cumsum(turns[order])[starts]
    turned -= turned[first][motion]
    moves_right = ((turned + begins_right[motion]) % 2).astype(np.float64)

    powers = _powers(width_m, 7)
    from_right, from_left = _magnitude(state, _CORNER / motions.wave_number_per_m)
    sides = from_right.take(starts, axis=1), from_left.take(starts + 1, axis=1)
    area = _AREA @ np.concatenate([side * powers[:3] for side in sides])
    area *= width_m / np.where(rms > 0, rms, 1.0)[motion]
    before = _sums(moves_right * width_m, first), _sums(area.sum(axis=0), first)
    stride_m = 2 * motions.length_m
    return Patterns(
        length_m=motions.length_m,
        stride_m=stride_m,
        keys=start_m + motion * stride_m,
        pieces=np.column_stack([start_m, moves_right, *before, *(area / powers[1:])]),
        at_end=np.stack([moves_right[first], area[0, first] / width_m[first]]),
        of=np.zeros(1, dtype=np.intp),
    )
