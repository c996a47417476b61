"""How well a law explains who felt what, by the largest likelihood of M1."""

import math
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import permutations

import numpy as np
from scipy.optimize import minimize
from scipy.special import stdtr, stdtrit

from analysis.estimates import LEVEL, UPPER, FloatArray, Interval, NotEstimable
from analysis.sensitivity.linear_model import LineSums, line_sums, without_noise
from analysis.sensitivity.lines import Ratings, axes_of
from analysis.statistics.signed_rank import DECIMALS, doubled_midranks

# A law over conditions: all assignments of its contrasts, and predictions of a condition.

# Six have 720 assignments, each of which is fitted; every further condition multiplies them.
MOST_CONDITIONS = 6
# Of the ratings' variance; a fit is not told from a perfect one below it.
_LEAST = np.exp(-16.0)


@dataclass(frozen=True, kw_only=True)
class PredictionError:
    """Root mean square error over conditions of predicted mean ratings, in points.

    `without` is that of the subjects' levels alone, without any law. `outside_scale` names the
    conditions whose mean prediction lay outside the scale, so far are their contrasts from the
    others'; such predictions count as its end.
    """

    with_law: float
    without: float
    outside_scale: tuple[str, ...]


def assignment_p(trials: Ratings, contrast: FloatArray) -> float | NotEstimable:
    """Return the share of all assignments of the contrasts to conditions that explain as much.

    Where all subjects rated the same conditions at the same contrasts equally often, what explains
    is the largest log-likelihood of M1, as in `law_likelihoods`, which has a closed form. Elsewhere
    (a score is missing, contrasts were measured) it is the sum of squares that a slope common to
    all subjects explains about each subject's mean; a subject's own mean contrasts change places,
    and a condition that the subject did not rate has the mean contrast of the others.

    `trials` are the rated ones; `contrast` (trials,) is what the law predicts.
    """
    cells = _cells(trials, contrast)
    conditions = cells.counts.shape[1]
    if not 3 <= conditions <= MOST_CONDITIONS:
        return NotEstimable(
            f"assignments are listed for 3 to {MOST_CONDITIONS} conditions, got {conditions}"
        )
    # The first permutation leaves all in place: it is the law's own assignment.
    orders = np.array(list(permutations(range(conditions))))
    repeats = int(cells.counts[0, 0])
    if cells.alike and (cells.counts == repeats).all():
        squares = float((trials.rating**2).sum())
        fits = _log_likelihoods(cells.means, cells.contrasts[0][orders], repeats, squares)
    else:
        fits = np.array([_explained(cells, cells.contrasts[:, order]) for order in orders])
    # Assignments that fit equally well differ by rounding; they count as fitting as well.
    return float((fits >= fits[0] - 1e-9 * abs(fits[0])).mean())


def prediction_error(
    trials: Ratings, contrast: FloatArray, scale: Interval
) -> PredictionError | NotEstimable:
    """Return how far a law's predictions of the conditions are off, each without its own ratings.

    Without a condition's ratings, each subject's level and a slope common to all are fitted by
    least squares; with the subjects' contrasts under that condition they predict its mean rating.
    A subject's prediction outside the scale counts as its end.

    `trials` are the rated ones; `contrast` (trials,) is what the law predicts, and `scale` has the
    lowest and highest possible rating.
    """
    cells = _cells(trials, contrast)
    conditions = cells.counts.shape[1]
    if conditions < 3:
        return NotEstimable(
            f"a condition is predicted from at least 2 others, got {conditions - 1}"
        )
    errors, outside = [], []
    for place, name in enumerate(np.unique(trials.condition)):
        others = cells.counts * (np.arange(conditions) != place)
        known = others.any(axis=1)
        weights, others = cells.counts[known, place], others[known]
        if not weights.any():
            return NotEstimable("a condition was rated only by subjects who rated no other")
        steps, rest = (_centred(v[known], others) for v in (cells.contrasts, cells.means))
        squares = float((others * steps**2).sum())
        slope = float((others * steps * rest).sum()) / squares if squares > 0 else 0.0
        observed = cells.means[known, place]
        level = observed - rest[:, place]
        predicted = level + slope * steps[:, place]
        # Nobody can rate beyond the scale, so that a law is not blamed for how far it overshoots.
        inside = np.clip(predicted, *scale)
        errors.append([np.average(observed - v, weights=weights) for v in (inside, level)])
        if not scale[0] <= np.average(predicted, weights=weights) <= scale[1]:
            outside.append(trials.conditions[name])
    with_law, without = np.sqrt((np.array(errors) ** 2).mean(axis=0)).tolist()
    return PredictionError(with_law=with_law, without=without, outside_scale=tuple(outside))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Cells:
    """Ratings per cell, their means, and contrasts, each of shape (subjects, conditions).

    A mean is 0 where there is no rating; a contrast is the condition's mean there. `alike` is
    whether each condition has the same contrast in all trials.
    """

    counts: FloatArray
    means: FloatArray
    contrasts: FloatArray
    alike: bool


