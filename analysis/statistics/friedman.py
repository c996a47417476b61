"""Friedman's test of equal conditions, corrected for ties, and Kendall's W."""

from dataclasses import dataclass

from scipy.special import chdtrc

from analysis.no_answer import NoAnswer
from analysis.scores import ScoreTable
from analysis.statistics.friedman_exact import exact_p
from analysis.statistics.ranks import IntArray, doubled_midranks


@dataclass(frozen=True, kw_only=True)
class Friedman:
    """Friedman's test of one table.

    `p` is of the chi-square approximation, `p_exact` of all rearrangements of each subject's own
    scores (ties kept); `kendall_w` is the agreement of the subjects, 0 to 1, corrected for ties;
    `rank_sums` has one rank sum per condition (1 = the lowest score).
    """

    chi2: float
    df: int
    p: float
    p_exact: float | NoAnswer
    kendall_w: float
    rank_sums: tuple[float, ...]


def friedman(table: ScoreTable) -> Friedman | NoAnswer:
    """Return Friedman's test of the table, or why there is none.

    χ² = (k-1) Σ_j (R_j - n(k+1)/2)² / Σ_ij (r_ij - (k+1)/2)² and W = χ² / (n (k-1)) (Conover,
    Practical Nonparametric Statistics, 3rd ed., section 5.8). Equal scores share their mean rank.

    >>> import numpy as np
    >>> scores = np.array([[1.0, 2, 3], [1, 2, 3], [1, 3, 2]])
    >>> test = friedman(ScoreTable(subjects=("1", "2", "3"), conditions=("a", "b", "c"),
    ...                            scores=scores))
    >>> round(test.chi2, 3), round(test.p_exact, 3)
    (4.667, 0.194)
    """
    refusal = _refusal(table)
    if refusal is not None:
        return refusal
    ranks = doubled_midranks(table.scores)
    subjects, conditions = ranks.shape
    between, within = _sums_of_squares(ranks)
    if within == 0:
        return NoAnswer(reason="every subject gave all conditions the same score")
    chi2 = (conditions - 1) * between / within
    return Friedman(
        chi2=chi2,
        df=conditions - 1,
        p=float(chdtrc(conditions - 1, chi2)),
        p_exact=exact_p(ranks),
        kendall_w=chi2 / (subjects * (conditions - 1)),
        rank_sums=tuple(float(total) / 2 for total in ranks.sum(axis=0)),
    )


def _refusal(table: ScoreTable) -> NoAnswer | None:
    if len(table.conditions) < 2:
        return NoAnswer(reason="Friedman's test needs at least 2 conditions, got 1")
    if len(table.subjects) < 2:
        return NoAnswer(reason="Friedman's test needs at least 2 subjects to agree, got 1")
    if not table.is_complete:
        return NoAnswer(
            reason=f"Friedman's test needs every score, {table.missing_count} of "
            f"{table.scores.size} are missing"
        )
    return None


def _sums_of_squares(ranks: IntArray) -> tuple[int, int]:
    """Return the sums of squares of doubled rank sums and of doubled ranks about their means."""
    subjects, conditions = ranks.shape
    middle = conditions + 1
    between = ((ranks.sum(axis=0) - subjects * middle) ** 2).sum()
    return int(between), int(((ranks - middle) ** 2).sum())
