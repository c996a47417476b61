"""95% intervals of effect sizes over subjects, and how often they cover the truth."""

from collections.abc import Mapping
from typing import Final

import numpy as np
from scipy.special import ndtri, stdtrit

from analysis.estimates import UPPER, FloatArray, Interval, NotEstimable

# Correlations of 1 have no Fisher transform.
NEARLY_ONE = 1 - 1e-9

DESIGN: Final = (
    "9 subjects, 5 conditions, whole scores on a scale of 11, subjects' SD 0.7, residual SD "
    "1, condition means from 6 to 8, 10,000 simulated studies"
)
KENDALLS_W: Final = "Kendall's W"
COVERAGE: Final[Mapping[str, float]] = {
    KENDALLS_W: 0.959,
    "rank-biserial r": 0.965,
    "mean difference": 0.949,
}
"""Share of intervals that cover the truth under `DESIGN`, measured by tests/soak."""
NO_WIDTH = 1e-9
"""Half of an interval that only rounding keeps from nothing: it would claim to be certain."""
TOLD_AS_AN_END = 0.005
"""Two digits tell what is as near to 0 or 1 as this as 0 or 1."""


def mean_interval(values: FloatArray) -> Interval | NotEstimable:
    """Return the t interval of the mean.

    >>> mean_interval(np.array([1.0]))
    NotEstimable(reason='an interval needs at least 2 subjects, got 1')
    """
    if values.size < 2:
        return NotEstimable(f"an interval needs at least 2 subjects, got {values.size}")
    half = stdtrit(values.size - 1, UPPER) * values.std(ddof=1) / np.sqrt(values.size)
    if half <= NO_WIDTH:
        return NotEstimable("all subjects agree, which says nothing of how far they spread")
    return float(values.mean() - half), float(values.mean() + half)


def rank_biserial_interval(r: float, n: int) -> Interval:
    """Return the interval of a matched-pairs rank-biserial correlation of n nonzero differences.

    (3) of mathematics/rank-tests: it has the values ρ with (r - ρ)² <= z² (1 - ρ²) v, where
    v = (4n + 2) / (3n(n + 1)) is the variance of r at ρ = 0 (Kerby, Comprehensive Psychology 3,
    2014, for r), as Wilson's interval does for a share. It has a width at r = 1 too.
    """
    spread = float(ndtri(UPPER)) ** 2 * (4 * n + 2) / (3 * n * (n + 1))
    half = float(np.sqrt(spread * (1 + spread - r**2)))
    return max(-1.0, (r - half) / (1 + spread)), min(1.0, (r + half) / (1 + spread))


def concordance_interval(ranks: FloatArray) -> Interval | NotEstimable:
    """Return the interval of Kendall's W, by jackknife over subjects.

    W = (1 + (n - 1) r) / n, where r is the mean rank correlation of two subjects, which does not
    depend on n. t with n - 1 degrees of freedom applies to the Fisher transform of r. Where the
    subjects left after one is left out all rank alike, the transform of 1 has no end, and the
    interval none within 0 to 1; t with 2 degrees of freedom reaches nearly as far. Such an interval
    is not told.

    Parameters:
        ranks: shape (subjects, conditions), about their mean.
    """
    n = len(ranks)
    total, own = ranks.sum(axis=0), (ranks**2).sum(axis=1)
    left = own.sum() - own
    if n < 3 or not (left > 0).all():
        return NotEstimable("an interval needs at least 3 subjects whose scores differ")
    all_r = ((total**2).sum() - own.sum()) / ((n - 1) * own.sum())
    without = (((total - ranks) ** 2).sum(axis=1) - left) / ((n - 2) * left)
    middle = np.arctanh(np.clip(all_r, -NEARLY_ONE, NEARLY_ONE))
    left_out = np.arctanh(np.clip(without, -NEARLY_ONE, NEARLY_ONE))
    half = stdtrit(n - 1, UPPER) * np.sqrt((n - 1) * left_out.var())
    if half <= NO_WIDTH:
        return NotEstimable("without any one subject it is the same, so that no spread is known")
    low, high = (1 + (n - 1) * np.tanh(np.array([middle - half, middle + half]))) / n
    if low < TOLD_AS_AN_END and high > 1 - TOLD_AS_AN_END:
        return NotEstimable(
            "it would reach from 0 to 1, since subjects are few or all but one rank alike"
        )
    return float(max(0.0, low)), float(high)