def _cells(trials: Ratings, contrast: FloatArray) -> _Cells:
    people, subject = np.unique(trials.subject, return_inverse=True)
    names, first, condition = np.unique(trials.condition, return_index=True, return_inverse=True)
    counts, sums, totals = np.zeros((3, len(people), len(names)))
    np.add.at(counts, (subject, condition), 1)
    np.add.at(sums, (subject, condition), trials.rating)
    np.add.at(totals, (subject, condition), contrast)
    alike = np.array_equal(
        np.round(contrast, DECIMALS), np.round(contrast[first], DECIMALS)[condition]
    )
    own = totals / np.maximum(counts, 1)
    # A mean of equal contrasts may differ from them in the last digit.
    average = contrast[first] if alike else own.sum(axis=0) / (counts > 0).sum(axis=0)
    return _Cells(
        counts=counts,
        means=sums / np.maximum(counts, 1),
        contrasts=np.where((counts == 0) | alike, average, own),
        alike=alike,
    )


def _centred(values: FloatArray, weights: FloatArray) -> FloatArray:
    """Return the values about each subject's weighted mean."""
    return np.asarray(values - np.average(values, axis=1, weights=weights)[:, None])


def _explained(cells: _Cells, assigned: FloatArray) -> float:
    """Return the sum of squares that a common slope on the assigned contrasts explains."""
    steps = _centred(assigned, cells.counts)
    squares = float((cells.counts * steps**2).sum())
    return float((cells.counts * steps * cells.means).sum()) ** 2 / squares if squares else 0.0


def _log_likelihoods(
    means: FloatArray, assigned: FloatArray, repeats: int, squares: float
) -> FloatArray:
    """Return the largest log-likelihood of M1 under each assignment, but for a constant.

    In an orthonormal basis of level and slope, subjects' lines have covariance Ψ = T + σ²I and the
    rest of each subject's ratings σ². The best Ψ has the eigenvectors of the lines' covariance;
    an eigenvalue that would fall below σ² is pooled with it, so that T stays a covariance.

    `means` has shape (subjects, conditions), each of `repeats` ratings; `assigned` has shape
    (assignments, conditions), contrasts; `squares` is the sum of all squared ratings.
    """
    subjects, conditions = means.shape
    # A line, its level and its slope, takes two dimensions of each subject's ratings.
    rest = conditions * repeats - 2
    slopes = assigned - assigned.mean(axis=1, keepdims=True)
    slopes /= np.sqrt((slopes**2).sum(axis=1, keepdims=True))
    level = means.sum(axis=1) * np.sqrt(repeats / conditions)
    slope = np.sqrt(repeats) * means @ slopes.T
    residual = (squares - level @ level - (slope**2).sum(axis=0)) / (subjects * rest)
    both = ((level - level.mean())[:, None] * (slope - slope.mean(axis=0))).mean(axis=0)
    middle = (level.var() + slope.var(axis=0)) / 2
    apart = np.hypot((level.var() - slope.var(axis=0)) / 2, both)
    least = _LEAST * squares / (subjects * conditions * repeats)
    large, small, noise = (
        np.maximum(values, least) for values in (middle + apart, middle - apart, residual)
    )
    one = (rest * noise + small) / (rest + 1)
    all_ = (rest * noise + small + large) / (rest + 2)
    pooled = np.where(small < noise, one, noise)
    pooled = np.where(large < pooled, all_, pooled)
    spreads = [np.maximum(large, pooled), np.maximum(small, pooled)]
    lines = sum(np.log(s) + v / s for s, v in zip(spreads, (large, small), strict=True))
    return np.asarray(-subjects / 2 * (lines + rest * (np.log(pooled) + noise / pooled)))


# The best is sought between these standard deviations, in those of the ratings, and artanh ρ.
NOISE, SPREAD, CORRELATION = (float(np.exp(-8)), 3e3), (1e-6, 3e3), (-8.0, 8.0)


def shared_contrasts(ratings: Ratings, contrast: FloatArray) -> bool:
    """Return whether all subjects have the same contrasts under the same conditions.

    A subject who broke off may lack some of them.
    """
    if not len(contrast):
        return False
    trials = np.stack([ratings.subject, ratings.condition, np.round(contrast, DECIMALS)])
    own = np.unique(trials, axis=1)
    return len(np.unique(own[1:], axis=1).T) == int(np.unique(own[0], return_counts=True)[1].max())


