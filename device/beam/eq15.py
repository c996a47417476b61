"""Eq 15 of the paper as printed: a/u, piecewise linear in the finger's place.

With the printed λ = 0.0348 m the pieces of one γ span 0.0200 m while the next γ begins after
λ/2 = 0.0174 m, so neighbours overlap: `first` uses the lower γ there, `last` the higher. At
0.0318 m and 0.0418 m (γ = 0) the printed pieces do not meet.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple, get_args

import numpy as np

from device.arrays import FloatArray, IndexArray
from device.beam.beam import Beam
from device.beam.pattern import Window
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


def describes(beam: Beam) -> bool:
    """Return whether Eq 15 is about a beam of this length and these supports."""
    return beam.length_m == REACH_M and beam.supports == ("clamped", "free")


def require_the_papers(beam: Beam) -> None:
    """Raise `OutOfRangeError` for a beam that Eq 15 does not describe."""
    if not describes(beam):
        rule = f"must be {REACH_M} and the beam clamped at its left end alone on the rung eq15"
        raise OutOfRangeError("beam length_m", f"{rule}; take beam", beam.length_m)


@dataclass(frozen=True, kw_only=True)
class Eq15Pattern:
    """Eq 15's a/u; the magnitude of a mode far from both ends, and for the whole beam its zones.

    There φ ≈ √2 sin(bξ - π/4), with zones of λ/4 from 3λ/8 on, λ = 2πL/b; before that everything
    moves left.
    """

    mode: int
    length_m: float
    overlap: Overlap = "first"

    @property
    def _unit_m(self) -> float:
        """L/b."""
        return self.length_m / _root(self.mode)

    def _magnitude_m(self, x_m: FloatArray) -> FloatArray:
        """Return ∫|φ|dx from the clamp; (37) of mathematics/beam."""
        angle = x_m / self._unit_m - math.pi / 4
        lobes = np.floor(angle / math.pi)
        sums = 2 * lobes + 1 - np.cos(angle - lobes * math.pi)
        return np.asarray(math.sqrt(2.0) * self._unit_m * (sums + 1 - math.sqrt(0.5)))

    def window(self, x_m: FloatArray, contact_m: FloatArray | float) -> Window:
        """See `Pattern`; a/u divides by the whole contact at the clamp too, as printed."""
        ratio = same_direction_ratio(x_m, contact_m, self.overlap)
        width_m = np.minimum(x_m, contact_m)
        start, stop = self._magnitude_m(x_m - width_m), self._magnitude_m(x_m)
        mean = (stop - start) / np.where(width_m > 0, width_m, 1.0)
        mean = np.where(width_m > 0, mean, 1.0)  # √2 sin(-π/4) at the clamp
        return Window(right=ratio, left=1.0 - ratio, mean=mean)

    def chosen(self, motion: IndexArray) -> "Eq15Pattern":  # noqa: ARG002 - all are alike
        """See `Pattern`."""
        return self

    def whole(self) -> Window:
        """See `Pattern`."""
        quarter_m = math.pi / 2 * self._unit_m
        zones, rest = divmod(self.length_m / quarter_m - 1.5, 1.0)
        right_m = quarter_m * (zones // 2 + (zones % 2 == 0) * rest + (zones % 2 == 1))
        right = np.array([right_m / self.length_m])
        mean = self._magnitude_m(np.array([self.length_m])) / self.length_m
        return Window(right=right, left=1.0 - right, mean=mean)


@lru_cache(maxsize=64)
def _root(mode: int) -> float:
    """Return b of cos b cosh b = -1 by Newton's method, from (i - ½)π."""
    b = (mode - 0.5) * math.pi
    for _ in range(20):
        b -= (math.cos(b) + 1 / math.cosh(b)) / (-math.sin(b) - math.tanh(b) / math.cosh(b))
    return b
