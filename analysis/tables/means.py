"""Columns and rows of means, which a printed table has beside its scores."""

from collections.abc import Sequence
from itertools import permutations

import numpy as np

from analysis.estimates import FloatArray
from analysis.tables.table_cells import Cells

LEAST_OTHERS = 3
LEAST_ROWS = 3
LEAST_SUMS = 2
LEAST_DIFFERENT = 4
# Each may be off by half of the last digit; the rest allows for binary fractions.
_PRINTED, _TENTHS = 0.0101, 0.0501
"""How far two means to two decimals may lie apart that were the same before rounding, and how far
one to one decimal may lie from what it was."""


def numbers_in(cells: Cells, lines: Sequence[Sequence[str]]) -> FloatArray:
    """Return the numbers in lines - columns, or rows - NaN where there is none, a column each."""
    numbers = [[cells.number(text) for text in line] for line in lines]
    return np.array(numbers, dtype=np.float64).reshape(len(lines), -1 if lines else 0).T


def mean_column(scores: FloatArray) -> int | None:
    """Return the column that is the mean of all others in every row, None if none is.

    It takes at least three others and three rows in which they differ: in fewer, and where all are
    equal, scores meet their mean by chance. A value that only a mean can have - a fraction, where
    all others are whole - is proof in a single row. `scores` has shape (rows, columns), NaN where
    none was given.
    """
    if scores.shape[1] <= LEAST_OTHERS:
        return None
    given = ~np.isnan(scores)
    values = np.where(given, scores, 0.0)
    # Arrays of one entry per cell, about the others in its row: their number, mean and range.
    others = given.sum(axis=1, keepdims=True) - given
    there = others > 0
    means = (values.sum(axis=1, keepdims=True) - values) / np.maximum(others, 1)
    near = np.abs(values - means) <= _tolerance(values)
    met = np.where(there, given & near, ~given)
    telling = there & (_highest_of_others(scores) > -_highest_of_others(-scores))
    fractions = (values % 1 > 0).sum(axis=0)
    proof = (fractions > 0) & (fractions == fractions.sum())
    is_mean = met.all(axis=0) & there.any(axis=0) & (proof | (telling.sum(axis=0) >= LEAST_ROWS))
    return int(np.argmax(is_mean)) if is_mean.any() else None


def _tolerance(values: FloatArray) -> FloatArray:
    """Return how far each column may lie from what it is before rounding, by its decimals."""
    in_tenths = (np.abs(values * 10 - np.round(values * 10)) < 1e-6).all(axis=0)
    in_tenths &= (values % 1 > 0).any(axis=0)
    return np.where(in_tenths, _TENTHS, _PRINTED)


def summing_column(scores: FloatArray) -> tuple[int, str] | None:
    """Return the column that sums up all others in every row, and how.

    It is any that is their mean, or the last if it is their sum or standard deviation. A sum says
    something where it is higher than each of the others.
    """
    if (mean := mean_column(scores)) is not None:
        return mean, "the mean of all others"
    if scores.shape[1] <= LEAST_OTHERS:
        return None
    others, last = scores[:, :-1], scores[:, -1]
    given = ~np.isnan(others)
    many = given.sum(axis=1)
    values = np.where(given, others, 0.0)
    sums = values.sum(axis=1)
    squares = np.where(given, (others - (sums / np.maximum(many, 1))[:, None]) ** 2, 0.0).sum(
        axis=1
    )
    near = _tolerance(np.nan_to_num(last))
    is_higher = last > np.where(given, others, -np.inf).max(axis=1) + _PRINTED
    for word, statistic, tells in (
        ("sum", sums, is_higher),
        ("standard deviation", np.sqrt(squares / np.maximum(many - 1, 1)), squares > 0),
        ("standard deviation", np.sqrt(squares / np.maximum(many, 1)), squares > 0),
    ):
        met = np.abs(last - statistic) <= near
        telling = met & tells & (many > 1)
        if (met | np.isnan(last)).all() and telling.sum() >= LEAST_SUMS:
            return scores.shape[1] - 1, f"the {word} of all others"
    return None


def _highest_of_others(scores: FloatArray) -> FloatArray:
    """Return for each cell the highest of the other scores in its row, -inf if there is none."""
    known = np.where(np.isnan(scores), -np.inf, scores)
    # It is the row's highest score, except for the highest itself, whose others begin at the
    # second.
    second, first = np.partition(known, -2, axis=1)[:, -2:].T[:, :, None]
    return np.where(known == first, second, first)


def difference_column(scores: FloatArray) -> tuple[int, int, int] | None:
    """Return the last column if it is in every row the difference of two others, and which two.

    Rows without a number tell nothing, nor do those where the two are alike: it takes four others.
    """
    last = scores[:, -1]
    near = _tolerance(np.nan_to_num(last))
    for one, other in permutations(range(scores.shape[1] - 1), 2):
        difference = scores[:, one] - scores[:, other]
        known = ~np.isnan(difference) & ~np.isnan(last)
        met = np.abs(last - difference) <= near
        if met[known].all() and (known & (difference != 0)).sum() >= LEAST_DIFFERENT:
            return scores.shape[1] - 1, one, other
    return None


def is_mean_of(line: FloatArray, scores: FloatArray) -> bool:
    """Return whether a column is, in every row, the mean of the others; `scores` has theirs."""
    given = ~np.isnan(scores)
    many = given.sum(axis=1)
    means = np.where(given, scores, 0.0).sum(axis=1) / np.maximum(many, 1)
    near = _tolerance(np.nan_to_num(line))
    met = np.where(many > 0, np.abs(line - means) <= near, np.isnan(line))
    # A row tells if its scores differ: else the column may be one more of them.
    filled = np.where(given, scores, means[:, None])
    telling = filled.max(axis=1) > filled.min(axis=1)
    return bool(met.all() and (met & telling).sum() >= LEAST_ROWS)
