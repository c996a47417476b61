"""Would a law's contrasts explain the ratings as well if they belonged to other conditions?"""

from itertools import permutations

import numpy as np

from analysis.no_answer import NoAnswer
from analysis.scores import FloatArray
from analysis.sensitivity.ratings import Ratings
from analysis.statistics.ranks import DECIMALS

MOST_CONDITIONS = 6
# Of the ratings' variance; a fit is not told from a perfect one below it.
_LEAST = np.exp(-16.0)


def shared_contrasts(ratings: Ratings, contrast: FloatArray) -> bool:
    """Whether all subjects have the same contrasts under the same conditions.

    A subject who broke off may lack some of them.
    """
    if not len(contrast):
        return False
    trials = np.stack([ratings.subject, ratings.condition, np.round(contrast, DECIMALS)])
    own = np.unique(trials, axis=1)
    return len(np.unique(own[1:], axis=1).T) == int(np.unique(own[0], return_counts=True)[1].max())


def assignment_p(trials: Ratings, contrast: FloatArray) -> float | NoAnswer:
    """Return the share of all assignments of the contrasts to conditions that explain as much.

    What explains is the largest log-likelihood of M1, as in `law_likelihoods`. Where all subjects
    rated the same conditions at the same contrasts equally often it has a closed form, and no
    subject's own contrasts are lost when they change places.

    Parameters:
        trials: the rated trials.
        contrast: shape (trials,), what the law predicts.
    """
    cells = _cell_means(trials, contrast)
    if isinstance(cells, NoAnswer):
        return cells
    means, values, repeats = cells
    assigned = np.array(list(permutations(values)))
    found = _log_likelihoods(means, assigned, repeats, float((trials.rating**2).sum()))
    return float((found >= found[0] - 1e-9 * abs(found[0])).mean())


def _cell_means(
    trials: Ratings, contrast: FloatArray
) -> tuple[FloatArray, FloatArray, int] | NoAnswer:
    """Return mean ratings (subjects, conditions), each condition's contrast, ratings per cell."""
    people, subject = np.unique(trials.subject, return_inverse=True)
    names, condition = np.unique(trials.condition, return_inverse=True)
    if not 3 <= len(names) <= MOST_CONDITIONS:
        return NoAnswer(
            reason=f"assignments are listed for 3 to {MOST_CONDITIONS} conditions, got {len(names)}"
        )
    counts, sums = np.zeros((2, len(people), len(names)))
    np.add.at(counts, (subject, condition), 1)
    np.add.at(sums, (subject, condition), trials.rating)
    values = np.array([contrast[condition == place][0] for place in range(len(names))])
    if not np.array_equal(np.round(contrast, DECIMALS), np.round(values, DECIMALS)[condition]):
        return NoAnswer(reason="a condition has not the same contrast for everybody")
    if (counts != counts[0, 0]).any():
        return NoAnswer(reason="not every subject rated every condition equally often")
    return sums / counts, values, int(counts[0, 0])


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
