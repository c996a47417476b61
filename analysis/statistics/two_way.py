"""Least squares on an incomplete table of rows and columns: what ICC and effects are made of."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from analysis.estimates import FloatArray, NotEstimable
from analysis.loading.score_table import BoolArray, ScoreTable


@dataclass(frozen=True, kw_only=True, eq=False)
class TwoWay:
    """The fit of `grand_mean + row + column` to a table in which cells may be missing.

    Effects sum to zero over rows and over columns. `residuals` has NaN where a cell is missing.
    `row_squares` and `column_squares` are the sums of squares of each factor given the other;
    `table` is the table fitted, without the rows and columns that have no score at all.
    """

    table: ScoreTable
    grand_mean: float
    rows: FloatArray
    columns: FloatArray
    residuals: FloatArray
    row_squares: float
    column_squares: float
    residual_squares: float

    @property
    def residual_df(self) -> int:
        """Degrees of freedom of the residuals, at least 1."""
        return int(self.table.given.sum()) - len(self.rows) - len(self.columns) + 1

    @property
    def residual_variance(self) -> float:
        """Mean square of the residuals."""
        return self.residual_squares / self.residual_df

    @property
    def row_variance(self) -> float:
        """Variance of rows by the method of moments, unbiased and so possibly negative.

        Henderson's method III: E[SS(rows | columns)] = (N - columns) σ_row² + (rows - 1) σ².
        With no cell missing it is (MS_row - MS_residual) / columns.
        """
        spare = self.row_squares - (len(self.rows) - 1) * self.residual_variance
        return float(spare / (self.table.given.sum() - len(self.columns)))

    @property
    def column_variance(self) -> float:
        """Variance of columns by the method of moments, as `row_variance`."""
        spare = self.column_squares - (len(self.columns) - 1) * self.residual_variance
        return float(spare / (self.table.given.sum() - len(self.rows)))


def two_way(table: ScoreTable) -> TwoWay | NotEstimable:
    """Return the least-squares fit of rows and columns to the table, or why there is none.

    Rows are eliminated where there are more of them (columns otherwise), so that the cost grows
    linearly with the longer side.
    """
    kept = without_empty(table)
    refusal = _refusal(kept)
    if refusal is not None:
        return refusal
    assert isinstance(kept, ScoreTable)
    scores, given = kept.scores, kept.given
    centre = float(scores[given].mean())
    deviations = np.where(given, scores - centre, 0.0)
    row_effects, column_effects = _effects(deviations, given)
    residuals = np.where(given, deviations - row_effects[:, None] - column_effects, 0.0)
    noise = given.sum() * (1e-12 * float(np.abs(scores[given]).max())) ** 2
    squares = [
        _squares_about_means(deviations, given, axis=0),
        _squares_about_means(deviations, given, axis=1),
        float((residuals**2).sum()),
    ]
    by_rows, by_columns, residual = (0.0 if value <= noise else value for value in squares)
    return TwoWay(
        table=kept,
        grand_mean=centre + float(row_effects.mean()) + float(column_effects.mean()),
        rows=row_effects - row_effects.mean(),
        columns=column_effects - column_effects.mean(),
        residuals=np.where(given, residuals, np.nan),
        row_squares=max(0.0, by_rows - residual),
        column_squares=max(0.0, by_columns - residual),
        residual_squares=residual,
    )


def without_empty(table: ScoreTable) -> ScoreTable | NotEstimable:
    """Return the table without the subjects and conditions that have no score at all."""
    rows, columns = table.given.any(axis=1), table.given.any(axis=0)
    if not rows.any():
        return NotEstimable(reason="no score was given")
    return ScoreTable(
        subjects=tuple(np.array(table.subjects, dtype=object)[rows]),
        conditions=tuple(np.array(table.conditions, dtype=object)[columns]),
        scores=table.scores[np.ix_(rows, columns)],
    )


def _refusal(table: ScoreTable | NotEstimable) -> NotEstimable | None:
    if isinstance(table, NotEstimable):
        return table
    if len(table.subjects) < 2 or len(table.conditions) < 2:
        return NotEstimable(
            reason="effects of subjects and conditions need at least 2 of each with a score, got "
            f"{len(table.subjects)} and {len(table.conditions)}"
        )
    linked = linked_columns(table.given)
    if not linked.all():
        apart = [
            name for name, is_linked in zip(table.conditions, linked, strict=True) if is_linked
        ]
        return NotEstimable(
            reason=f"no chain of subjects compares {', '.join(apart)} with the other conditions"
        )
    if table.given.sum() < len(table.subjects) + len(table.conditions):
        return NotEstimable(
            reason="there are as many effects as scores, none is left for the residual"
        )
    return None


def linked_columns(given: BoolArray) -> BoolArray:
    """Return which columns are compared with the first one, directly or through other rows."""
    reached: BoolArray = np.arange(given.shape[1]) == 0
    while True:
        further = np.asarray(given[given[:, reached].any(axis=1)].any(axis=0))
        if (further <= reached).all():
            return reached
        reached = reached | further


def _effects(deviations: FloatArray, given: BoolArray) -> tuple[FloatArray, FloatArray]:
    if given.shape[0] < given.shape[1]:
        columns, rows = _effects(deviations.T, given.T)
        return rows, columns
    weights = given.astype(np.float64)
    per_row = weights.sum(axis=1)
    row_means = deviations.sum(axis=1) / per_row
    normal = np.diag(weights.sum(axis=0)) - weights.T @ (weights / per_row[:, None])
    right = deviations.sum(axis=0) - weights.T @ row_means
    # Adding the same to all columns changes nothing: the shortest solution has mean zero.
    columns = np.linalg.lstsq(normal, right)[0]
    return row_means - weights @ columns / per_row, columns


def _squares_about_means(deviations: FloatArray, given: BoolArray, *, axis: int) -> float:
    means = deviations.sum(axis=axis, keepdims=True) / given.sum(axis=axis, keepdims=True)
    return float((np.where(given, deviations - means, 0.0) ** 2).sum())


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
    agreement_single: float | NotEstimable
    consistency_single: float | NotEstimable
    consistency_mean: float | NotEstimable


def intraclass_correlation(
    table: ScoreTable, *, target: Target
) -> IntraclassCorrelation | NotEstimable:
    """Return ICC(2,1), ICC(3,1) and ICC(3,k) of the target, or why there is none.

    They are ratios of the variances of targets, raters and residuals by the method of moments;
    with no cell missing these are Shrout and Fleiss' mean squares. A negative value says that
    targets differ less than chance makes them.
    """
    fit = two_way(table if target == "subjects" else table.transposed)
    if isinstance(fit, NotEstimable):
        return fit
    targets, residual = fit.row_variance, fit.residual_variance
    raters = len(fit.columns)
    return IntraclassCorrelation(
        target=target,
        agreement_single=_ratio(fit, targets, fit.column_variance + residual),
        consistency_single=_ratio(fit, targets, residual),
        consistency_mean=_ratio(fit, targets, residual / raters),
    )


def _ratio(fit: TwoWay, signal: float, noise: float) -> float | NotEstimable:
    total = signal + noise
    largest = fit.residual_variance + abs(fit.row_variance) + abs(fit.column_variance)
    if total <= 1e-12 * largest:
        return NotEstimable(reason="targets and residuals do not vary, so that there is no ratio")
    return signal / total
