"""Nodes of a mode shape to 30 digits, for windows so narrow that double precision misses them.

A window of 1 nm beside a node sees φ grow from the node, so the node must be known to a small
part of 1 nm times the accuracy wanted: far below the spacing of double precision. One Newton step
in decimal arithmetic from the double-precision node is enough, as Newton's method doubles digits.
"""

from decimal import Context, Decimal, localcontext
from functools import lru_cache

from device.mode_shapes import mode_constants

_PRECISION = Context(prec=44)
_PI = Decimal("3.14159265358979323846264338327950288419716939937510582097")


def _sine_and_cosine(angle: Decimal) -> tuple[Decimal, Decimal]:
    """Sine and cosine of a small angle by their series."""
    sine = cosine = Decimal(0)
    term, index = Decimal(1), 0
    while abs(term) > Decimal("1e-44"):
        cosine += term
        term *= angle / (index + 1)
        sine += term
        term *= -angle / (index + 2)
        index += 2
    return sine, cosine


@lru_cache(maxsize=512)
def _root_offset(order: int) -> Decimal:
    """δ of b = (i-½)π + δ: two Newton steps on s sin δ - sech b."""
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
    """One Newton step for the node at bξ = (index + ¼)π + shift."""
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
    residual = weight * sine - 2 * tip * decay * cosine + fold * (near_clamp + near_tip)
    slope = weight * cosine + 2 * tip * decay * sine + fold * (near_tip - near_clamp)
    return shift - residual / slope


@lru_cache(maxsize=256)
def exact_nodes(order: int, shifts: tuple[float, ...]) -> tuple[Decimal, ...]:
    """The interior nodes of mode `order` as fractions of the length, to 30 digits.

    Args:
        order: the mode's number.
        shifts: for the k-th node (k = 1 …), bξ - (k + ¼)π in double precision.
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
