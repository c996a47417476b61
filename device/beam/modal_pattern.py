"""The pattern of sums of modes for many drives at once, each known at the places of one grid.

Between neighbouring places the direction and the deflection are cubics that agree with values and
slopes at both. A cell contains at most two zone edges. |W| is summed by the trapezoidal rule with
its end correction, and exactly along the chord where it is almost a corner.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np

from device.beam.beam import Beam
from device.beam.fields import Field
from device.beam.modes import BoolArray, ComplexArray, FloatArray, IndexArray
from device.beam.timoshenko_modes import ModalBasis, modal_basis
from device.beam.windows import Pattern, Window, window_width

Ends = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
Array = TypeVar("Array", FloatArray, ComplexArray)

# The equations are those of docs/mathematics/beam.md; ε is the error of a direction.
_DRIVES_AT_ONCE = 48  # so few that their windows share a short stretch of the grid
_NEWTON_STEPS = 9  # of (33); five settle the edges of 300 random drives to 4e-16 of a cell
_CORNER = 2.5  # chords of a cell: where |W| is smaller, (31) takes the place of (30)
_BOTH_SIDES_AT_HALF_SLOPE = 4  # times ε over the slope is the length that (34) leaves uncertain
_SHALLOW = (
    4  # times ε: (35) asks for a depth of 2 ε; shallower dips may have a pair of edges or none
)
_MOST_DOUBT = 2  # cells: the most of (34), and what a pair of edges by (35) that may not exist gets
_QUARTERS = np.linspace(0.0, 1.0, 5)


def _cubic(
    ends: tuple[Array, Array, Array, Array],
) -> tuple[Array, Array, Array, Array]:
    """Return the weights of 1, τ, τ², τ³ in the cubic of (value, slope) at τ = 0 and at τ = 1."""
    start, slope, stop, stop_slope = ends
    rise = stop - start
    # (29), mathematics/beam
    return start, slope, 3 * rise - 2 * slope - stop_slope, slope + stop_slope - 2 * rise


def _value(terms: tuple[Array, ...], part: FloatArray) -> Array:
    """Return the cubics' values at parts of the cells."""
    c0, c1, c2, c3 = terms
    value: Array = c0 + part * (c1 + part * (c2 + part * c3))
    return value


def _slope(terms: tuple[Array, ...], part: FloatArray) -> Array:
    _, c1, c2, c3 = terms
    slope: Array = c1 + part * (2 * c2 + part * 3 * c3)
    return slope


def _roots(terms: tuple[FloatArray, ...], low: FloatArray, high: FloatArray) -> FloatArray:
    """Return roots of cubics between places of opposite sign by bracketed Newton steps, (33)."""
    rising = _value(terms, low) <= 0
    place = (low + high) / 2
    for _ in range(_NEWTON_STEPS):
        value, slope = _value(terms, place), _slope(terms, place)
        below = (value <= 0) == rising
        low, high = np.where(below, place, low), np.where(below, high, place)
        newton = place - value / np.where(slope == 0, 1.0, slope)
        place = np.where((newton >= low) & (newton <= high), newton, (low + high) / 2)
    return place


def _bottoms(slopes: tuple[FloatArray, ...], sign: FloatArray) -> FloatArray:
    """Return where cubics that dip towards 0 inside their cell are nearest to it, by (32)."""
    c1, c2, c3 = slopes
    # Of the zeros of c1 + 2 c2 τ + 3 c3 τ² the one at which the cubic bends away from 0, by the
    # formula in which c2 and the root do not cancel.
    away = sign * np.sqrt(np.maximum(c2 * c2 - 3 * c1 * c3, 0.0))
    alike = sign * c2 >= 0
    parts = np.where(alike, c2 + away, 3 * c3)
    place = np.where(alike, -c1, away - c2) / np.where(parts == 0, 1.0, parts)
    return np.asarray(np.clip(place, 0.0, 1.0))


def _chord_area(start: ComplexArray, stop: ComplexArray) -> FloatArray:
    """Return ∫₀¹|W|dτ of a motion that is linear in τ."""
    # (31), mathematics/beam
    step = stop - start
    size = np.maximum(np.abs(step), 1e-300)
    along = (start * np.conj(step)).real / size
    off = np.maximum(np.abs((start * np.conj(step)).imag) / size, 1e-300)
    ends = np.stack([along, along + size])
    before = (ends * np.hypot(off, ends) + off**2 * np.arcsinh(ends / off)) / 2
    area: FloatArray = (before[1] - before[0]) / size
    return area


