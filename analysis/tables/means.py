"""Columns and rows of means, which a printed table has beside its scores."""

import numpy as np

from analysis.estimates import FloatArray
from analysis.tables.ratings import Imported
from analysis.tables.shape import Shape
from analysis.tables.table_cells import Cells, TableError

LEAST_OTHERS = 3
LEAST_ROWS = 3
# Each may be off by half of the last digit; the rest allows for binary fractions.
_PRINTED, _TENTHS = 0.0101, 0.0501
"""How far two means to two decimals may lie apart that were the same before rounding, and how far
one to one decimal may lie from what it was."""


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
    in_tenths = (np.abs(values * 10 - np.round(values * 10)) < 1e-6).all(axis=0)
    in_tenths &= (values % 1 > 0).any(axis=0)
    near = np.abs(values - means) <= np.where(in_tenths, _TENTHS, _PRINTED)
    met = np.where(there, given & near, ~given)
    telling = there & (_highest_of_others(scores) > -_highest_of_others(-scores))
    fractions = (values % 1 > 0).sum(axis=0)
    proof = (fractions > 0) & (fractions == fractions.sum())
    is_mean = met.all(axis=0) & there.any(axis=0) & (proof | (telling.sum(axis=0) >= LEAST_ROWS))
    return int(np.argmax(is_mean)) if is_mean.any() else None


def _highest_of_others(scores: FloatArray) -> FloatArray:
    """Return for each cell the highest of the other scores in its row, -inf if there is none."""
    known = np.where(np.isnan(scores), -np.inf, scores)
    # It is the row's highest score, except for the highest itself, whose others begin at the
    # second.
    second, first = np.partition(known, -2, axis=1)[:, -2:].T[:, :, None]
    return np.where(known == first, second, first)


def require_no_means(cells: Cells, shape: Shape, imported: Imported) -> None:
    """Refuse a column or a row of a wide table that is the mean of all others.

    Those that are called so were left out before.
    """
    if not shape.is_wide:
        return
    kept = "add --keep-means if it holds scores"
    scores = _wide_scores(imported)
    if (column := mean_column(scores)) is not None:
        name = imported.conditions[column]
        raise TableError(
            f"{cells.where()}, column {name}: is the mean of all other columns; remove the column "
            f"(--columns ignore={name}), or {kept}"
        )
    if (row := mean_column(scores.T)) is not None:
        raise TableError(
            f"{cells.source}: the row of {imported.visits[row].participant!r} is the mean of all "
            f"others; remove the row, or {kept}"
        )


def _wide_scores(imported: Imported) -> FloatArray:
    """Return the scores, shape (visits, conditions), NaN where none or several were given."""
    places = {name: at for at, name in enumerate(imported.conditions)}
    scores = np.full((len(imported.visits), len(places)), np.nan)
    for row, visit in enumerate(imported.visits):
        for rating in visit.ratings:
            if rating.score is not None:
                scores[row, places[rating.condition]] = rating.score
    return scores
