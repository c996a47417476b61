"""Mean of |φ| over a window much narrower than a half wave, without cancellation.

Differences of an antiderivative lose all digits of a narrow window. About a window's middle m and
with half its width h, both in bξ, the integral is a product instead:

    mean φ = [sinh(h) φ(m) + (sinh h - sin h) (cos bξ - σ sin bξ)(m)] / h

It needs φ(m) to a small *relative* error, so φ is written about the nearest node, or about the
clamp, where its terms vanish one by one.
"""

import math

import numpy as np

from device.mode_shapes import FloatArray, mode_constants
from device.zones import Zones, node_remainders_m

_CLAMP_REACH = 2.0  # in bξ: below it the textbook form is accurate, above it a node is near


_SERIES = tuple(2.0 / math.factorial(power) for power in (23, 19, 15, 11, 7, 3))


def _sinh_minus_sin(angle: FloatArray) -> FloatArray:
    """Sinh - sin by its series 2(t³/3! + t⁷/7! + …), to rounding for |t| ≤ 2."""
    square = angle * angle
    fourth = square * square
    total = _SERIES[0] * fourth
    for coefficient in _SERIES[1:-1]:
        total += coefficient
        total *= fourth
    total += _SERIES[-1]
    return total * (square * angle)


def _piece_mean(half: FloatArray, shape: FloatArray, swing: FloatArray) -> FloatArray:
    """The mean of φ over a piece from φ and cos - σ sin at its middle, by series for h ≤ ¼."""
    square = half * half
    grown = 1 + square / 6 * (1 + square / 20 * (1 + square / 42 * (1 + square / 72)))
    fourth = square * square
    return grown * shape + square / 3 * (1 + fourth / 840 * (1 + fourth / 7920)) * swing


def _near_clamp(here: Zones, end_m: FloatArray, width_m: FloatArray) -> FloatArray:
    """The mean over windows whose middle lies near the clamp, where φ does not change sign."""
    c = mode_constants(here.order)
    scale = c.root / here.length_m
    middle = scale * (end_m - width_m / 2)
    double_sine = np.sinh(middle / 2) ** 2 + np.sin(middle / 2) ** 2
    shape = 2 * double_sine - c.sigma * _sinh_minus_sin(middle)
    swing = np.cos(middle) - c.sigma * np.sin(middle)
    return _piece_mean(scale * width_m / 2, shape, swing)


def clamp_window_mean(here: Zones, end_m: FloatArray) -> FloatArray:
    """Mean of |φ| over [0, end], dimensionless, for ends of at most ½ in bξ; 0 at the clamp.

    (2/t)[t³/3! + t⁷/7! + … - σ(t⁴/4! + t⁸/8! + …)] with t = b·end/L.
    """
    c = mode_constants(here.order)
    t = end_m * (c.root / here.length_m)
    square = t * t
    fourth = square * square
    odd = 1 + fourth / 840 * (1 + fourth / 7920 * (1 + fourth / 32760))
    even = 1 + fourth / 1680 * (1 + fourth / 11880 * (1 + fourth / 43680))
    return square / 3 * (odd - t * (c.sigma / 4) * even)


def _about_node(
    here: Zones, index: FloatArray, middle: FloatArray, width: FloatArray
) -> FloatArray:
    """|∫φ d(bξ)| over a piece about `middle`, both in bξ, `middle` from node `index` (1 …)."""
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


def _near_node(here: Zones, end_m: FloatArray, width_m: FloatArray) -> FloatArray:
    """The mean over windows near an inner node, which may lie inside the window."""
    nodes = here.nodes_m
    nearest = np.searchsorted((nodes[1:] + nodes[:-1]) / 2, end_m - width_m / 2)
    scale = mode_constants(here.order).root / here.length_m
    remainder = node_remainders_m(here.order, here.length_m)[nearest]
    stop = scale * ((end_m - nodes[nearest]) - remainder)
    width = scale * width_m
    after = np.clip(stop, 0.0, width)  # what of the window lies beyond the node
    before = np.where(stop < width, width - after, 0.0)
    index = np.asarray(nearest + 1.0)
    inner_stop, inner_start = np.minimum(stop, 0.0), np.maximum(stop - width, 0.0)
    total = _about_node(here, index, inner_stop - before / 2, before)
    total += _about_node(here, index, inner_start + after / 2, after)
    return total / width


def narrow_window_mean(here: Zones, end_m: FloatArray, width_m: FloatArray) -> FloatArray:
    """Mean of |φ| over [end - width, end], dimensionless, for windows of at most ½ in bξ.

    Args:
        here: the mode's zones on its beam.
        end_m: right ends of the windows, shape (n,), in [0, L]; x = 0 gives φ's limit there, 0.
        width_m: widths, shape (n,), at most `end_m`.
    """
    middle = mode_constants(here.order).root * (end_m - width_m / 2) / here.length_m
    clamped = (middle < _CLAMP_REACH) | (here.order == 1)
    if clamped.all():
        return _near_clamp(here, end_m, width_m)
    mean = np.empty_like(end_m)
    mean[clamped] = _near_clamp(here, end_m[clamped], width_m[clamped])
    free = ~clamped
    mean[free] = _near_node(here, end_m[free], width_m[free])
    return mean
