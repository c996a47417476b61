"""Means that stand among published scores: a printed table has a column and a row of them.

Taken for a condition or a subject, they would spoil every statistic.
"""

import numpy as np

from analysis.scores import FloatArray

NAMES = frozenset({"average", "comprehensive", "mean", "total"})
LEAST_OTHERS = 3
LEAST_ROWS = 3
_PRINTED = 0.0101
"""How far two means to two decimals may lie apart that were the same before rounding."""


def named_as_mean(name: str) -> bool:
    """Return whether a column or row is called as means and sums are."""
    return name.casefold() in NAMES


def mean_column(scores: FloatArray) -> int | None:
    """Return the column that is the mean of all others in every row, None if none is.

    It takes at least three others and three rows in which they differ: in fewer, and where all
    are equal, scores meet their mean by chance. A value that only a mean can have - a fraction,
    where all others are whole - is proof in a single row.

    Args:
        scores: shape (rows, columns), NaN where none was given.
    """
    if scores.shape[1] <= LEAST_OTHERS:
        return None
    return next((place for place in range(scores.shape[1]) if _is_mean(scores, place)), None)


def _is_mean(scores: FloatArray, place: int) -> bool:
    candidate, others = scores[:, place], np.delete(scores, place, axis=1)
    given = ~np.isnan(others).all(axis=1)
    if not given.any() or not np.array_equal(given, ~np.isnan(candidate)):
        return False
    candidate, others = candidate[given], others[given]
    if (np.abs(candidate - np.nanmean(others, axis=1)) > _PRINTED).any():
        return False
    telling = np.nanmax(others, axis=1) > np.nanmin(others, axis=1)
    proof = _has_fraction(candidate) and not _has_fraction(others)
    return proof or int(telling.sum()) >= LEAST_ROWS


def _has_fraction(values: FloatArray) -> bool:
    return any(value % 1 > 0 for value in values.flat)