@dataclass(frozen=True, kw_only=True)
class LawLikelihood:
    """How well a law explains who felt what, all laws given the same freedom.

    `log_likelihood` is the largest of M1 with the law's contrasts; `gain_over_none` is by how
    much it exceeds that of subjects who differ in level alone, not penalised for the law's three
    parameters more. `gain_p` is the share of all assignments of the contrasts to the conditions
    that gain as much, see `assignment_p`. Trials of the same condition are not independent, so the
    log-likelihoods are no evidence for a law; `gain_p` and `prediction_error` count conditions.
    """

    log_likelihood: float
    gain_over_none: float
    gain_p: float | NotEstimable
    prediction_error: PredictionError | NotEstimable


def law_likelihoods(
    ratings: Ratings, contrasts: Mapping[str, FloatArray], scale: Interval
) -> dict[str, LawLikelihood | NotEstimable]:
    """Return for each law how well its contrasts explain the ratings, by name.

    `contrasts` are by law, shape (trials,), under each participant's own settings; those of
    `ratings` are not used. `scale` has the lowest and highest possible rating.

    Raises:
        ValueError: another number of contrasts than of trials.
    """
    scored = ~np.isnan(ratings.rating)
    results: dict[str, LawLikelihood | NotEstimable] = {}
    for law, contrast in contrasts.items():
        if contrast.shape != ratings.rating.shape:
            raise ValueError(f"{law} needs {ratings.rating.size} contrasts, got {contrast.size}")
        results[law] = _law_likelihood(ratings.where(scored), contrast[scored], scale)
    return results


def _law_likelihood(
    trials: Ratings, contrast: FloatArray, scale: Interval
) -> LawLikelihood | NotEstimable:
    if isinstance(axes := axes_of(replace(trials, contrast=contrast)), NotEstimable):
        return axes
    x = (contrast - axes.x_mean) / axes.x_sd
    y = (trials.rating - axes.y_mean) / axes.y_sd
    sums = line_sums(trials.subject, len(trials.subjects), x, y)
    if refusal := without_noise(sums):
        return refusal
    # Back to the density of ratings in points, because the fit is to standardised ones.
    unit = len(y) * np.log(axes.y_sd)
    with_law = _largest(sums) - unit
    without = _largest_level(trials, y) - unit
    return LawLikelihood(
        log_likelihood=float(with_law),
        gain_over_none=float(with_law - without),
        gain_p=assignment_p(trials, contrast),
        prediction_error=prediction_error(trials, contrast, scale),
    )


def _largest(sums: LineSums) -> float:
    """Return the largest log-likelihood of partially pooled lines, population line included.

    It is the profile of `line_posterior` with its matrices written out, which takes a twentieth of
    the time: (σ² I + T G)⁻¹ = (σ² I + adj(G) adj(T)) / D, so that every sum over subjects weights
    what stays the same by 1 / D = 1 / |σ² I + T G|, with G = Z'Z and p = Z'y.
    """
    n, x, xx = sums.gram[:, 0, 0], sums.gram[:, 0, 1], sums.gram[:, 1, 1]
    (y, xy), size = sums.products.T, n * xx - x**2
    adjusted = xx * y - x * xy, n * xy - x * y  # adj(G) p
    squares = y * y, 2 * y * xy, xy * xy, y * adjusted[0] + xy * adjusted[1]
    grams = np.stack([n, x + x, xx, size], axis=1)
    fixed = np.stack([n, x, xx, size, y, xy, *adjusted, *squares])
    total, count = sums.squares.sum(), n.sum()

    def cost(point: FloatArray) -> float:
        noise, (level, slope) = point[0] ** 2, point[1:3]
        both = level * slope * np.tanh(point[3])
        both_size = (level * slope / np.cosh(point[3])) ** 2
        between = np.array([noise * level**2, noise * both, noise * slope**2, both_size])
        determinant = grams @ between + noise**2
        weighted = fixed @ (1 / determinant)
        adjugate = np.array([[slope**2, -both], [-both, level**2]])
        info = noise * weighted[[0, 1, 1, 2]].reshape(2, 2) + weighted[3] * adjugate
        score = noise * weighted[4:6] + adjugate @ weighted[6:8]
        explained = between @ weighted[8:] / noise
        quadratic = total / noise - explained - score @ np.linalg.solve(info, score)
        log_det = np.log(determinant).sum() + (count - 2 * len(n)) * np.log(noise)
        return float(log_det + quadratic + count * np.log(2 * np.pi)) / 2

    return -_smallest(cost, [NOISE, SPREAD, SPREAD, CORRELATION], [0.6, 0.5, 0.5, 0.0])


