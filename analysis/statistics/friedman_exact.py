"""The exact permutation distribution of Friedman's statistic, ties included."""

from itertools import permutations

import numpy as np

from analysis.no_answer import NoAnswer
from analysis.scores import FloatArray
from analysis.statistics.ranks import IntArray

# Sums reached so far times arrangements of the next row: about one second and 300 MB.
LARGEST_STEP = 3_000_000
MOST_CONDITIONS = 7


def exact_p(doubled_ranks: IntArray) -> float | NoAnswer:
    """Return the chance of rank sums at least as unequal as these, each row shuffled at random.

    The rows are added one at a time. What a further row does to a set of sums does not depend on
    which condition has which sum, so only the sorted sums are kept. Sums of squares are compared
    as integers; probabilities are sums of positive terms and carry only rounding error.

    Parameters:
        doubled_ranks: shape (subjects, conditions), twice the midranks within each row.
    """
    if doubled_ranks.shape[1] > MOST_CONDITIONS:
        return NoAnswer(
            reason=f"the exact p is computed for at most {MOST_CONDITIONS} conditions, got "
            f"{doubled_ranks.shape[1]}"
        )
    # Rows with few arrangements last: that is where there are most sums to go through.
    rows = sorted((_arrangements(row) for row in doubled_ranks), key=len, reverse=True)
    sums, chances = np.zeros((1, doubled_ranks.shape[1]), dtype=np.int64), np.ones(1)
    for count, row in enumerate(rows):
        if len(sums) * len(row) > LARGEST_STEP:
            return NoAnswer(reason=_too_many(len(rows), count))
        if count < len(rows) - 1:
            sums, chances = _add_row(sums, chances, row)
    observed = int((doubled_ranks.sum(axis=0) ** 2).sum())
    return _upper_tail(sums, chances, rows[-1], observed)


def _too_many(subjects: int, done: int) -> str:
    return (
        f"the exact p is computed for small studies only: with {subjects} subjects the rank sums "
        f"are too many to list after {done} of them"
    )


def _arrangements(row: IntArray) -> IntArray:
    return np.array(sorted(set(permutations(row.tolist()))), dtype=np.int64)


def _add_row(sums: IntArray, chances: FloatArray, row: IntArray) -> tuple[IntArray, FloatArray]:
    reached = np.sort((sums[:, None, :] + row).reshape(-1, row.shape[1]), axis=1)
    base = int(reached.max()) + 1
    # The total is fixed, so that all sums but one tell the sums apart.
    keys = reached[:, 1:] @ (base ** np.arange(row.shape[1] - 1, dtype=np.int64))
    _, first, which = np.unique(keys, return_index=True, return_inverse=True)
    weights = np.repeat(chances / len(row), len(row))
    return reached[first], np.bincount(which, weights=weights).astype(np.float64)


def _upper_tail(sums: IntArray, chances: FloatArray, row: IntArray, observed: int) -> float:
    constant = (sums**2).sum(axis=1)[:, None] + (row[0] ** 2).sum()
    as_unequal = constant + 2 * (sums @ row.T) >= observed
    return float((chances * as_unequal.mean(axis=1)).sum())
