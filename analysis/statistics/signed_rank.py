"""Wilcoxon's signed rank test, exact with ties and zeros."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np
from scipy.special import ndtr

from analysis.estimates import LEVEL, FloatArray, IntArray, Interval, NotEstimable, ScoreTable
from analysis.statistics.corrections import holm_of
from analysis.statistics.intervals import mean_interval, rank_biserial_interval

# Differences such as 7.3 - 7.2 and 5.1 - 5.0 are equal but for rounding error.
DECIMALS = 9


def doubled_midranks(values: FloatArray) -> IntArray:
    """Return twice the rank of each value along the last axis, ties sharing their mean rank.

    Twice a midrank is an integer. Values that agree to nine decimals are tied; a missing value
    has rank 0 and does not affect the others.

    >>> doubled_midranks(np.array([10.0, 8.0, 10.0, np.nan]))
    array([5, 2, 5, 0])
    """
    # Not scipy's `rankdata`: loading scipy.stats takes longer than a report's statistics.
    rounded = np.round(values, DECIMALS)
    order = np.argsort(rounded, axis=-1)
    in_order = np.take_along_axis(rounded, order, axis=-1)
    places = np.arange(rounded.shape[-1])
    begins = np.where(np.diff(in_order, prepend=np.nan) == 0, 0, places)
    ends = np.where(np.diff(in_order, append=np.nan) == 0, places[-1:], places)
    first = np.maximum.accumulate(begins, axis=-1)
    last = np.minimum.accumulate(ends[..., ::-1], axis=-1)[..., ::-1]
    ranks = np.empty(rounded.shape, dtype=np.int64)
    np.put_along_axis(ranks, order, first + last + 2, axis=-1)
    return np.where(np.isnan(rounded), 0, ranks)


# Up to this many differences, the exact null distribution takes a few milliseconds.
LARGEST_EXACT = 200


@dataclass(frozen=True, kw_only=True)
class SignedRank:
    """Wilcoxon's signed rank test of paired differences, two-sided.

    `statistic` is V, the sum of the ranks of the positive differences; `n` counts the differences
    ranked and `n_zero` those of zero, which are dropped; `rank_biserial` is the effect size, from
    -1 (all negative) to 1 (all positive); `mean_difference` is over all subjects with both scores.
    """

    statistic: float
    n: int
    n_zero: int
    p: float
    method: Literal["exact", "normal"]
    rank_biserial: float
    rank_biserial_interval: Interval
    mean_difference: float
    mean_difference_interval: Interval | NotEstimable


@dataclass(frozen=True, kw_only=True)
class PairwiseTest:
    """The signed rank test of condition `a` minus condition `b`; `p_holm` is over all pairs."""

    a: str
    b: str
    test: SignedRank | NotEstimable
    p_holm: float | NotEstimable

    @property
    def differs(self) -> bool:
        """Whether the conditions differ after Holm's correction, p < .05."""
        return not isinstance(self.p_holm, NotEstimable) and self.p_holm < LEVEL


def signed_rank(differences: FloatArray) -> SignedRank | NotEstimable:
    """Return the signed rank test of the differences, or why it is not possible.

    Zeros are dropped and ties share their mean rank (Wilcoxon, Biometrics Bulletin 1, 1945). Up
    to 200 differences, p counts all 2^n sign patterns; beyond that it is the normal approximation
    with the variance of the tied ranks and no continuity correction.

    Parameters:
        differences: shape (n,), in rating points; NaN for a pair with a missing score.

    >>> signed_rank(np.array([1.0, 2.0, 2.0, 0.0])).p
    0.25
    """
    scored = differences[~np.isnan(differences)]
    if scored.size == 0:
        return NotEstimable("no subject has both scores")
    changed = scored[np.round(scored, DECIMALS) != 0]
    if changed.size == 0:
        return NotEstimable(f"no difference in any subject (zeros: {scored.size})")
    ranks = doubled_midranks(np.abs(changed))
    positive, total = int(ranks[changed > 0].sum()), int(ranks.sum())
    return SignedRank(
        statistic=positive / 2,
        n=len(ranks),
        n_zero=len(scored) - len(ranks),
        p=p_of_ranks(ranks, positive),
        method="exact" if len(ranks) <= LARGEST_EXACT else "normal",
        rank_biserial=(2 * positive - total) / total,
        rank_biserial_interval=rank_biserial_interval((2 * positive - total) / total, len(ranks)),
        mean_difference=float(scored.mean()),
        mean_difference_interval=mean_interval(scored),
    )


def pairwise_signed_ranks(table: ScoreTable) -> tuple[PairwiseTest, ...]:
    """Return the signed rank test of every pair of conditions, with Holm's correction.

    A pair without any non-zero difference has no test, and the correction does not count it: it
    could not be rejected, whatever the signs of its differences.
    """
    pairs = list(combinations(range(len(table.conditions)), 2))
    tests = [signed_rank(table.scores[:, a] - table.scores[:, b]) for a, b in pairs]
    names = table.conditions
    return tuple(
        PairwiseTest(a=names[a], b=names[b], test=test, p_holm=p)
        for (a, b), test, p in zip(pairs, tests, holm_of(tests), strict=True)
    )


def least_holm_p(pairs: Sequence[PairwiseTest]) -> float:
    """Return the smallest p that Holm's correction can leave to any of the pairs; 1 without tests.

    The smallest exact p of n differences is 2 of the 2ⁿ signs; Holm's first step multiplies it by
    the number of tests.
    """
    sizes = [pair.test.n for pair in pairs if isinstance(pair.test, SignedRank)]
    return min(1.0, len(sizes) * 2.0 ** (1 - max(sizes))) if sizes else 1.0


def p_of_ranks(doubled_ranks: IntArray, positive: int) -> float:
    """Return the p of a signed rank test; NaN without ranks.

    It is the share of all sign patterns whose V is at least as far from its middle, or, for more
    than 200 ranks, the normal approximation to it. `doubled_ranks` are twice the midranks of the
    non-zero differences, and `positive` is their sum over the positive ones, 2 V.
    """
    if not len(doubled_ranks):
        return float("nan")
    total = int(doubled_ranks.sum())
    if len(doubled_ranks) > LARGEST_EXACT:
        deviation = abs(positive - total / 2) / (np.sqrt((doubled_ranks**2).sum()) / 2)
        return float(2 * ndtr(-deviation))
    chances = np.zeros(total + 1)
    chances[0] = 1.0
    for rank in doubled_ranks:
        raised = np.zeros_like(chances)
        raised[rank:] = chances[: total + 1 - rank]
        chances = (chances + raised) / 2
    distance = np.abs(2 * np.arange(total + 1) - total)
    return float(min(1.0, chances[distance >= abs(2 * positive - total)].sum()))