def _areas(
    start: ComplexArray,
    start_slope: ComplexArray,
    stop: ComplexArray,
    stop_slope: ComplexArray,
    width: FloatArray,
) -> FloatArray:
    """Return ∫|W|dx over cells of which the motion and its slope at the ends are known."""
    sizes = [np.maximum(np.abs(end), 1e-300) for end in (start, stop)]
    slopes = [
        (slope * np.conj(end)).real / size
        for end, slope, size in zip((start, stop), (start_slope, stop_slope), sizes, strict=True)
    ]
    # (30), mathematics/beam
    area = width / 2 * (sizes[0] + sizes[1]) + width**2 / 12 * (slopes[0] - slopes[1])
    corner = np.nonzero(np.minimum(*sizes) < _CORNER * np.abs(stop - start))
    width = np.broadcast_to(width, area.shape)[corner]
    ends = start[corner], start_slope[corner] * width, stop[corner], stop_slope[corner] * width
    inner = _value(_cubic(ends), _QUARTERS[:, None])
    area[corner] = width * _chord_area(inner[:-1], inner[1:]).mean(axis=0)
    return np.asarray(area)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Cells:
    """A stretch of the grid under some drives; arrays of shape (drives, cells or places).

    In each cell the direction turns at `first` and back at `second`, as parts of the cell; both
    are 1 where it does not turn.
    """

    places_m: FloatArray
    widths_m: FloatArray
    deflection: ComplexArray
    slope: ComplexArray
    direction: Ends
    starts_right: BoolArray
    first: FloatArray
    second: FloatArray
    doubt_m: FloatArray

    def right_m(self, drive: IndexArray, cell: IndexArray, part: FloatArray) -> FloatArray:
        """Return the right-moving length of cells up to a part of each."""
        first, second = self.first[drive, cell], self.second[drive, cell]
        turned = np.minimum(np.maximum(part, first), second) - first
        kept = np.where(self.starts_right[drive, cell], part - turned, turned)
        return np.asarray(kept * self.widths_m[cell])

    @cached_property
    def whole_right_m(self) -> FloatArray:
        """The right-moving length of each cell."""
        turned = self.second - self.first
        return np.where(self.starts_right, 1.0 - turned, turned) * self.widths_m

    @cached_property
    def areas(self) -> FloatArray:
        """∫|W|dx over each cell."""
        (start, stop), (slope, stop_slope) = (
            (values[:, :-1], values[:, 1:]) for values in (self.deflection, self.slope)
        )
        return _areas(start, slope, stop, stop_slope, self.widths_m)

    def before(
        self, drive: IndexArray, end_m: FloatArray, span: slice
    ) -> tuple[FloatArray, FloatArray]:
        """Return right-moving length and ∫|W|dx between the start of some cells and each end."""
        cell = np.searchsorted(self.places_m, end_m, side="right") - 1
        cell = np.clip(cell, span.start, span.stop - 1)
        width = self.widths_m[cell]
        part = np.minimum((end_m - self.places_m[cell]) / width, 1.0)
        from_start = drive, cell - span.start
        right = _running(self.whole_right_m[:, span])[from_start] + self.right_m(drive, cell, part)
        area = _running(self.areas[:, span])[from_start] + self._part_area(drive, cell, part)
        return right, area

    def _part_area(self, drive: IndexArray, cell: IndexArray, part: FloatArray) -> FloatArray:
        width = self.widths_m[cell]
        start, stop = self.deflection[drive, cell], self.deflection[drive, cell + 1]
        slope, stop_slope = self.slope[drive, cell] * width, self.slope[drive, cell + 1] * width
        terms = _cubic((start, slope, stop, stop_slope))
        inner, inner_slope = _value(terms, part), _slope(terms, part) / width
        return _areas(start, slope / width, inner, inner_slope, part * width)


def _running(values: FloatArray) -> FloatArray:
    """Return sums of the cells before each place."""
    return np.concatenate([np.zeros((values.shape[0], 1)), np.cumsum(values, axis=1)], axis=1)


