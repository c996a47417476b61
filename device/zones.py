"""Zones of a mode shape: where ciliary bodies are moved right, where left (paper, Eq 1).

Bodies move right where φφ' < 0 and left where φφ' > 0, so a zone ends at every antinode **and** at
every node. From the clamp the zones are left, right, left, …: the shape first grows.
"""

import math
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache

import numpy as np

from device.exact_nodes import exact_nodes
from device.mode_shapes import FloatArray, mode_constants


@dataclass(frozen=True, kw_only=True, eq=False)
class Zones:
    """The zones of one mode on a beam of one length; neighbours alternate left, right from 0.

    `edges_m` holds 0, the inner edges (antinode, node, antinode, …) and the length.
    """

    order: int
    length_m: float
    edges_m: FloatArray
    node_shifts: tuple[float, ...]

    @property
    def nodes_m(self) -> FloatArray:
        """The inner nodes."""
        return self.edges_m[2:-1:2]

    @property
    def antinodes_m(self) -> FloatArray:
        """The inner antinodes (the tip is one too)."""
        return self.edges_m[1:-1:2]


def _shifts(order: int, sign: int) -> FloatArray:
    """How far nodes (sign 1) or antinodes (-1) lie, in bξ, from the clean sine's, by Newton.

    The clean sine's are at (k ± ¼)π, k = 1 … i-1. The equation is in the shift alone, so its
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
        residual = (1 + c.sigma) * sine - c.one_minus_sigma * cosine + fold * (clamp + tip)
        slope = (1 + c.sigma) * cosine + c.one_minus_sigma * sine + fold * (tip - clamp)
        shift -= residual / slope
    return shift


def _places(order: int, sign: int, shifts: FloatArray) -> list[Fraction]:
    """The places (k ± ¼ + shift/π) / (i - ½ + δ/π) as exact ratios, to be rounded once."""
    root = Fraction(2 * order - 1, 2) + Fraction(mode_constants(order).root_offset / math.pi)
    return [
        (Fraction(4 * k + sign, 4) + Fraction(float(shift) / math.pi)) / root
        for k, shift in enumerate(shifts, start=1)
    ]


@lru_cache(maxsize=256)
def zones(order: int, length_m: float) -> Zones:
    """The zones of mode `order` on a beam of `length_m`; each edge is right to 1 ulp or so.

    >>> [round(1e3 * float(edge), 1) for edge in zones(6, 0.1).antinodes_m]
    [13.6, 31.9, 50.0, 68.2, 86.3]
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


@lru_cache(maxsize=256)
def node_remainders_m(order: int, length_m: float) -> FloatArray:
    """What each node's double-precision place lacks to the true one, in metres."""
    here = zones(order, length_m)
    length = Decimal(length_m)
    return np.array(
        [
            float(node * length - Decimal(float(edge)))
            for node, edge in zip(exact_nodes(order, here.node_shifts), here.nodes_m, strict=True)
        ]
    )
