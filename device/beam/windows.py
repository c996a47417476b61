"""The window under the finger: the part of it that moves right, and the mean of |φ| over it.

The window is `[max(0, x - l_s), x]` with x the finger's right edge (the paper's Eqs 11 and 12 do
not state the clip at the clamp). At x = 0 its width is 0: the limit x → 0+ is used, in which
everything moves left and φ = 0.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise

import numpy as np

from device.beam.modes import FloatArray, mode_constants, mode_integral
from device.beam.zones import Zones, node_remainders_m, zones

_NARROW = 0.5  # width in bξ below which an antiderivative's difference would lose digits
_TINY_M = 1e-300  # stands for a window of no width, which `_settle_narrow` then settles
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


@dataclass(frozen=True, kw_only=True)
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


def mode_window(order: int, length_m: float, end_m: FloatArray, width_m: FloatArray) -> Window:
    """Return the right-moving part and the mean of |φ| for many windows over mode `order`.

    Exact sums from the zone edges and the mode's antiderivative split at its nodes; narrow windows
    take a form without cancellation. `end_m` in [0, L] and `width_m` are of shape (n,).
    """
    sums = _sums(order, length_m)
    places = np.concatenate([end_m - width_m, end_m])
    zone = np.searchsorted(sums.here.edges_m[1:-1], places, side="right")
    right_m = sums.moves_right.take(zone)
    right_m *= places
    right_m += sums.right_offset_m.take(zone)
    integral = mode_integral(order, places / length_m)
    integral *= sums.sign.take(zone)
    integral += sums.offset.take(zone)
    count = end_m.size
    right = right_m[count:] - right_m[:count]
    mean = integral[count:] - integral[:count]
    per_width = 1.0 / np.maximum(width_m, _TINY_M)
    right *= per_width
    per_width *= length_m
    mean *= per_width
    np.maximum(right, 0.0, out=right)
    np.minimum(right, 1.0, out=right)
    _settle_narrow(sums.here, end_m, width_m, right, mean)
    return Window(right=right, left=1.0 - right, mean=mean)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Sums:
    """Zone by zone: "moves right" summed is slope·x + offset, |φ| summed is sign·∫φ + offset."""

    here: Zones
    moves_right: FloatArray
    right_offset_m: FloatArray
    sign: FloatArray
    offset: FloatArray


@lru_cache(maxsize=256)
def _sums(order: int, length_m: float) -> _Sums:
    """Return the running sums of one mode on a beam of one length, rounded once each."""
    here = zones(order, length_m)
    edges = [Fraction(float(edge)) for edge in here.edges_m]
    zone = np.arange(len(edges) - 1)
    right_offset_m, before = [], Fraction(0)
    for k, (start, stop) in enumerate(pairwise(edges)):
        right_offset_m.append(float(before - start * (k % 2)))
        before += (stop - start) * (k % 2)
    lobe_sign = np.where(np.arange(order) % 2, -1.0, 1.0)
    steps = 2 * lobe_sign[:-1] * mode_integral(order, here.nodes_m / length_m)
    lobe_offset = np.concatenate([[0.0], np.cumsum(steps)])
    return _Sums(
        here=here,
        moves_right=(zone % 2).astype(np.float64),
        right_offset_m=np.array(right_offset_m),
        sign=lobe_sign[zone // 2],
        offset=lobe_offset[zone // 2],
    )


# Narrow windows, where the difference of an antiderivative would lose digits.


def _settle_narrow(
    here: Zones, end_m: FloatArray, width_m: FloatArray, right: FloatArray, mean: FloatArray
) -> None:
    """Set parts and means of windows too narrow for a difference; at the clamp all moves left."""
    narrow = np.flatnonzero(width_m < _NARROW * here.length_m / mode_constants(here.order).root)
    if not narrow.size:
        return
    ends = end_m.take(narrow)
    clamped = ends == width_m.take(narrow)
    first = narrow[clamped]
    right[first], mean[first] = 0.0, _clamp_mean(here, ends[clamped])
    if first.size < narrow.size:
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


def _clamp_mean(here: Zones, end_m: FloatArray) -> FloatArray:
    """Return the mean of |φ| over [0, end] for ends of at most ½ in bξ; it is 0 at the clamp.

    (19) of mathematics/beam: 2t²[1/3! - σt/4! + t⁴(1/7! - σt/8! + t⁴(1/11! - …))], t = b·end/L.
    """
    c = mode_constants(here.order)
    t = end_m * (c.root / here.length_m)
    square = t * t
    fourth = square * square
    total = np.asarray(2.0 / math.factorial(15))
    for power in (11, 7, 3):
        total = total * fourth + 2.0 / math.factorial(power)
        total -= t * (2.0 * c.sigma / math.factorial(power + 1))
    return np.asarray(square * total)


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
