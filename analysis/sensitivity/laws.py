"""Each friction law against the ratings: does it order the conditions, does it know people?"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from itertools import permutations

import numpy as np
from scipy.optimize import minimize
from scipy.special import stdtr, stdtrit

from analysis.no_answer import NoAnswer
from analysis.scores import FloatArray
from analysis.sensitivity.law_assignments import assignment_p
from analysis.sensitivity.linear_likelihood import LineSums, line_posterior, line_sums
from analysis.sensitivity.lines import axes_of, covariance_matrices
from analysis.sensitivity.ratings import Ratings
from analysis.statistics.ranks import DECIMALS, doubled_midranks

MOST_ENUMERATED = 8
# Logarithms of standard deviations, in those of the ratings, between which the best is sought.
FARTHEST = 8.0


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
    spearman: float | NoAnswer
    p: float | NoAnswer
    rank_needed: float | NoAnswer
    needed: float | NoAnswer
    rated: int

    @property
    def order(self) -> tuple[str, ...]:
        """The conditions from the strongest predicted contrast to the weakest."""
        return tuple(name for group in self.tied for name in group)


@dataclass(frozen=True, kw_only=True)
class LawLikelihood:
    """How well a law explains who felt what, all laws given the same freedom.

    `log_likelihood` is the largest of M1 with the law's contrasts; `gain_over_none` is by how
    much it exceeds that of subjects who differ in level alone, not penalised for the law's three
    parameters more. `gain_p` is the share of all assignments of the contrasts to the conditions
    that gain as much, see `assignment_p`.
    """

    log_likelihood: float
    gain_over_none: float
    gain_p: float | NoAnswer


def law_order(
    conditions: tuple[str, ...], predicted: FloatArray, observed: FloatArray
) -> LawOrder | NoAnswer:
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
        return NoAnswer(reason=f"an order needs at least 3 conditions, got {int(scored.sum())}")
    ranks = doubled_midranks(np.stack([predicted[scored], observed[scored]]))
    deviations = ranks - ranks.mean(axis=1, keepdims=True)
    tied = _by_strength(conditions, predicted)
    squares = (deviations**2).sum(axis=1)
    if not squares.all():
        flat = NoAnswer(reason="all contrasts, or all mean ratings, are equal")
        return LawOrder(
            tied=tied,
            spearman=flat,
            p=flat,
            rank_needed=flat,
            needed=flat,
            rated=int(scored.sum()),
        )
    p, rank_needed = _over_all_orders(deviations)
    return LawOrder(
        tied=tied,
        spearman=float((deviations[0] @ deviations[1]) / np.sqrt(squares.prod())),
        p=p,
        rank_needed=rank_needed,
        needed=critical_correlation(int(scored.sum())),
        rated=int(scored.sum()),
    )


def _by_strength(conditions: tuple[str, ...], predicted: FloatArray) -> tuple[tuple[str, ...], ...]:
    """The conditions from the strongest contrast to the weakest, those ranked alike together."""
    rounded = np.round(predicted, DECIMALS)
    return tuple(
        tuple(name for name, value in zip(conditions, rounded, strict=True) if value == contrast)
        for contrast in np.unique(rounded)[::-1]
    )


def critical_correlation(pairs: int) -> float | NoAnswer:
    """Return the product-moment correlation beyond which p < .05, two-sided.

    >>> round(critical_correlation(5), 3)
    0.878
    """
    if pairs < 3:
        return NoAnswer(reason=f"a correlation is tested with at least 3 pairs, got {pairs}")
    t = float(stdtrit(pairs - 2, 0.975))
    return t / float(np.sqrt(pairs - 2 + t**2))


@cache
def critical_rank_correlation(pairs: int) -> float | NoAnswer:
    """Return the least rank correlation without ties that has p < .05, two-sided.

    Over all orders up to eight pairs, by the t approximation beyond.

    >>> critical_rank_correlation(5)
    1.0
    """
    if pairs < 3:
        return NoAnswer(reason=f"a correlation is tested with at least 3 pairs, got {pairs}")
    ranks = np.arange(pairs) - (pairs - 1) / 2
    return _over_all_orders(np.stack([ranks, ranks]))[1]


def law_likelihoods(
    ratings: Ratings, contrasts: Mapping[str, FloatArray]
) -> dict[str, LawLikelihood | NoAnswer]:
    """Return for each law how well its contrasts explain the ratings, by name.

    Parameters:
        ratings: the trials; their own contrasts are not used.
        contrasts: by law, shape (trials,), the contrast it predicts under each participant's own
            settings.

    Raises:
        ValueError: another number of contrasts than of trials.
    """
    scored = ~np.isnan(ratings.rating)
    results: dict[str, LawLikelihood | NoAnswer] = {}
    for law, contrast in contrasts.items():
        if contrast.shape != ratings.rating.shape:
            raise ValueError(f"{law} needs {ratings.rating.size} contrasts, got {contrast.size}")
        results[law] = _law_likelihood(ratings.where(scored), contrast[scored])
    return results


def _law_likelihood(trials: Ratings, contrast: FloatArray) -> LawLikelihood | NoAnswer:
    axes = axes_of(replace(trials, contrast=contrast))
    if isinstance(axes, NoAnswer):
        return axes
    x = (contrast - axes.x_mean) / axes.x_sd
    y = (trials.rating - axes.y_mean) / axes.y_sd
    subjects = len(trials.subjects)
    scale = len(y) * np.log(axes.y_sd)
    with_law = _largest(line_sums(trials.subject, subjects, x, y)) - scale
    without = _largest_level(trials, y) - scale
    return LawLikelihood(
        log_likelihood=float(with_law),
        gain_over_none=float(with_law - without),
        gain_p=assignment_p(trials, contrast),
    )


def _largest(sums: LineSums) -> float:
    """Return the largest log-likelihood of partially pooled lines, population line included."""

    def cost(point: FloatArray) -> float:
        known = line_posterior(sums, np.exp(point[:1]), covariance_matrices(point[None, 1:]))
        return -float(known.profile[0])

    return -_smallest(cost, np.array([-0.5, -0.7, -0.7, 0.0]))


def _largest_level(trials: Ratings, y: FloatArray) -> float:
    """Return the largest log-likelihood of subjects who differ in level alone."""
    counts = np.bincount(trials.subject, minlength=len(trials.subjects)).astype(np.float64)
    sums = np.bincount(trials.subject, weights=y, minlength=len(counts))
    squares = float((y**2).sum())

    def cost(point: FloatArray) -> float:
        noise, level = np.exp(2 * point)
        weight = counts / (noise + counts * level)
        mean = (sums / (noise + counts * level)).sum() / weight.sum()
        within = squares - 2 * mean * sums.sum() + mean**2 * counts.sum()
        shrunk = level / (noise + counts * level) * (sums - counts * mean) ** 2
        log_det = counts.sum() * np.log(noise) + np.log1p(counts * level / noise).sum()
        quadratic = (within - shrunk.sum()) / noise
        return float(log_det + quadratic + counts.sum() * np.log(2 * np.pi)) / 2

    return -_smallest(cost, np.array([-0.5, -0.7]))


def _smallest(cost: Callable[[FloatArray], float], start: FloatArray) -> float:
    bounds = [(-FARTHEST, FARTHEST)] * len(start)
    return min(
        float(minimize(cost, begin, method="L-BFGS-B", bounds=bounds).fun)
        for begin in (start, np.where(start < 0, -3.0, start))
    )


def _over_all_orders(deviations: FloatArray) -> tuple[float, float | NoAnswer]:
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
            return p, NoAnswer(reason=f"no order of these {count} conditions has p < .05")
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