def _cells(basis: ModalBasis, weights: ComplexArray, error: FloatArray, stretch: slice) -> _Cells:
    """Return a stretch of the grid under drives whose direction has an error of up to `error`."""
    count = weights.shape[0]
    both = np.concatenate([weights.real, weights.imag]) @ basis.terms[:, :, stretch]
    deflection, slope, rotation, bend = (row[:count] + 1j * row[count:] for row in both)
    turned = np.conj(rotation)
    # (27), mathematics/beam
    value = -(deflection * turned).real
    tangent = -(slope * turned + deflection * np.conj(bend)).real
    places = basis.places_m[stretch]
    widths = np.diff(places)
    start, stop = value[:, :-1], value[:, 1:]
    start_slope, stop_slope = tangent[:, :-1] * widths, tangent[:, 1:] * widths
    ends = start, start_slope, stop, stop_slope
    first, second = np.ones(start.shape), np.ones(start.shape)
    positive = start > 0
    crossing = (positive != (stop > 0)) & (widths > 1e-12)
    limit = np.broadcast_to(error[:, None], start.shape)
    doubt = np.where(np.maximum(np.abs(start), np.abs(stop)) < limit, 1.0, 0.0)

    def terms(which: tuple[IndexArray, ...]) -> tuple[FloatArray, ...]:
        value, slope, end, end_slope = (each[which] for each in ends)
        return _cubic((value, slope, end, end_slope))

    def uncertain(
        cubic: tuple[FloatArray, ...], root: FloatArray, which: tuple[IndexArray, ...]
    ) -> FloatArray:
        """Return the length in cells about a root that may have the other direction, by (34)."""
        slope = np.abs(_slope(cubic, root))
        # Both sides are times the slope, so that a slope of 0 cannot overflow.
        reach = np.minimum(_BOTH_SIDES_AT_HALF_SLOPE * limit[which], _MOST_DOUBT * slope)
        return np.asarray(reach / np.maximum(slope, 1e-300))

    once = np.nonzero(crossing)
    cubic = terms(once)
    zero = np.zeros(once[0].size)
    first[once] = _roots(cubic, zero, zero + 1)
    doubt[once] += uncertain(cubic, first[once], once)
    sign = np.where(positive, 1.0, -1.0)
    dipping = (sign * start_slope < 0) & (sign * stop_slope > 0) & ~crossing
    dips = np.nonzero(dipping)
    cubic = terms(dips)
    lowest = _bottoms(cubic[1:], sign[dips])
    bottom = sign[dips] * _value(cubic, lowest)
    # (35): a deeper dip keeps half of its slope as far as its edges may be off.
    doubt[dips] += np.where(np.abs(bottom) < _SHALLOW * limit[dips], _MOST_DOUBT, 0)
    deep = bottom < 0
    twice = (dips[0][deep], dips[1][deep])
    cubic = terms(twice)
    zero = np.zeros(twice[0].size)
    first[twice] = _roots(cubic, zero, lowest[deep])
    second[twice] = _roots(cubic, lowest[deep], zero + 1)
    doubt[twice] += uncertain(cubic, first[twice], twice) + uncertain(cubic, second[twice], twice)
    return _Cells(
        places_m=places,
        widths_m=widths,
        deflection=deflection,
        slope=slope,
        direction=ends,
        starts_right=positive,
        first=first,
        second=second,
        doubt_m=doubt * widths,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class ModalPattern(Pattern):
    """Direction and magnitude of sums of modes, |W| relative to its rms.

    Attributes:
        weights: of the basis's terms, shape (drives, terms).
        rms_m_per_v: of |W| over the beam, for each drive.
        direction_error: how far each drive's direction -Re(W ψ*) may be wrong.
        drive: which drive applies to each place, shape (n,); of shape (1,) it applies to all.
    """

    basis: ModalBasis
    weights: ComplexArray
    rms_m_per_v: FloatArray
    direction_error: FloatArray
    drive: IndexArray

    def window(self, x_m: FloatArray, contact_m: FloatArray | float) -> Window:
        width_m = window_width(x_m, contact_m)
        start_m, drive = x_m - width_m, np.broadcast_to(self.drive, x_m.shape)
        columns = np.empty((3, x_m.size))
        for rows in self._parts(drive, start_m):
            columns[:, rows] = self._part(drive[rows], start_m[rows], x_m[rows])
        width = np.where(width_m > 0, width_m, 1.0)
        right = np.clip(columns[0] / width, 0.0, 1.0)
        mean = columns[1] / (width * self.rms_m_per_v[drive])
        return Window(right=right, left=1.0 - right, mean=mean, doubt_m=columns[2])

    def whole(self) -> Window:
        """See `Pattern`; of shape (n,) if each place has its own drive."""
        return self.window(np.full(self.drive.size, self.length_m), self.length_m)

    @cached_property
    def _only(self) -> _Cells:
        """All cells of the only drive, or the first, which every call shares."""
        return _cells(self.basis, self.weights[:1], self.direction_error[:1], slice(None))

    def direction(self) -> tuple[FloatArray, FloatArray]:
        """Return places and -Re(W ψ*) there as the first drive's cells have it, shape (n,)."""
        cells = self._only
        parts = _QUARTERS[:-1, None]
        places = cells.places_m[:-1] + parts * cells.widths_m
        start, slope, stop, stop_slope = (row[0] for row in cells.direction)
        values = _value(_cubic((start, slope, stop, stop_slope)), parts)
        order = np.argsort(places, axis=None)
        return places.ravel()[order], values.ravel()[order]

    def _parts(self, drive: IndexArray, start_m: FloatArray) -> Iterator[IndexArray]:
        """Yield the places of some drives at a time, of which the windows lie close together."""
        leftmost = np.full(self.rms_m_per_v.size, math.inf)
        np.minimum.at(leftmost, drive, start_m)
        rank = np.empty(leftmost.size, dtype=np.intp)
        rank[np.argsort(leftmost, kind="stable")] = np.arange(leftmost.size)
        order = np.argsort(rank[drive], kind="stable")
        groups = rank[drive][order] // _DRIVES_AT_ONCE
        yield from np.split(order, np.flatnonzero(np.diff(groups)) + 1)

    def _part(self, drive: IndexArray, start_m: FloatArray, end_m: FloatArray) -> FloatArray:
        """Return right-moving length, ∫|W|dx and doubt of some windows, shape (3, n)."""
        places = self.basis.places_m
        low = max(int(np.searchsorted(places, start_m.min(), side="right")) - 2, 0)
        high = min(int(np.searchsorted(places, end_m.max())) + 2, places.size)
        if len(self.weights) == 1:
            cells, local, first = self._only, drive, low
        else:
            used, local = np.unique(drive, return_inverse=True)
            errors, first = self.direction_error[used], 0
            cells = _cells(self.basis, self.weights[used], errors, slice(low, high))
        span = slice(first, first + high - low - 1)
        both = cells.before(np.tile(local, 2), np.concatenate([start_m, end_m]), span)
        right, area = (column[end_m.size :] - column[: end_m.size] for column in both)
        around = _running(cells.doubt_m[:, span])
        cell = np.searchsorted(cells.places_m, [start_m, end_m], side="right") - 1 - first
        last = np.minimum(cell[1] + 2, around.shape[1] - 1)
        doubt = around[local, last] - around[local, np.maximum(cell[0] - 1, 0)]
        return np.stack([right, area, doubt])


def modal_sum_field(
    beam: Beam,
    drive: IndexArray,
    frequency_hz: FloatArray,
    damping_ratio: FloatArray,
    *,
    direction_error: FloatArray | float = 0.0,
) -> Field:
    """Return the field per volt of the patched Timoshenko beam's modes, whatever its own damping.

    `drive` is the drive of each place, shape (n,), or (1,) for all places. The frequencies, damping
    ratios and, relative to its scale, errors of -Re(W ψ*) are of shape (drives,).
    """
    basis = modal_basis(beam)
    weights = basis.weights(frequency_hz, damping_ratio, beam.frequency_scale)
    rms, rotation = (
        np.sqrt(np.einsum("nk,nk->n", weights @ products, weights.conj()).real)
        for products in (basis.deflection_products, basis.rotation_products)
    )
    pattern = ModalPattern(
        length_m=beam.length_m,
        basis=basis,
        weights=weights,
        rms_m_per_v=rms,
        direction_error=direction_error * rms * rotation,
        drive=drive,
    )
    return Field(
        pattern=pattern,
        frequency_hz=frequency_hz[drive],
        displacement_m=rms[drive],
        rotation=rotation[drive],
    )
