"""A law's order of the conditions against that of the mean ratings."""

from dataclasses import dataclass
from functools import cache
from itertools import permutations

import numpy as np
from scipy.special import stdtr, stdtrit

from analysis.estimates import FloatArray, NotEstimable
from analysis.statistics.signed_rank import DECIMALS, doubled_midranks

MOST_ENUMERATED = 8


@dataclass(frozen=True, kw_only=True)
class LawOrder:
    """How a law's predicted contrasts order the conditions, against the people's mean ratings.

    `tied` has the conditions from the strongest predicted contrast to the weakest, those of equal
    contrast together. `p` is two-sided over all orders of the conditions (t approximation beyond
    eight conditions), and `rank_needed` the smallest correlation of these ranks, ties and all,
    that has p < .05.
    `needed` is the product-moment correlation that p < .05 would take in a sample of so many
    normal pairs. `rated` counts the conditions with a mean rating, which alone are compared.
    """

    tied: tuple[tuple[str, ...], ...]
    spearman: float | NotEstimable
    p: float | NotEstimable
    rank_needed: float | NotEstimable
    needed: float | NotEstimable
    rated: int

    @property
    def order(self) -> tuple[str, ...]:
        """The conditions from the strongest predicted contrast to the weakest."""
        return tuple(name for group in self.tied for name in group)


def law_order(
    conditions: tuple[str, ...], predicted: FloatArray, observed: FloatArray
) -> LawOrder | NotEstimable:
    """Return Spearman's correlation of predicted contrasts and mean ratings over conditions.

    Parameters:
        conditions: names.
        predicted: shape (conditions,), predicted contrast of each.
        observed: shape (conditions,), mean rating of each; NaN leaves a condition out.

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
    ranks = doubled_midranks(np.stack([predicted[scored], observed[scored]]))
    deviations = ranks - ranks.mean(axis=1, keepdims=True)
    tied, rated = _by_strength(conditions, predicted), int(scored.sum())
    squares = (deviations**2).sum(axis=1)
    if not squares.all():
        flat = NotEstimable("all contrasts, or all mean ratings, are equal")
        missing = dict.fromkeys(("spearman", "p", "rank_needed", "needed"), flat)
        return LawOrder(tied=tied, rated=rated, **missing)
    p, rank_needed = _over_all_orders(deviations)
    return LawOrder(
        tied=tied,
        spearman=float((deviations[0] @ deviations[1]) / np.sqrt(squares.prod())),
        p=p,
        rank_needed=rank_needed,
        needed=critical_correlation(rated),
        rated=rated,
    )


def _by_strength(conditions: tuple[str, ...], predicted: FloatArray) -> tuple[tuple[str, ...], ...]:
    """The conditions from the strongest contrast to the weakest, those ranked alike together."""
    rounded = np.round(predicted, DECIMALS)
    return tuple(
        tuple(name for name, value in zip(conditions, rounded, strict=True) if value == contrast)
        for contrast in np.unique(rounded)[::-1]
    )


def critical_correlation(pairs: int) -> float | NotEstimable:
    """Return the product-moment correlation beyond which p < .05, two-sided.

    >>> round(critical_correlation(5), 3)
    0.878
    """
    if pairs < 3:
        return NotEstimable(f"a correlation is tested with at least 3 pairs, got {pairs}")
    t = float(stdtrit(pairs - 2, 0.975))
    return t / float(np.sqrt(pairs - 2 + t**2))


@cache
def critical_rank_correlation(pairs: int) -> float | NotEstimable:
    """Return the least rank correlation without ties that has p < .05, two-sided.

    Over all orders up to eight pairs, by the t approximation beyond.

    >>> critical_rank_correlation(5)
    1.0
    """
    if pairs < 3:
        return NotEstimable(f"a correlation is tested with at least 3 pairs, got {pairs}")
    ranks = np.arange(pairs) - (pairs - 1) / 2
    return _over_all_orders(np.stack([ranks, ranks]))[1]


def _over_all_orders(deviations: FloatArray) -> tuple[float, float | NotEstimable]:
    """Return the share of orders that correlate as strongly, either way, and what p < .05 takes.

    Parameters:
        deviations: shape (2, conditions), ranks about their mean.
    """
    count = deviations.shape[1]
    observed = abs(float(deviations[0] @ deviations[1]))
    largest = float(np.sqrt((deviations**2).sum(axis=1).prod()))
    if count <= MOST_ENUMERATED:
        orders = np.array(list(permutations(range(count))))
        products = np.sort(np.abs(deviations[1][orders] @ deviations[0]))
        p = _share_from(products, observed)
        rare = [value for value in np.unique(products) if _share_from(products, value) < 0.05]
        if not rare:
            return p, NotEstimable(f"no order of these {count} conditions has p < .05")
        return p, float(rare[0]) / largest
    needed = critical_correlation(count)
    r = observed / largest
    if r >= 1:
        return 0.0, needed
    t = r * np.sqrt((count - 2) / (1 - r**2))
    return float(2 * stdtr(count - 2, -t)), needed


def _share_from(products: FloatArray, value: float) -> float:
    """Return the share of the sorted products that reach the value."""
    return float(len(products) - np.searchsorted(products, value - 1e-9)) / len(products)
