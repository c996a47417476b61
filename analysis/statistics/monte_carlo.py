"""Permutation p from random shufflings within subjects, where there are too many to list."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from analysis.estimates import BoolArray, FloatArray

SEED = 1
MOST_SHUFFLES = 100_000
# Large studies get fewer shuffles, at least the least number: there chi-square is accurate.
MOST_CELLS = 10_000_000
LEAST_SHUFFLES = 500


@dataclass(frozen=True, kw_only=True)
class MonteCarlo:
    """A permutation p from random shufflings, with its standard error.

    p = (1 + shufflings at least as extreme) / (1 + shufflings), which is never 0 (Phipson and
    Smyth, Statistical Applications in Genetics and Molecular Biology 9, 2010).
    """

    p: float
    error: float
    shuffles: int


def monte_carlo_p(
    rows: FloatArray, given: BoolArray, statistic: Callable[[FloatArray], FloatArray]
) -> MonteCarlo:
    """Return the p of a statistic of the column sums, each row shuffled over its given cells.

    The shufflings are drawn from a fixed seed, so the same table always has the same p.

    Parameters:
        rows: shape (subjects, conditions), 0 where not given.
        given: shape (subjects, conditions).
        statistic: of sums, shape (shufflings, conditions); large if the conditions differ.
    """
    shuffles = int(np.clip(MOST_CELLS // rows.size, LEAST_SHUFFLES, MOST_SHUFFLES))
    rng = np.random.default_rng(SEED)
    sums = np.zeros((shuffles, rows.shape[1]))
    for row, cells in zip(rows, given, strict=True):
        own = row[cells]
        same = own.size == 0 or bool((own == own[0]).all())
        sums[:, cells] += own if same else rng.permuted(np.tile(own, (shuffles, 1)), axis=1)
    observed = float(statistic(rows.sum(axis=0)[None])[0])
    reached = int((statistic(sums) >= observed - 1e-9 * abs(observed)).sum())
    p = (1 + reached) / (1 + shuffles)
    return MonteCarlo(p=p, error=float(np.sqrt(p * (1 - p) / (1 + shuffles))), shuffles=shuffles)
