"""Zones of a mode shape, in which ciliary bodies move right or left (paper, Eq 1).

Bodies move right where φφ' < 0 and left where φφ' > 0, so a zone ends at every antinode **and** at
every node. From the clamp the zones are left, right, left, …: the shape first grows.
"""

import math
from dataclasses import dataclass
from decimal import Context, Decimal, localcontext
from fractions import Fraction
from functools import lru_cache

import numpy as np

from device.beam.modes import FloatArray, mode_constants


@dataclass(frozen=True, kw_only=True, eq=False)
class Zones:
    """The zones of one mode on a beam of one length; neighbours alternate left, right from 0.

    `edges_m` contains 0, the inner edges (antinode, node, antinode, …) and the length.
    """

    order: int
    length_m: float
    edges_m: FloatArray
    node_shifts: tuple[float, ...]

    @property
    def nodes_m(self) -> FloatArray:
        return self.edges_m[2:-1:2]


@lru_cache(maxsize=256)
def zones(order: int, length_m: float) -> Zones:
    """Return the zones of mode `order` on a beam of `length_m`; edges are correct to about 1 ulp.

    >>> [round(1e3 * float(edge), 1) for edge in zones(6, 0.1).edges_m[1:-1:2]]
    [13.2, 31.8, 50.0, 68.2, 86.0]
    """
    node_shifts = _shifts(order, 1)
    inner = sorted(_places(order, 1, node_shifts) + _places(order, -1, _shifts(order, -1)))
    length = Fraction(length_m)
    edges_m = np.array([0.0, *(float(place * length) for place in inner), length_m])
    edges_m.setflags(write=False)
    return Zones(
        order=order,
        length_m=length_m,
        edges_m=edges_m,
        node_shifts=tuple(float(shift) for shift in node_shifts),
    )


def _shifts(order: int, sign: int) -> FloatArray:
    """Return the shifts, in bξ, of nodes (sign 1) or antinodes (-1) from a pure sine's, by Newton.

    Those of the pure sine are at (k ± ¼)π, k = 1 … i-1. The equation is in the shift alone, so its
    rounding is relative to the shift and not to bξ.
    """
    c = mode_constants(order)
    k = np.arange(1, order)
    fold = math.sqrt(2.0) * np.where(k % 2, -1.0, 1.0)
    angle = (k + sign * 0.25) * math.pi
    from_tip = (order - 0.5 - k - sign * 0.25) * math.pi + c.root_offset
    shift = np.zeros(order - 1)
    for _ in range(12):
        clamp = sign * c.clamp_weight * np.exp(-angle - shift)
        tip = c.tip_weight * np.exp(shift - from_tip)
        sine, cosine = np.sin(shift), np.cos(shift)
        # (15) and (16), mathematics/beam
        residual = (1 + c.sigma) * sine - c.one_minus_sigma * cosine + fold * (clamp + tip)
        slope = (1 + c.sigma) * cosine + c.one_minus_sigma * sine + fold * (tip - clamp)
        shift -= residual / slope
    return shift


def _places(order: int, sign: int, shifts: FloatArray) -> list[Fraction]:
    """Return the places (k ± ¼ + shift/π) / (i - ½ + δ/π) as exact ratios, to be rounded once."""
    root = Fraction(2 * order - 1, 2) + Fraction(mode_constants(order).root_offset / math.pi)
    return [
        (Fraction(4 * k + sign, 4) + Fraction(float(shift) / math.pi)) / root
        for k, shift in enumerate(shifts, start=1)
    ]


# Nodes to 30 digits: a window of a nanometre about a node is sensitive to the last bit of a double.

_PRECISION = Context(prec=44)
_PI = Decimal("3.14159265358979323846264338327950288419716939937510582097")


@lru_cache(maxsize=256)
def node_remainders_m(order: int, length_m: float) -> FloatArray:
    """Return the error of each node's double-precision place: the true place minus it, m."""
    here = zones(order, length_m)
    length = Decimal(length_m)
    return np.array(
        [
            float(node * length - Decimal(float(edge)))
            for node, edge in zip(_exact_nodes(order, here.node_shifts), here.nodes_m, strict=True)
        ]
    )


@lru_cache(maxsize=256)
def _exact_nodes(order: int, shifts: tuple[float, ...]) -> tuple[Decimal, ...]:
    """Return the interior nodes of mode `order` as fractions of the length, to 30 digits.

    The k-th of `shifts` (k = 1 …) is bξ - (k + ¼)π in double precision.
    """
    with localcontext(_PRECISION):
        offset = _root_offset(order)
        root = (Decimal(order) - Decimal("0.5")) * _PI + offset
        return tuple(
            (
                (Decimal(k) + Decimal("0.25")) * _PI
                + _node_step(order, k, offset, Decimal(float(shift)))
            )
            / root
            for k, shift in enumerate(shifts, start=1)
        )


@lru_cache(maxsize=512)
def _root_offset(order: int) -> Decimal:
    """Return δ of b = (i-½)π + δ: two Newton steps on s sin δ - sech b."""
    sign = 1 if order % 2 else -1
    offset = Decimal(mode_constants(order).root_offset)
    for _ in range(2):
        decay = (-(Decimal(order) - Decimal("0.5")) * _PI - offset).exp()
        sech = 2 * decay / (1 + decay * decay)
        sine, cosine = _sine_and_cosine(offset)
        slope = sign * cosine + sech * (1 - decay * decay) / (1 + decay * decay)
        offset -= (sign * sine - sech) / slope
    return offset


def _node_step(order: int, index: int, offset: Decimal, shift: Decimal) -> Decimal:
    """Return one Newton step for the node at bξ = (index + ¼)π + shift."""
    root = (Decimal(order) - Decimal("0.5")) * _PI + offset
    decay, sign = (-root).exp(), 1 if order % 2 else -1
    tanh = (1 - decay * decay) / (1 + decay * decay)
    tip = (sign * tanh + 2 * decay / (1 + decay * decay) - decay) / (
        (1 - decay * decay) + 2 * decay * sign * tanh
    )
    angle = (Decimal(index) + Decimal("0.25")) * _PI + shift
    near_clamp = (1 - tip * decay) * (-angle).exp()
    near_tip = tip * (angle - root).exp()
    sine, cosine = _sine_and_cosine(shift)
    fold = Decimal(2).sqrt() * (-1 if index % 2 else 1)
    weight = 2 - 2 * tip * decay
    # (15) and (16), mathematics/beam
    residual = weight * sine - 2 * tip * decay * cosine + fold * (near_clamp + near_tip)
    slope = weight * cosine + 2 * tip * decay * sine + fold * (near_tip - near_clamp)
    return shift - residual / slope


def _sine_and_cosine(angle: Decimal) -> tuple[Decimal, Decimal]:
    """Return sine and cosine of a small angle by their series."""
    sine = cosine = Decimal(0)
    term, index = Decimal(1), 0
    while abs(term) > Decimal("1e-44"):
        cosine += term
        term *= angle / (index + 1)
        sine += term
        term *= -angle / (index + 2)
        index += 2
    return sine, cosine
