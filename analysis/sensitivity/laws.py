"""Each friction law against the ratings: does it order the conditions, does it know people?"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import permutations
from math import factorial

import numpy as np
from scipy.optimize import minimize
from scipy.special import stdtr, stdtrit

from analysis.no_answer import NoAnswer
from analysis.scores import FloatArray
from analysis.sensitivity.linear_likelihood import LineSums, line_posterior, line_sums
from analysis.sensitivity.lines import axes_of, covariance_matrices
from analysis.sensitivity.ratings import Ratings
from analysis.statistics.ranks import doubled_midranks

MOST_ENUMERATED = 8
# Logarithms of standard deviations, in those of the ratings, between which the best is sought.
FARTHEST = 8.0


@dataclass(frozen=True, kw_only=True)
class LawOrder:
    """How a law's predicted contrasts order the conditions, against the people's mean ratings.

    `order` has the conditions from the strongest predicted contrast to the weakest. `p` is
    two-sided over all orders of the conditions (t approximation beyond eight conditions).
    `needed` is the correlation that p < .05 would take in a sample of so many normal pairs.
    """

    order: tuple[str, ...]
    spearman: float | NoAnswer
    p: float | NoAnswer
    needed: float | NoAnswer


@dataclass(frozen=True, kw_only=True)
class LawLikelihood:
    """How well a law explains who felt what, all laws given the same freedom.

    `log_likelihood` is the largest of M1 with the law's contrasts; `gain_over_none` is by how
    much it exceeds that of subjects who differ in level alone.
    """

    log_likelihood: float
    gain_over_none: float


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
    strongest = np.argsort(-predicted, kind="stable")
    order = tuple(conditions[place] for place in strongest)
    squares = (deviations**2).sum(axis=1)
    if not squares.all():
        flat = NoAnswer(reason="all contrasts, or all mean ratings, are equal")
        return LawOrder(order=order, spearman=flat, p=flat, needed=flat)
    return LawOrder(
        order=order,
        spearman=float((deviations[0] @ deviations[1]) / np.sqrt(squares.prod())),
        p=_order_p(deviations),
        needed=critical_correlation(int(scored.sum())),
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
    return LawLikelihood(log_likelihood=float(with_law), gain_over_none=float(with_law - without))


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


def _order_p(deviations: FloatArray) -> float:
    """Return the share of all orders that correlate as strongly, either way."""
    count = deviations.shape[1]
    observed = abs(float(deviations[0] @ deviations[1]))
    if count <= MOST_ENUMERATED:
        orders = np.array(list(permutations(range(count))))
        products = np.abs(deviations[1][orders] @ deviations[0])
        return float((products >= observed - 1e-9).sum()) / factorial(count)
    r = observed / float(np.sqrt((deviations**2).sum(axis=1).prod()))
    if r >= 1:
        return 0.0
    t = r * np.sqrt((count - 2) / (1 - r**2))
    return float(2 * stdtr(count - 2, -t))
