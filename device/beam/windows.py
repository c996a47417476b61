"""The window under the finger: the part of it that moves right, and the mean of |φ| over it.

The window is `[max(0, x - l_s), x]` with x the finger's right edge (the paper's Eqs 11 and 12 do
not state the clip at the clamp). At x = 0 its width is 0: the limit x → 0+ is used, in which
everything moves left and φ = 0.
"""

import cmath
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from device.beam.modes import LOW_ORDER, FloatArray, mode_constants, mode_integral, phase
from device.beam.zones import Zones, node_remainders_m, zones

_NARROW = 0.5  # width in bξ below which an antiderivative's difference would lose digits
_TINY_M = 1e-300  # stands for a window of no width, of which the mean is then settled elsewhere
_MANY = 500  # windows of one contact, from which on its own pieces are worth their set-up
_CLAMP_REACH = 2.0  # in bξ: below it the textbook form is accurate, above it a node is near
_SERIES = tuple(2.0 / math.factorial(power) for power in (23, 19, 15, 11, 7, 3))


@dataclass(frozen=True, kw_only=True, eq=False)
class Window:
    """The motion under a finger: the parts that move right and left, in [0, 1], and its magnitude.

    `mean` is relative to the displacement, mean |φ| for a mode; `doubt_m` is the length whose
    direction an error of the motion may turn, where known.
    """

    right: FloatArray
    left: FloatArray
    mean: FloatArray
    doubt_m: FloatArray | float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Pattern(ABC):
    """The direction and relative magnitude of the motion along a beam."""

    length_m: float

    @abstractmethod
    def window(self, x_m: FloatArray, contact_m: FloatArray | float) -> Window:
        """Return the window of a finger of `contact_m` with its right edge at `x_m`, shape (n,)."""

    def whole(self) -> Window:
        """Return the window of a hand that covers the whole beam, shape (1,)."""
        return self.window(np.array([self.length_m]), self.length_m)


def window_width(end_m: FloatArray, contact_m: FloatArray | float) -> FloatArray:
    """Return the covered length min(x, l_s), m: the part of the contact beyond the clamp."""
    return np.minimum(end_m, contact_m)


