"""The tests of the score table for many tables at once, as simulations of whole studies need them.

The numbers are those of `omnibus` and `signed_rank`, table by table.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.special import chdtrc

from analysis.estimates import FloatArray, IntArray, NotEstimable, ScoreTable
from analysis.statistics import corrections, omnibus
from analysis.statistics.signed_rank import DECIMALS, doubled_midranks, p_of_ranks

MOST_CONDITIONS_EXACT = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class ManyPairs:
    """Signed rank tests of every pair of conditions in every table, shape (tables, pairs) each.

    `mean` and `standard_error` are those of the differences of the `subjects` with both scores. NaN
    stands where there is none.
    """

    p: FloatArray
    p_holm: FloatArray
    mean: FloatArray
    standard_error: FloatArray
    subjects: IntArray


def pairwise_of_tables(scores: FloatArray) -> ManyPairs:
    """Return the pairwise tests of tables (tables, subjects, conditions); NaN is a missing score.

    >>> tables = np.array([[[1.0, 2.0], [3.0, 5.0], [2.0, 4.0]]])
    >>> pairwise_of_tables(tables).p
    array([[0.25]])
    """
    # In the order of `pairwise_signed_ranks`.
    first, second = np.transpose(list(combinations(range(scores.shape[2]), 2)))
    differences = np.moveaxis(scores[:, :, first] - scores[:, :, second], 1, 2)
    p = _signed_rank_p(differences)
    given = ~np.isnan(differences)
    subjects = given.sum(axis=2)
    count = np.where(subjects > 0, subjects, np.nan)
    mean = np.where(given, differences, 0.0).sum(axis=2) / count
    squares = (np.where(given, differences - mean[..., None], 0.0) ** 2).sum(axis=2)
    return ManyPairs(
        p=p,
        p_holm=corrections.holm_of_rows(p),
        mean=mean,
        standard_error=np.sqrt(squares / np.where(subjects > 1, subjects - 1, np.nan) / count),
        subjects=subjects.astype(np.int64),
    )


def omnibus_p(scores: FloatArray) -> FloatArray:
    """Return the p of equal conditions of each table (tables, subjects, conditions); NaN if none.

    Up to three conditions it is Friedman's exact p, where there is one: chi-square would reject
    too often there. With four and more it is chi-square's, which for so small tables rejects too
    seldom, and a table with missing scores has that of the Skillings-Mack test.
    """
    complete = ~np.isnan(scores).any(axis=(1, 2))
    p = np.full(len(scores), np.nan)
    p[complete] = _friedman_p(scores[complete])
    for number in np.flatnonzero(~complete):
        p[number] = omnibus.skillings_mack_p(unnamed_table(scores[number]))
    return p


def unnamed_table(scores: FloatArray) -> ScoreTable:
    """Return scores (subjects, conditions) as a table whose names are numbers."""
    subjects, conditions = (tuple(map(str, range(size))) for size in scores.shape)
    return ScoreTable(subjects=subjects, conditions=conditions, scores=scores)


def _friedman_p(scores: FloatArray) -> FloatArray:
    subjects, conditions = scores.shape[1:]
    if subjects < 2 or conditions < 2 or not len(scores):
        return np.full(len(scores), np.nan)
    ranks, middle = doubled_midranks(scores), conditions + 1
    between = ((ranks.sum(axis=1) - subjects * middle) ** 2).sum(axis=1)
    squares = ((ranks - middle) ** 2).sum(axis=(1, 2))
    within = np.where(squares > 0, squares, np.nan)
    p = np.asarray(chdtrc(conditions - 1, (conditions - 1) * between / within))
    if conditions <= MOST_CONDITIONS_EXACT:
        p = _exact_of_tables(ranks, between, p)
    return np.where(squares > 0, p, np.nan)


def _exact_of_tables(ranks: IntArray, between: IntArray, otherwise: FloatArray) -> FloatArray:
    """Return exact p; it depends on the ties of the rows and on how unequal the sums are."""
    known: dict[tuple[bytes, int], float] = {}
    p = otherwise.copy()
    for number, table in enumerate(ranks):
        rows = np.sort(table, axis=1)
        key = rows[np.lexsort(rows.T)].tobytes(), int(between[number])
        if key not in known:
            found = omnibus.exact_p(table)
            known[key] = otherwise[number] if isinstance(found, NotEstimable) else found
        p[number] = known[key]
    return p


def _signed_rank_p(differences: FloatArray) -> FloatArray:
    """Return the p of the signed rank test along the last axis, NaN without a difference.

    Tests whose ranks and whose sum of positive ranks are the same have the same p.
    """
    rounded = np.round(differences, DECIMALS)
    sizes = np.where(rounded == 0, np.nan, np.abs(differences))
    ranks = doubled_midranks(sizes).reshape(-1, sizes.shape[-1])
    positive = np.where(rounded.reshape(ranks.shape) > 0, ranks, 0).sum(axis=1)
    cases, which = np.unique(
        np.column_stack([np.sort(ranks, axis=1), positive]), axis=0, return_inverse=True
    )
    p = [p_of_ranks(case[:-1][case[:-1] > 0], int(case[-1])) for case in cases]
    return np.array(p, dtype=np.float64)[which.ravel()].reshape(differences.shape[:-1])
