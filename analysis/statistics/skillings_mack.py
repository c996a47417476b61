"""The Skillings-Mack test: Friedman's question asked of a table with missing scores."""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from analysis.no_answer import NoAnswer
from analysis.scores import FloatArray, ScoreTable
from analysis.statistics.ranks import doubled_midranks
from analysis.statistics.two_way import linked_columns, without_empty


@dataclass(frozen=True, kw_only=True)
class SkillingsMack:
    """The Skillings-Mack test of equal conditions; p is of the chi-square approximation.

    `statistic` is corrected for ties and so equals Friedman's χ² when no score is missing;
    `untied` is the statistic as first published, which takes every score to differ. `left_out` has
    the conditions that nobody scored, which the test cannot speak of.
    """

    statistic: float
    df: int
    p: float
    untied: float
    left_out: tuple[str, ...] = ()


def skillings_mack(table: ScoreTable) -> SkillingsMack | NoAnswer:
    """Return the Skillings-Mack test of the table, or why there is none.

    T = A' Σ⁻ A with A_j = Σ_i √(12/(k_i+1)) (r_ij - (k_i+1)/2), ranks within the k_i scores of
    subject i (Skillings and Mack, Technometrics 23, 1981, 171-177). Differs from the paper: Σ has
    the variance of each subject's tied ranks in place of that of k_i different ones.
    """
    kept = without_empty(table)
    if isinstance(kept, NoAnswer):
        return kept
    scores = kept.scores[kept.given.sum(axis=1) >= 2]
    refusal = _refusal(kept, scores)
    if refusal is not None:
        return refusal
    deviations, counts = _weighted_ranks(scores)
    variances = (deviations**2).sum(axis=1) / (counts - 1)
    total = deviations.sum(axis=0)
    if not variances.any():
        return NoAnswer(reason="every subject gave all conditions the same score")
    tied, rank = _quadratic_form(total, _covariance(scores, variances / counts))
    untied, _ = _quadratic_form(total, _covariance(scores, np.ones(len(scores))))
    return SkillingsMack(
        statistic=tied,
        df=rank,
        p=float(chdtrc(rank, tied)),
        untied=untied,
        left_out=tuple(name for name in table.conditions if name not in kept.conditions),
    )


def _refusal(table: ScoreTable, scores: FloatArray) -> NoAnswer | None:
    if not len(scores):
        return NoAnswer(reason="no subject scored two conditions")
    if len(scores) < 2:
        return NoAnswer(reason="at least 2 subjects who scored two conditions must agree, got 1")
    linked = linked_columns(~np.isnan(scores))
    if not linked.all():
        apart = [name for name, known in zip(table.conditions, linked, strict=True) if known]
        return NoAnswer(
            reason=f"no chain of subjects compares {', '.join(apart)} with the other conditions"
        )
    return None


def _weighted_ranks(scores: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the ranks about their middle, weighted by √(12/(k_i+1)), and the counts k_i."""
    given = ~np.isnan(scores)
    counts = given.sum(axis=1).astype(np.float64)
    middle = (counts + 1) / 2
    deviations = np.where(given, doubled_midranks(scores) / 2 - middle[:, None], 0.0)
    return deviations * np.sqrt(12 / (counts + 1))[:, None], counts


def _covariance(scores: FloatArray, shares: FloatArray) -> FloatArray:
    """Return the covariance of the weighted sums: each subject takes its share off each pair."""
    given = (~np.isnan(scores)).astype(np.float64)
    together = given.T @ (given * shares[:, None])
    np.fill_diagonal(together, 0.0)
    return np.diag(together.sum(axis=1)) - together


def _quadratic_form(total: FloatArray, covariance: FloatArray) -> tuple[float, int]:
    inverse = np.linalg.pinv(covariance, rtol=1e-10, hermitian=True)
    rank = int(np.linalg.matrix_rank(covariance, tol=1e-10 * covariance.max(), hermitian=True))
    return float(total @ inverse @ total), rank
