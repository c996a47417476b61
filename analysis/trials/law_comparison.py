"""Friction laws compared: the evidence of the sensitivity model, and the order of conditions."""

import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.special import stdtr, stdtrit

from analysis.estimates import LEVEL, UPPER, FloatArray, NotEstimable
from analysis.statistics.signed_rank import DECIMALS, doubled_midranks


def against_best(
    evidence: Mapping[str, float | NotEstimable],
) -> dict[str, float | NotEstimable]:
    """Return the ln Bayes factor of each law against the one with the highest evidence.

    >>> against_best({"printed": -45.5, "consistent": -43.0})
    {'printed': -2.5, 'consistent': 0.0}
    """
    estimated = [value for value in evidence.values() if not isinstance(value, NotEstimable)]
    return {
        law: value if isinstance(value, NotEstimable) else value - max(estimated)
        for law, value in evidence.items()
    }


@dataclass(frozen=True, kw_only=True)
class LawScore:
    """A law against the ratings; `predicted` has its mean contrast by condition.

    The paper's own ranking has ranks in place of contrasts, and no evidence.
    """

    law: str
    predicted: Mapping[str, float]
    order: "LawOrder | NotEstimable"
    log_evidence: float | NotEstimable
    ln_bayes_factor: float | NotEstimable


# A law's order of the conditions against that of the mean ratings.

# Eleven conditions take a tenth of a second, and each further one more than twice as long.
MOST_COUNTED = 11


@dataclass(frozen=True, kw_only=True)
class LawOrder:
    """How a law's predicted contrasts order the conditions, against the people's mean ratings.

    `tied` has the conditions from the strongest predicted contrast to the weakest, those of equal
    contrast together. `p` is two-sided over all orders of the conditions (t approximation beyond
    eleven conditions). `rated` counts the conditions with a mean rating, which alone are compared.
    """

    tied: tuple[tuple[str, ...], ...]
    spearman: float | NotEstimable
    p: float | NotEstimable
    rated: int

    @property
    def order(self) -> tuple[str, ...]:
        """The conditions from the strongest predicted contrast to the weakest."""
        return tuple(name for group in self.tied for name in group)


def law_order(
    conditions: tuple[str, ...], predicted: FloatArray, observed: FloatArray
) -> LawOrder | NotEstimable:
    """Return Spearman's correlation of predicted contrasts and mean ratings over conditions.

    `predicted` and `observed` have shape (conditions,); a mean rating that is NaN leaves its
    condition out.

    Raises:
        ValueError: another number of contrasts or ratings than of conditions.

    >>> law = law_order(("a", "b", "c"), np.array([0.1, 0.3, 0.2]), np.array([5.0, 9.0, 6.0]))
    >>> law.order, law.spearman
    (('b', 'c', 'a'), 1.0)
    """
    for values in (predicted, observed):
        if values.shape != (len(conditions),):
            raise ValueError(f"{len(conditions)} conditions need as many values, got {values.size}")
    scored = ~np.isnan(observed)
    if scored.sum() < 3:
        return NotEstimable(
            "an order needs at least 3 conditions with a score and a predicted contrast, got "
            f"{int(scored.sum())}"
        )
    # Doubled, ranks are whole numbers even with ties, so that equal sums are equal exactly.
    ranks = doubled_midranks(np.stack([predicted[scored], observed[scored]]))
    deviations = ranks - ranks.mean(axis=1, keepdims=True)
    tied, rated = _by_strength(conditions, predicted), int(scored.sum())
    squares = (deviations**2).sum(axis=1)
    if not squares.all():
        flat = NotEstimable("all contrasts, or all mean ratings, are equal")
        return LawOrder(tied=tied, spearman=flat, p=flat, rated=rated)
    return LawOrder(
        tied=tied,
        spearman=float((deviations[0] @ deviations[1]) / np.sqrt(squares.prod())),
        p=_p_over_orders(deviations),
        rated=rated,
    )


def _by_strength(conditions: tuple[str, ...], predicted: FloatArray) -> tuple[tuple[str, ...], ...]:
    """Return the conditions from the strongest contrast to the weakest, equal ones together."""
    rounded = np.round(predicted, DECIMALS)
    return tuple(
        tuple(name for name, value in zip(conditions, rounded, strict=True) if value == contrast)
        for contrast in np.unique(rounded)[::-1]
    )


@cache
def critical_rank_correlation(conditions: int) -> float | NotEstimable:
    """Return the least rank correlation without ties that has p < .05, two-sided.

    Over all orders up to eleven conditions, by the t approximation beyond.

    >>> critical_rank_correlation(5)
    1.0
    """
    if conditions > MOST_COUNTED:
        t = float(stdtrit(conditions - 2, UPPER))
        return t / math.sqrt(conditions - 2 + t**2)
    ranks = 2.0 * np.arange(conditions) - (conditions - 1)
    orders, shares = _shares_by_product(np.stack([ranks, ranks]))
    rare = np.flatnonzero((orders > 0) & (shares < LEVEL))
    if not rare.size:
        return NotEstimable(f"no order of these {conditions} conditions has p < .05")
    return float(rare[0] / (ranks @ ranks))


def _p_over_orders(deviations: FloatArray) -> float:
    """Return the share of orders that correlate at least as strongly, either way.

    `deviations` has shape (2, conditions): doubled ranks about their mean.
    """
    count = deviations.shape[1]
    observed = abs(float(deviations[0] @ deviations[1]))
    if count <= MOST_COUNTED:
        return float(_shares_by_product(deviations)[1][round(observed)])
    largest = float(np.sqrt((deviations**2).sum(axis=1).prod()))
    r = min(observed / largest, 1 - 1e-12)  # t of a perfect order would be infinite
    t = r * np.sqrt((count - 2) / (1 - r**2))
    # No share is smaller than that of the observed order alone, its ties exchanged, and reversed.
    ties = np.unique(deviations[1], return_counts=True)[1].tolist()
    mirrored = any(np.array_equal(np.sort(ranks), np.sort(-ranks)) for ranks in deviations)
    least = (1 + mirrored) * math.prod(map(math.factorial, ties)) / math.factorial(count)
    return max(least, float(2 * stdtr(count - 2, -t)))


def _shares_by_product(deviations: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how many orders have each size of the product, and the share with at least that."""
    orders = _orders_by_product(*deviations.astype(int).tolist())
    return orders, np.cumsum(orders[::-1])[::-1] / orders.sum()


def _orders_by_product(first: list[int], second: list[int]) -> FloatArray:
    """Return how many orders of `second` have each size of the product with `first`, from 0 up.

    (9) of mathematics/rank-tests: the orders are counted by the set of the places that are taken.
    """
    reach = sum(a * b for a, b in zip(*(sorted(map(abs, x)) for x in (first, second)), strict=True))
    counts = {0: np.eye(1, 2 * reach + 1, reach)[0]}
    for one in first:
        longer = defaultdict[int, FloatArray](lambda: np.zeros(2 * reach + 1))
        for taken, orders in counts.items():
            for place, other in enumerate(second):
                if not taken >> place & 1:
                    longer[taken | 1 << place] += np.roll(orders, one * other)
        counts = longer
    (orders,) = counts.values()
    orders[reach + 1 :] += orders[:reach][::-1]
    return np.asarray(orders[reach:])
