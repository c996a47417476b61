"""A law over conditions: all assignments of its contrasts, and predictions of a condition."""

from dataclasses import dataclass
from itertools import permutations

import numpy as np

from analysis.estimates import FloatArray, Interval, NotEstimable
from analysis.sensitivity.ratings import Ratings
from analysis.statistics.signed_rank import DECIMALS

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

    Parameters:
        trials: the rated trials.
        contrast: shape (trials,), what the law predicts.
    """
    cells = _cells(trials, contrast)
    conditions = cells.counts.shape[1]
    if not 3 <= conditions <= MOST_CONDITIONS:
        return NotEstimable(
            f"assignments are listed for 3 to {MOST_CONDITIONS} conditions, got {conditions}"
        )
    orders = np.array(list(permutations(range(conditions))))
    repeats = int(cells.counts[0, 0])
    if cells.alike and (cells.counts == repeats).all():
        squares = float((trials.rating**2).sum())
        found = _log_likelihoods(cells.means, cells.contrasts[0][orders], repeats, squares)
    else:
        found = np.array([_explained(cells, cells.contrasts[:, order]) for order in orders])
    return float((found >= found[0] - 1e-9 * abs(found[0])).mean())


def prediction_error(
    trials: Ratings, contrast: FloatArray, scale: Interval
) -> PredictionError | NotEstimable:
    """Return how far a law's predictions of the conditions are off, each without its own ratings.

    Without a condition's ratings, each subject's level and a slope common to all are fitted by
    least squares; with the subjects' contrasts under that condition they predict its mean rating.
    A subject's prediction outside the scale counts as its end.

    Parameters:
        trials: the rated trials.
        contrast: shape (trials,), what the law predicts.
        scale: lowest and highest possible rating.
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

    Parameters:
        means: shape (subjects, conditions).
        assigned: shape (assignments, conditions), contrasts.
        repeats: ratings behind each mean.
        squares: sum of all squared ratings.
    """
    subjects, conditions = means.shape
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