class Sums(ABC):
    """What moves right, m, and |φ| or |W|, each summed up to a place or in the window before it."""

    @abstractmethod
    def at(self, x_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return both sums at places."""

    @abstractmethod
    def of_windows(self, width_m: float) -> "Sums":
        """Return the sums in windows of one width, which begin at the clamp at the earliest."""


@lru_cache(maxsize=64)
def _of_windows(sums: Sums, width_m: float) -> Sums:
    return sums.of_windows(width_m)


def window_means(
    sums: Sums, x_m: FloatArray, width_m: FloatArray, contact_m: FloatArray | float, least_m: float
) -> tuple[FloatArray, FloatArray]:
    """Return right-moving part and mean magnitude of windows; of those of no width no mean.

    For many windows of one contact, of at least `least_m`, half as many sums are computed.
    """
    contact, count = np.asarray(contact_m), x_m.size
    if count < _MANY or contact.size > 1 or contact.item() < least_m:
        ends = sums.at(np.concatenate([x_m - width_m, x_m]))
        right, mean = (each[count:] - each[:count] for each in ends)
    else:
        right, mean = _of_windows(sums, contact.item()).at(x_m)
    per_m = 1.0 / np.maximum(width_m, _TINY_M)
    right *= per_m
    mean *= per_m
    np.maximum(right, 0.0, out=right)
    np.minimum(right, 1.0, out=right)
    return right, mean


def mode_window(
    order: int, length_m: float, end_m: FloatArray, contact_m: FloatArray | float
) -> Window:
    """Return the right-moving part and the mean of |φ| for many windows over mode `order`.

    Exact sums from the zone edges and the mode's antiderivative split at its nodes; narrow windows
    take a form without cancellation. `end_m` in [0, L] are of shape (n,).
    """
    width_m = window_width(end_m, contact_m)
    sums = mode_sums(order, length_m)
    right, mean = window_means(sums, end_m, width_m, contact_m, sums.least_m)
    _settle_narrow(zones(order, length_m), end_m, width_m, right, mean)
    return Window(right=right, left=1.0 - right, mean=mean)


@dataclass(frozen=True, kw_only=True, eq=False)
class ModeSums(Sums):
    """`Sums` of one mode, in pieces of which all but the first begin at `inner_m`.

    What moves right is slope·x + offset. With k = b/L, and `near_m` for the weights of clamp and
    tip, |φ| is size·sin(kx - lag) + rest, and near the ends clamp·e^{-kx} + tip·e^{kx}; at orders
    above `LOW_ORDER` e^{kx} may be out of range, and the tip's is e^{-k(L-x)}.
    """

    order: int
    length_m: float
    inner_m: FloatArray
    slope: FloatArray
    offset_m: FloatArray
    size_m: FloatArray
    lag: FloatArray
    rest_m: FloatArray
    near_m: FloatArray | None = None

    @property
    def least_m(self) -> float:
        """The least contact of `of_windows`."""
        root = mode_constants(self.order).root
        return _NARROW * self.length_m / root if self.order <= LOW_ORDER else math.inf

    def at(self, x_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `Sums`."""
        c, low = mode_constants(self.order), self.order <= LOW_ORDER
        piece = self.inner_m.searchsorted(x_m, side="right")
        right = self.slope.take(piece)
        right *= x_m
        right += self.offset_m.take(piece)
        total = self.rest_m.take(piece)
        wave = x_m * (c.root / self.length_m) if low else phase(c, x_m / self.length_m, 0.0)
        if self.near_m is not None:
            clamp, tip = (weight.take(piece) for weight in self.near_m)
            if low:  # one exponential gives the other
                grown = np.exp(wave)
                clamp /= grown
                tip *= grown
            else:
                clamp *= np.exp(-c.root * (x_m / self.length_m))
                tip *= np.exp(-c.root * (1.0 - x_m / self.length_m))
            total += clamp
            total += tip
        wave -= self.lag.take(piece)
        np.sin(wave, out=wave)
        wave *= self.size_m.take(piece)
        total += wave
        return right, total

    def of_windows(self, width_m: float) -> "ModeSums":
        """See `Sums`; for low orders."""
        width_m = min(width_m, self.length_m)
        starts_m = np.append(0.0, self.inner_m)
        inner_m = np.unique(np.append(self.inner_m, starts_m + width_m))
        middle_m = (np.append(0.0, inner_m) + np.append(inner_m, self.length_m)) / 2
        stop, start = (self.inner_m.searchsorted(middle_m - back) for back in (0.0, width_m))
        begun = (middle_m > width_m) * 1.0  # earlier windows begin at the clamp
        angle = mode_constants(self.order).root * width_m / self.length_m

        def inside(values: Any, factor: Any = 1.0) -> Any:
            """Return the values of a window's end less those of its start."""
            return values[..., stop] - begun * factor * values[..., start]

        wave = inside(self.size_m * np.exp(-1j * self.lag), cmath.exp(-1j * angle))
        fades = np.exp([[angle], [-angle]])
        return replace(
            self,
            inner_m=inner_m,
            slope=inside(self.slope),
            offset_m=inside(self.offset_m) + begun * width_m * self.slope[start],
            size_m=np.abs(wave),
            lag=-np.angle(wave),
            rest_m=inside(self.rest_m),
            near_m=None if self.near_m is None else inside(self.near_m, fades),
        )


@lru_cache(maxsize=256)
def mode_sums(order: int, length_m: float) -> ModeSums:
    """Return the sums of one mode on a beam of one length, rounded once each."""
    here, c = zones(order, length_m), mode_constants(order)
    edges = [Fraction(float(edge)) for edge in here.edges_m]
    zone = np.arange(len(edges) - 1)
    right_offset_m, before = [], Fraction(0)
    for k, (start, stop) in enumerate(pairwise(edges)):
        right_offset_m.append(float(before - start * (k % 2)))
        before += (stop - start) * (k % 2)
    lobe_sign = np.where(np.arange(order) % 2, -1.0, 1.0)
    steps = 2 * lobe_sign[:-1] * mode_integral(order, here.nodes_m / length_m)
    lobe_offset = np.concatenate([[0.0], np.cumsum(steps)])
    # (9), mathematics/beam
    unit_m = lobe_sign[zone // 2] * (length_m / c.root)
    tip = c.tip_weight * (math.exp(-c.root) if order <= LOW_ORDER else 1.0)
    return ModeSums(
        order=order,
        length_m=length_m,
        inner_m=here.edges_m[1:-1],
        slope=(zone % 2).astype(np.float64),
        offset_m=np.array(right_offset_m),
        size_m=c.amplitude * unit_m,
        lag=np.full(zone.size, c.lag + 0.5 * math.pi),
        rest_m=2.0 * c.sigma * unit_m + length_m * lobe_offset[zone // 2],
        near_m=np.stack([-c.clamp_weight * unit_m, tip * unit_m]),
    )


# Narrow windows, where the difference of an antiderivative would lose digits.


def _settle_narrow(
    here: Zones, end_m: FloatArray, width_m: FloatArray, right: FloatArray, mean: FloatArray
) -> None:
    """Set parts and means of windows too narrow for a difference; at the clamp all moves left."""
    narrow = (width_m < _NARROW * here.length_m / mode_constants(here.order).root).nonzero()[0]
    if not narrow.size:
        return
    ends = end_m.take(narrow)
    clamped = ends == width_m.take(narrow)
    if clamped.all():
        mean[narrow] = _clamp_mean(here.order, ends / here.length_m)
        return
    mean[narrow[clamped]] = _clamp_mean(here.order, ends[clamped] / here.length_m)
    rest = narrow[~clamped]
    right[rest] = _narrow_right(here, end_m[rest], width_m[rest])
    mean[rest] = _narrow_mean(here, end_m[rest], width_m[rest])


def _narrow_right(here: Zones, end_m: FloatArray, width_m: FloatArray) -> FloatArray:
    """Return the right-moving part of windows that contain at most one zone edge."""
    edges = here.edges_m[1:-1]
    if not edges.size:
        return np.zeros_like(end_m)
    nearest = np.searchsorted((edges[1:] + edges[:-1]) / 2, end_m - width_m / 2)
    beyond = end_m - edges[nearest]
    width = np.where(width_m > 0, width_m, 1.0)
    after = np.clip(beyond / width, 0.0, 1.0)
    return np.where(nearest % 2, 1.0 - after, after)


def _narrow_mean(here: Zones, end_m: FloatArray, width_m: FloatArray) -> FloatArray:
    """Return the mean of |φ| over [end - width, end], each (n,), for windows of at most ½ in bξ."""
    middle = mode_constants(here.order).root * (end_m - width_m / 2) / here.length_m
    clamped = (middle < _CLAMP_REACH) | (here.order == 1)
    if clamped.all():
        return _near_clamp(here, end_m, width_m)
    mean = np.empty_like(end_m)
    mean[clamped] = _near_clamp(here, end_m[clamped], width_m[clamped])
    free = ~clamped
    mean[free] = _near_node(here, end_m[free], width_m[free])
    return mean


@lru_cache(maxsize=256)
def _clamp_series(order: int) -> FloatArray:
    """Return the weights of ξ, ξ² … in the mean of |φ| over [0, ξ]; (19) of mathematics/beam.

    2t²[1/3! - σt/4! + t⁴(1/7! - σt/8! + t⁴(1/11! - …))], t = bξ.
    """
    c = mode_constants(order)
    weights = np.zeros(14)
    for power in (2, 6, 10, 14):
        weights[power - 1] = 2.0 / math.factorial(power + 1)
    for power in (3, 7, 11):
        weights[power - 1] = -2.0 * c.sigma / math.factorial(power + 1)
    return weights * c.root ** np.arange(1, 15)


def _clamp_mean(order: int, xi: FloatArray) -> FloatArray:
    """Return the mean of |φ| over [0, ξ] for ends of at most ½ in bξ; it is 0 at the clamp."""
    weights = _clamp_series(order)
    return np.asarray(weights @ np.multiply.accumulate(xi + np.zeros((weights.size, 1))))


def _near_clamp(here: Zones, end_m: FloatArray, width_m: FloatArray) -> FloatArray:
    """Return the mean over windows with their middle near the clamp, where φ keeps its sign."""
    c = mode_constants(here.order)
    scale = c.root / here.length_m
    middle = scale * (end_m - width_m / 2)
    double_sine = np.sinh(middle / 2) ** 2 + np.sin(middle / 2) ** 2
    shape = 2 * double_sine - c.sigma * _sinh_minus_sin(middle)
    swing = np.cos(middle) - c.sigma * np.sin(middle)
    return _piece_mean(scale * width_m / 2, shape, swing)


def _near_node(here: Zones, end_m: FloatArray, width_m: FloatArray) -> FloatArray:
    """Return the mean over windows near an inner node, which may lie inside the window."""
    nodes = here.nodes_m
    nearest = np.searchsorted((nodes[1:] + nodes[:-1]) / 2, end_m - width_m / 2)
    scale = mode_constants(here.order).root / here.length_m
    remainder = node_remainders_m(here.order, here.length_m)[nearest]
    stop = scale * ((end_m - nodes[nearest]) - remainder)
    width = scale * width_m
    after = np.clip(stop, 0.0, width)  # the part of the window beyond the node
    before = np.where(stop < width, width - after, 0.0)
    index = np.asarray(nearest + 1.0)
    inner_stop, inner_start = np.minimum(stop, 0.0), np.maximum(stop - width, 0.0)
    total = _about_node(here, index, inner_stop - before / 2, before)
    total += _about_node(here, index, inner_start + after / 2, after)
    return total / width


def _about_node(
    here: Zones, index: FloatArray, middle: FloatArray, width: FloatArray
) -> FloatArray:
    """Return |∫φ d(bξ)| over a piece about `middle`, in bξ from node `index` (1 …)."""
    c = mode_constants(here.order)
    shift = np.asarray(here.node_shifts)[index.astype(np.intp) - 1]
    angle = (index + 0.25) * math.pi + shift
    from_tip = (here.order - 0.75 - index) * math.pi + c.root_offset - shift
    clamp, tip = c.clamp_weight * np.exp(-angle), c.tip_weight * np.exp(-from_tip)
    fold = np.where(index % 2, -1.0, 1.0) / math.sqrt(2.0)
    sine_part = fold * ((1 + c.sigma) * np.cos(shift) + c.one_minus_sigma * np.sin(shift))
    shape = clamp * np.expm1(-middle) + tip * np.expm1(middle) + sine_part * np.sin(middle)
    shape += 2 * (clamp + tip) * np.sin(middle / 2) ** 2
    swing = (clamp + tip) * np.cos(middle) - sine_part * np.sin(middle)
    return np.abs(_piece_mean(width / 2, shape, swing)) * width


def _piece_mean(half: FloatArray, shape: FloatArray, swing: FloatArray) -> FloatArray:
    """Return the mean of φ over a piece from φ and cos - σ sin at its middle; series for h ≤ ¼."""
    # (18), mathematics/beam
    square = half * half
    grown = 1 + square / 6 * (1 + square / 20 * (1 + square / 42 * (1 + square / 72)))
    fourth = square * square
    return grown * shape + square / 3 * (1 + fourth / 840 * (1 + fourth / 7920)) * swing


def _sinh_minus_sin(angle: FloatArray) -> FloatArray:
    """Return sinh - sin by its series 2(t³/3! + t⁷/7! + …), exact to rounding for |t| ≤ 2."""
    square = angle * angle
    fourth = square * square
    total = _SERIES[0] * fourth
    for coefficient in _SERIES[1:-1]:
        total += coefficient
        total *= fourth
    total += _SERIES[-1]
    return total * (square * angle)
