"""Intraclass correlations, with the target always named."""

from dataclasses import dataclass
from typing import Literal

from analysis.no_answer import NoAnswer
from analysis.scores import ScoreTable
from analysis.statistics.two_way import TwoWay, two_way

Target = Literal["subjects", "conditions"]


@dataclass(frozen=True, kw_only=True)
class IntraclassCorrelation:
    """How alike the scores of one target are, against how the targets differ.

    `agreement_single` is ICC(2,1), `consistency_single` ICC(3,1) and `consistency_mean` ICC(3,k)
    of Shrout and Fleiss (Psychological Bulletin 86, 1979). With `target` "subjects" they say how
    well one condition's score stands for a person; with "conditions", how well one person's
    score stands for a condition.
    """

    target: Target
    agreement_single: float | NoAnswer
    consistency_single: float | NoAnswer
    consistency_mean: float | NoAnswer


def intraclass_correlation(
    table: ScoreTable, *, target: Target
) -> IntraclassCorrelation | NoAnswer:
    """Return ICC(2,1), ICC(3,1) and ICC(3,k) of the target, or why there is none.

    They are ratios of the variances of targets, raters and residuals by the method of moments;
    with no cell missing these are Shrout and Fleiss' mean squares. A negative value says that
    targets differ less than chance makes them.
    """
    fit = two_way(table if target == "subjects" else table.transposed)
    if isinstance(fit, NoAnswer):
        return fit
    targets, residual = fit.row_variance, fit.residual_variance
    raters = len(fit.columns)
    return IntraclassCorrelation(
        target=target,
        agreement_single=_ratio(fit, targets, fit.column_variance + residual),
        consistency_single=_ratio(fit, targets, residual),
        consistency_mean=_ratio(fit, targets, residual / raters),
    )


def _ratio(fit: TwoWay, signal: float, noise: float) -> float | NoAnswer:
    total = signal + noise
    largest = fit.residual_variance + abs(fit.row_variance) + abs(fit.column_variance)
    if total <= 1e-12 * largest:
        return NoAnswer(reason="targets and residuals do not vary, so that there is no ratio")
    return signal / total
