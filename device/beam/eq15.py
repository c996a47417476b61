"""Eq 15 of the paper as printed: a/u, piecewise linear in the finger's place.

With the printed λ = 0.0348 m the pieces of one γ span 0.0200 m while the next γ begins after
λ/2 = 0.0174 m, so neighbours overlap: `first` uses the lower γ there, `last` the higher. At
0.0318 m and 0.0418 m (γ = 0) the printed pieces do not meet.
"""

from functools import lru_cache
from typing import Literal, NamedTuple, get_args

import numpy as np

from device.beam.modes import FloatArray
from device.errors import OutOfRangeError, one_of

Overlap = Literal["first", "last"]

WAVELENGTH_M = 0.0348
REACH_M = 0.1
_PERIODS = 6
_ROUNDING = 1e-12
_PERIOD_START_M = 0.0218
_PERIOD_END_M = 0.0418


class _Pieces(NamedTuple):
    """Pieces in force from `start_m`: constant + quarter·λ/4l_s + slope·(x - pivot)/l_s."""

    start_m: FloatArray
    constant: FloatArray
    quarter: FloatArray
    slope: FloatArray
    pivot_m: FloatArray


# (12), mathematics/friction: start, constant, sign of λ/4l_s, slope, pivot for γ = 0, in metres
_OPENING = ((0.0, 0.0, 0.0, 0.0, 0.0), (0.0131, 0.0, 0.0, 1.0, 0.0131))
_PERIODIC = (
    (0.0218, 0.0, 1.0, 0.0, 0.0),
    (0.0231, 0.0, 1.0, -1.0, 0.0231),
    (0.0318, 1.0, -1.0, 0.0, 0.0),
    (0.0331, 1.0, -1.0, 1.0, 0.0331),
)


def _span(gamma: int, overlap: Overlap) -> tuple[float, float]:
    """Return the interval in which the pieces of one γ are in force."""
    shift = WAVELENGTH_M * gamma / 2
    following = WAVELENGTH_M * (gamma + 1) / 2
    if overlap == "last":
        return _PERIOD_START_M + shift, _PERIOD_START_M + following
    previous = WAVELENGTH_M * (gamma - 1) / 2
    start_m = _PERIOD_END_M + previous if gamma else _PERIOD_START_M
    return start_m, _PERIOD_END_M + shift


@lru_cache(maxsize=2)
def _pieces(overlap: Overlap) -> _Pieces:
    """Return Eq 15's pieces in order, with the overlaps resolved."""
    rows = list(_OPENING)
    for gamma in range(_PERIODS):
        low, high = _span(gamma, overlap)
        shift = WAVELENGTH_M * gamma / 2
        ends = [piece[0] + shift for piece in _PERIODIC[1:]] + [_PERIOD_END_M + shift]
        for (start, constant, quarter, slope, pivot), end in zip(_PERIODIC, ends, strict=True):
            if end > low and start + shift < high:
                rows.append((max(start + shift, low), constant, quarter, slope, pivot + shift))
    return _Pieces(*np.array(rows).T)


def same_direction_ratio(
    x_m: FloatArray, contact_m: FloatArray | float, overlap: Overlap = "first"
) -> FloatArray:
    """Return a/u of Eq 15 as printed, for a finger moving right; `overlap` says which γ applies.

    `x_m`, shape (n,), are right edges in [0, 0.1] m, beyond which `OutOfRangeError` is raised;
    `contact_m` is l_s, above 0, and below λ/4 makes the printed ratio exceed 1.

    >>> same_direction_ratio(np.array([0.022]), 0.01)
    array([0.87])
    """
    one_of("eq15_overlap", overlap, get_args(Overlap))
    outside = np.flatnonzero(~((x_m >= 0) & (x_m <= REACH_M)))
    if outside.size:
        row = int(outside[0])
        raise OutOfRangeError("x_m", f"must lie in [0, {REACH_M}] for Eq 15", x_m[row], row)
    pieces = _pieces(overlap)
    piece = np.searchsorted(pieces.start_m[1:], x_m, side="right")
    rise = pieces.slope.take(piece) * (x_m - pieces.pivot_m.take(piece))
    rise += pieces.quarter.take(piece) * (WAVELENGTH_M / 4)
    ratio = pieces.constant.take(piece) + rise / contact_m
    # What leaves [0, 1] by rounding alone, as at the end of a piece, is its bound.
    bounded = np.clip(ratio, 0.0, 1.0)
    return np.where(np.abs(ratio - bounded) < _ROUNDING, bounded, ratio)
