"""Omnibus tests of equal conditions: Friedman (with Kendall's W) and Skillings-Mack.

Numbers of equations are those of docs/mathematics/rank-tests.md.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations
from math import nan
from typing import Self

import numpy as np
from scipy.sparse.csgraph import connected_components
from scipy.special import chdtrc

from analysis.estimates import BoolArray, FloatArray, IntArray, Interval, NotEstimable, ScoreTable
from analysis.statistics import intervals, signed_rank
from protocol.errors import listed

# Permutation p from random shufflings within subjects, where there are too many to list.

SEED = 1
MOST_SHUFFLES = 100_000
# Large studies get fewer shuffles, at least the least number.
MOST_CELLS = 10_000_000
LEAST_SHUFFLES = 500
# With fewer than enough, p is coarser than chi-square is wrong where subjects are many.
ENOUGH_SHUFFLES = 20_000
MANY_SUBJECTS = 20


@dataclass(frozen=True, kw_only=True)
class MonteCarlo:
    """A permutation p from random shufflings, with its standard error.

    (8): p = (1 + shufflings as extreme) / (1 + shufflings), which is never 0 (Phipson and
    Smyth, Statistical Applications in Genetics and Molecular Biology 9, 2010).
    """

    p: float
    error: float
    shuffles: int

    @classmethod
    def of(cls, extreme: int, shuffles: int) -> Self:
        """Return the p of so many shufflings as extreme as what was observed."""
        p = (1 + extreme) / (1 + shuffles)
        return cls(p=p, error=float(np.sqrt(p * (1 - p) / (1 + shuffles))), shuffles=shuffles)


def shuffles_of(cells: int, most: int = MOST_SHUFFLES) -> int:
    """Return how often a table of so many cells is shuffled."""
    return int(np.clip(MOST_CELLS // cells, LEAST_SHUFFLES, most))


def _chi_square_serves(subjects: int, conditions: int) -> bool:
    """Return whether a table is too large to be shuffled often enough.

    Chi-square is accurate there; with few subjects it is not, however many the conditions.
    """
    shuffles = shuffles_of(subjects * conditions)
    return subjects >= MANY_SUBJECTS and shuffles < ENOUGH_SHUFFLES


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
    shuffles = shuffles_of(rows.size)
    rng = np.random.default_rng(SEED)
    sums = np.zeros((shuffles, rows.shape[1]))
    for row, cells in zip(rows, given, strict=True):
        own = row[cells]
        same = own.size == 0 or bool((own == own[0]).all())
        sums[:, cells] += own if same else rng.permuted(np.tile(own, (shuffles, 1)), axis=1)
    observed = float(statistic(rows.sum(axis=0)[None])[0])
    extreme = statistic(sums) >= observed - 1e-9 * abs(observed)
    return MonteCarlo.of(int(extreme.sum()), shuffles)


# Limit on rank sums reached so far times arrangements of the next row: about 1 s and 300 MB.
LARGEST_STEP = 3_000_000
MOST_CONDITIONS = 7
# In simulations, where chi-square would reject too often.
MOST_CONDITIONS_EXACT = 3


def exact_p(doubled_ranks: IntArray) -> float | NotEstimable:
    """Return the probability, with each row shuffled, of rank sums at least as unequal as these.

    The rows are added one at a time. The effect of a row does not depend on which condition has
    which sum, so only the sorted sums are kept. Sums of squares are compared as integers;
    probabilities are sums of positive terms, so their only error is rounding.

    Parameters:
        doubled_ranks: shape (subjects, conditions), twice the midranks within each row.
    """
    if doubled_ranks.shape[1] > MOST_CONDITIONS:
        return NotEstimable(
            f"the exact p is computed for at most {MOST_CONDITIONS} conditions, got "
            f"{doubled_ranks.shape[1]}"
        )
    # Rows with few arrangements come last, when there are most sums to combine them with.
    values = [tuple(row) for row in np.sort(doubled_ranks, axis=1).tolist()]
    rows = sorted(values, key=lambda row: len(_arrangements(row)), reverse=True)
    for count, row in enumerate(rows):
        sums, chances = _summed(tuple(rows[:count]), len(row))
        if len(sums) * len(_arrangements(row)) > LARGEST_STEP:
            return NotEstimable(
                f"the exact p is computed for small studies only: with {len(rows)} "
                f"subjects, there are too many rank sums to list after {count} of them"
            )
    last = _arrangements(rows[-1])
    observed = int((doubled_ranks.sum(axis=0) ** 2).sum())
    # (5), by (7)
    constant = (sums**2).sum(axis=1)[:, None] + (last[0] ** 2).sum()
    as_unequal = constant + 2 * (sums @ last.T) >= observed
    return float((chances * as_unequal.mean(axis=1)).sum())


@lru_cache(maxsize=512)
def _arrangements(row: tuple[int, ...]) -> IntArray:
    """Return each different order of the values once, in rising order."""
    return np.array(sorted(set(permutations(row))), dtype=np.int64)


# Rows without ties are all alike: each reading of a large table begins with the same ones.
@lru_cache(maxsize=32)
def _summed(rows: tuple[tuple[int, ...], ...], columns: int) -> tuple[IntArray, FloatArray]:
    """Return the different sums of shuffled rows, each sorted, and their chances, (6)."""
    if not rows:
        return np.zeros((1, columns), dtype=np.int64), np.ones(1)
    (sums, chances), row = _summed(rows[:-1], columns), _arrangements(rows[-1])
    reached = np.sort((sums[:, None, :] + row).reshape(-1, columns), axis=1)
    base = int(reached.max()) + 1
    # The total is fixed, so all sums but one identify the set.
    keys = reached[:, 1:] @ (base ** np.arange(columns - 1, dtype=np.int64))
    _, first, which = np.unique(keys, return_index=True, return_inverse=True)
    weights = np.repeat(chances / len(row), len(row))
    return reached[first], np.bincount(which, weights=weights).astype(np.float64)


@dataclass(frozen=True, kw_only=True)
class Friedman:
    """Friedman's test of one table.

    `p` is the chi-square approximation, `p_exact` the permutation p over all rearrangements of
    each subject's scores (ties kept), and `monte_carlo` its estimate, None if `p_exact` is known
    or the table is so large that chi-square is more accurate; `kendall_w` is the agreement of the
    subjects, 0 to 1, corrected for ties; `rank_sums` has one rank sum per condition (1 = the
    lowest score).
    """

    chi2: float
    df: int
    p: float
    p_exact: float | NotEstimable
    monte_carlo: MonteCarlo | None
    kendall_w: float
    kendall_w_interval: Interval | NotEstimable
    rank_sums: tuple[float, ...]

    @property
    def best_p(self) -> float:
        """The permutation p, its estimate, or in large tables that of chi-square."""
        if self.monte_carlo is not None:
            return self.monte_carlo.p
        return self.p if isinstance(self.p_exact, NotEstimable) else self.p_exact


def friedman(table: ScoreTable) -> Friedman | NotEstimable:
    """Return Friedman's test of the table, or why it is not possible.

    χ² = (k-1) Σ_j (R_j - n(k+1)/2)² / Σ_ij (r_ij - (k+1)/2)² and W = χ² / (n (k-1)) (Conover,
    Practical Nonparametric Statistics, 3rd ed., section 5.8). Equal scores share their mean rank.

    >>> import numpy as np
    >>> scores = np.array([[1.0, 2, 3], [1, 2, 3], [1, 3, 2]])
    >>> test = friedman(ScoreTable(subjects=("1", "2", "3"), conditions=("a", "b", "c"),
    ...                            scores=scores))
    >>> round(test.chi2, 3), round(test.p_exact, 3)
    (4.667, 0.194)
    """
    if refusal := _refusal(table):
        return refusal
    ranks = signed_rank.doubled_midranks(table.scores)
    (subjects, conditions), (between, within) = ranks.shape, _squares(ranks)
    middle = conditions + 1
    if within == 0:
        return NotEstimable("every subject has the same score or response in all conditions")
    chi2, exact, shuffled = (conditions - 1) * between / within, exact_p(ranks), None  # (1)
    if isinstance(exact, NotEstimable) and not _chi_square_serves(subjects, conditions):
        centred = (ranks - middle).astype(np.float64)
        shuffled = monte_carlo_p(centred, table.given, lambda sums: (sums**2).sum(axis=1))
    return Friedman(
        chi2=chi2,
        df=conditions - 1,
        p=float(chdtrc(conditions - 1, chi2)),
        p_exact=exact,
        monte_carlo=shuffled,
        kendall_w=chi2 / (subjects * (conditions - 1)),
        kendall_w_interval=intervals.concordance_interval((ranks - middle) / 2),
        rank_sums=tuple(float(total) / 2 for total in ranks.sum(axis=0)),
    )


def _squares(doubled_ranks: IntArray) -> tuple[int, int]:
    """Return the sums of squares of rank sums and of ranks about their means, both doubled."""
    subjects, conditions = doubled_ranks.shape
    # In doubled ranks the mean rank is `conditions + 1`, so the sums of squares are integers.
    middle = conditions + 1
    between = int(((doubled_ranks.sum(axis=0) - subjects * middle) ** 2).sum())
    return between, int(((doubled_ranks - middle) ** 2).sum())


def _refusal(table: ScoreTable) -> NotEstimable | None:
    for what, names in (("conditions", table.conditions), ("subjects", table.subjects)):
        if len(names) < 2:
            return NotEstimable(f"it needs at least 2 {what}, got 1")
    if not table.is_complete:
        return NotEstimable(
            f"it needs a value in every cell, but {table.missing_count} of {table.scores.size} are "
            "empty"
        )
    return None


@dataclass(frozen=True, kw_only=True)
class SkillingsMack:
    """The Skillings-Mack test of equal conditions; p is the chi-square approximation.

    `monte_carlo` has the permutation p, over rearrangements of the scores that each subject gave;
    None where the table is so large that chi-square is more accurate.

    `statistic` is corrected for ties and so equals Friedman's χ² when no score is missing;
    `untied` is the statistic as first published, without that correction. `left_out` has the
    conditions without any score, which the test does not cover.
    """

    statistic: float
    df: int
    p: float
    monte_carlo: MonteCarlo | None
    untied: float
    left_out: tuple[str, ...] = ()

    @property
    def best_p(self) -> float:
        """The permutation p, or in large tables that of chi-square."""
        return self.p if self.monte_carlo is None else self.monte_carlo.p


def skillings_mack(table: ScoreTable) -> SkillingsMack | NotEstimable:
    """Return the Skillings-Mack test of the table, or why it is not possible.

    T = A' Σ⁻ A with A_j = Σ_i √(12/(k_i+1)) (r_ij - (k_i+1)/2), ranks within the k_i scores of
    subject i (Skillings and Mack, Technometrics 23, 1981, 171-177). Differs from the paper: Σ has
    the variance of each subject's tied ranks instead of that of k_i distinct ones.
    """
    if isinstance(found := _tied_ranks(table), NotEstimable):
        return found
    scores, deviations, inverse = found.scores, found.deviations, found.inverse
    total = deviations.sum(axis=0)
    untied, _ = _inverse(_covariance(scores, np.ones(len(scores))))
    return SkillingsMack(
        statistic=found.statistic,
        df=found.rank,
        p=float(chdtrc(found.rank, found.statistic)),
        # Rearranging a subject's scores leaves their covariance as it is.
        monte_carlo=None
        if _chi_square_serves(*scores.shape)
        else monte_carlo_p(
            deviations, ~np.isnan(scores), lambda sums: ((sums @ inverse) * sums).sum(axis=1)
        ),
        untied=float(total @ untied @ total),
        left_out=tuple(name for name in table.conditions if name not in found.conditions),
    )


def omnibus_p(table: ScoreTable) -> float:
    """Return p of equal conditions as simulations need it, in a fraction of the time; NaN if none.

    Friedman's exact p up to three conditions, where chi-square would reject too often; that of
    chi-square with more, which rejects too seldom in small tables, and that of Skillings and Mack
    where a score is missing.
    """
    if not table.is_complete:
        tied = _tied_ranks(table)
        return nan if isinstance(tied, NotEstimable) else float(chdtrc(tied.rank, tied.statistic))
    if _refusal(table):
        return nan
    ranks = signed_rank.doubled_midranks(table.scores)
    conditions = ranks.shape[1]
    between, within = _squares(ranks)
    if within == 0:
        return nan
    exact = exact_p(ranks) if conditions <= MOST_CONDITIONS_EXACT else None
    if isinstance(exact, float):
        return exact
    return float(chdtrc(conditions - 1, (conditions - 1) * between / within))


@dataclass(frozen=True, kw_only=True, eq=False)
class _TiedRanks:
    """Scores of the subjects who compare conditions, their weighted ranks, and Σ⁻ with its rank."""

    conditions: tuple[str, ...]
    scores: FloatArray
    deviations: FloatArray
    inverse: FloatArray
    rank: int

    @property
    def statistic(self) -> float:
        total = self.deviations.sum(axis=0)
        return float(total @ self.inverse @ total)


def _tied_ranks(table: ScoreTable) -> _TiedRanks | NotEstimable:
    columns = table.given.any(axis=0)
    if not columns.any():
        return NotEstimable("there is no score that counts")
    conditions = tuple(np.array(table.conditions, dtype=object)[columns])
    scores = table.scores[np.ix_(table.given.sum(axis=1) >= 2, columns)]
    if not len(scores):
        return NotEstimable("no subject scored two conditions")
    if len(scores) < 2:
        return NotEstimable("at least 2 subjects must score two conditions, got 1")
    if refusal := _disconnected(~np.isnan(scores), conditions):
        return refusal
    # (2): centred ranks, weighted by √(12/(k_i+1)).
    given = ~np.isnan(scores)
    counts = given.sum(axis=1).astype(np.float64)
    ranks = signed_rank.doubled_midranks(scores) / 2 - (counts[:, None] + 1) / 2
    deviations = np.where(given, ranks, 0.0) * np.sqrt(12 / (counts + 1))[:, None]
    variances = (deviations**2).sum(axis=1) / (counts - 1)
    if not variances.any():
        return NotEstimable("every subject has the same score or response in all conditions")
    inverse, rank = _inverse(_covariance(scores, variances / counts))
    return _TiedRanks(
        conditions=conditions, scores=scores, deviations=deviations, inverse=inverse, rank=rank
    )


def _disconnected(given: BoolArray, conditions: tuple[str, ...]) -> NotEstimable | None:
    """Return which conditions no chain of subjects compares with the rest, None if all are linked.

    `given` has shape (subjects, conditions).
    """
    compared = given.T.astype(np.intp) @ given  # by how many subjects each pair is
    # As nearly always: the search for chains would take a tenth of the tests of a small table.
    if compared.all():
        return None
    group = connected_components(compared, directed=False)[1]
    linked = group == group[0]
    if linked.all():
        return None
    apart = listed(np.array(conditions, dtype=object)[linked])
    return NotEstimable(f"no chain of subjects compares {apart} with the other conditions")


def _covariance(scores: FloatArray, shares: FloatArray) -> FloatArray:
    """Return the covariance of the weighted sums: minus each subject's share off the diagonal."""
    given = (~np.isnan(scores)).astype(np.float64)
    together = given.T @ (given * shares[:, None])
    np.fill_diagonal(together, 0.0)
    return np.diag(together.sum(axis=1)) - together


def _inverse(covariance: FloatArray) -> tuple[FloatArray, int]:
    inverse = np.linalg.pinv(covariance, rtol=1e-10, hermitian=True)
    rank = int(np.linalg.matrix_rank(covariance, tol=1e-10 * covariance.max(), hermitian=True))
    return np.asarray(inverse, dtype=np.float64), rank