def _largest_level(trials: Ratings, y: FloatArray) -> float:
    """Return the largest log-likelihood of subjects who differ in level alone."""
    counts = np.bincount(trials.subject, minlength=len(trials.subjects)).astype(np.float64)
    sums = np.bincount(trials.subject, weights=y, minlength=len(counts))
    squares = float((y**2).sum())

    def cost(point: FloatArray) -> float:
        noise, level = point**2
        weight = counts / (noise + counts * level)
        mean = (sums / (noise + counts * level)).sum() / weight.sum()
        within = squares - 2 * mean * sums.sum() + mean**2 * counts.sum()
        shrunk = level / (noise + counts * level) * (sums - counts * mean) ** 2
        log_det = counts.sum() * np.log(noise) + np.log1p(counts * level / noise).sum()
        quadratic = (within - shrunk.sum()) / noise
        return float(log_det + quadratic + counts.sum() * np.log(2 * np.pi)) / 2

    return -_smallest(cost, [NOISE, SPREAD], [0.6, 0.5])


def _smallest(
    cost: Callable[[FloatArray], float], bounds: Sequence[Interval], start: Sequence[float]
) -> float:
    """Return the smallest cost of standard deviations, and of a correlation that may follow them.

    Those that are best at 0 end at their bound, which a search of their logarithms only nears; and
    slopes by one-sided differences would let it stop elsewhere on every processor.
    """
    search = partial(
        minimize,
        cost,
        jac="3-point",
        method="L-BFGS-B",
        bounds=bounds,
        options={"ftol": 1e-15, "gtol": 1e-9},
    )
    small = [min(value, 0.05) for value in start]
    return min(float(search(np.array(begin)).fun) for begin in (start, small))


# A law's order of the conditions against that of the mean ratings.

# Eleven conditions take a tenth of a second, and each further one more than twice as long.
MOST_COUNTED = 11


@dataclass(frozen=True, kw_only=True)
class LawOrder:
    """How a law's predicted contrasts order the conditions, against the people's mean ratings.

    `tied` has the conditions from the strongest predicted contrast to the weakest, those of equal
    contrast together. `p` is two-sided over all orders of the conditions (t approximation beyond
    eleven conditions), and `rank_needed` the smallest correlation of these ranks, ties and all,
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
    """Return the conditions from the strongest contrast to the weakest, equal ones together."""
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
    t = float(stdtrit(pairs - 2, UPPER))
    return t / float(np.sqrt(pairs - 2 + t**2))


@cache
def critical_rank_correlation(pairs: int) -> float | NotEstimable:
    """Return the least rank correlation without ties that has p < .05, two-sided.

    Over all orders up to eleven pairs, by the t approximation beyond.

    >>> critical_rank_correlation(5)
    1.0
    """
    if pairs < 3:
        return critical_correlation(pairs)
    ranks = 2.0 * np.arange(pairs) - (pairs - 1)
    return _over_all_orders(np.stack([ranks, ranks]))[1]


def _over_all_orders(deviations: FloatArray) -> tuple[float, float | NotEstimable]:
    """Return the share of orders that correlate as strongly, either way, and what p < .05 takes.

    `deviations` has shape (2, conditions): doubled ranks about their mean.
    """
    count = deviations.shape[1]
    observed = abs(float(deviations[0] @ deviations[1]))
    largest = float(np.sqrt((deviations**2).sum(axis=1).prod()))
    if count <= MOST_COUNTED:
        orders = _orders_by_product(*deviations.astype(int).tolist())
        shares = np.cumsum(orders[::-1])[::-1] / orders.sum()
        p, rare = float(shares[round(observed)]), np.flatnonzero((orders > 0) & (shares < LEVEL))
        if not rare.size:
            return p, NotEstimable(f"no order of these {count} conditions has p < .05")
        return p, float(rare[0]) / largest
    r = min(observed / largest, 1 - 1e-12)  # t of a perfect order would be infinite
    t = r * np.sqrt((count - 2) / (1 - r**2))
    # No share is smaller than that of the observed order alone, its ties exchanged, and reversed.
    ties = np.unique(deviations[1], return_counts=True)[1].tolist()
    mirrored = any(np.array_equal(np.sort(ranks), np.sort(-ranks)) for ranks in deviations)
    least = (1 + mirrored) * math.prod(map(math.factorial, ties)) / math.factorial(count)
    return max(least, float(2 * stdtr(count - 2, -t))), critical_correlation(count)


def _orders_by_product(first: list[int], second: list[int]) -> FloatArray:
    """Return how many orders of `second` have each size of the product with `first`, from 0 up.

    (20) of mathematics/ordinal: the orders are counted by the set of the places that are taken.
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
