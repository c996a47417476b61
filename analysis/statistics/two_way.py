"""Least-squares fit of rows and columns to an incomplete table, and intraclass correlations."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.sparse.csgraph import connected_components
from scipy.special import fdtri

from analysis.estimates import UPPER, BoolArray, FloatArray, Interval, NotEstimable, ScoreTable
from protocol.errors import listed


@dataclass(frozen=True, kw_only=True, eq=False)
class TwoWay:
    """The fit of `grand_mean + row + column` to a table that may have missing cells.

    Effects sum to zero over rows and over columns. `residuals` has NaN where a cell is missing.
    `row_squares` and `column_squares` are the sums of squares of each factor given the other;
    `table` is the fitted table, without the rows and columns that have no score at all.
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
        """Variance of rows by the method of moments; unbiased, so it may be negative.

        (7), mathematics/ordinal: E[SS(rows | columns)] = (N - columns) σ_row² + (rows - 1) σ² is
        Henderson's method III. With no cell missing it is (MS_row - MS_residual) / columns.
        """
        spare = self.row_squares - (len(self.rows) - 1) * self.residual_variance
        return float(spare / (self.table.given.sum() - len(self.columns)))

    @property
    def column_variance(self) -> float:
        """Variance of columns by the method of moments, as `row_variance`."""
        return self.transposed.row_variance

    @property
    def transposed(self) -> "TwoWay":
        """The same fit with conditions as rows."""
        return replace(
            self,
            table=self.table.transposed,
            rows=self.columns,
            columns=self.rows,
            residuals=self.residuals.T,
            row_squares=self.column_squares,
            column_squares=self.row_squares,
        )


def two_way(table: ScoreTable) -> TwoWay | NotEstimable:
    """Return the least-squares fit of rows and columns to the table, or why it is not possible.

    The longer of rows and columns is eliminated, so that the cost grows linearly with it.
    """
    if isinstance(kept := without_empty(table), NotEstimable):
        return kept
    if refusal := _refusal(kept):
        return refusal
    scores, given = kept.scores, kept.given
    centre = float(scores[given].mean())
    deviations = np.where(given, scores - centre, 0.0)
    row_effects, column_effects = _effects(deviations, given)
    residuals = np.where(given, deviations - row_effects[:, None] - column_effects, 0.0)
    # Sums of squares within rounding error of 0 count as 0, so that equal scores have no variance.
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
        residuals=np.where(given, residuals * (residual > 0), np.nan),
        row_squares=max(0.0, by_rows - residual),
        column_squares=max(0.0, by_columns - residual),
        residual_squares=residual,
    )


def without_empty(table: ScoreTable) -> ScoreTable | NotEstimable:
    """Return the table without the subjects and conditions that have no score at all."""
    rows, columns = table.given.any(axis=1), table.given.any(axis=0)
    if not rows.any():
        return NotEstimable("no score was given")
    return ScoreTable(
        subjects=tuple(np.array(table.subjects, dtype=object)[rows]),
        conditions=tuple(np.array(table.conditions, dtype=object)[columns]),
        scores=table.scores[np.ix_(rows, columns)],
    )


def _refusal(table: ScoreTable) -> NotEstimable | None:
    if len(table.subjects) < 2 or len(table.conditions) < 2:
        return NotEstimable(
            "effects of subjects and conditions need at least 2 of each with a score, got "
            f"{len(table.subjects)} and {len(table.conditions)}"
        )
    if refusal := disconnected(table.given, table.conditions):
        return refusal
    if table.given.sum() < len(table.subjects) + len(table.conditions):
        return NotEstimable("there are as many effects as scores, so there is no residual")
    return None


def disconnected(given: BoolArray, conditions: tuple[str, ...]) -> NotEstimable | None:
    """Return which conditions no chain of subjects compares with the rest, None if all are linked.

    `given` has shape (subjects, conditions); each subject and condition has a score.
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


def _effects(deviations: FloatArray, given: BoolArray) -> tuple[FloatArray, FloatArray]:
    if given.shape[0] < given.shape[1]:
        columns, rows = _effects(deviations.T, given.T)
        return rows, columns
    weights = given.astype(np.float64)
    per_row = weights.sum(axis=1)
    row_means = deviations.sum(axis=1) / per_row
    # (6), mathematics/ordinal
    normal = np.diag(weights.sum(axis=0)) - weights.T @ (weights / per_row[:, None])
    right = deviations.sum(axis=0) - weights.T @ row_means
    # The system determines columns up to a constant; the shortest solution has mean zero.
    columns = np.linalg.lstsq(normal, right)[0]
    return row_means - weights @ columns / per_row, columns


def _squares_about_means(deviations: FloatArray, given: BoolArray, *, axis: int) -> float:
    means = deviations.sum(axis=axis, keepdims=True) / given.sum(axis=axis, keepdims=True)
    return float((np.where(given, deviations - means, 0.0) ** 2).sum())


Target = Literal["subjects", "conditions"]


@dataclass(frozen=True, kw_only=True)
class IntraclassCorrelation:
    """Intraclass correlations: the variance between targets as a share of the total.

    `agreement_single` is ICC(2,1), `consistency_single` ICC(3,1) and `consistency_mean` ICC(3,k)
    of Shrout and Fleiss (Psychological Bulletin 86, 1979). With `target` "subjects" they measure
    how well the score under one condition represents a person; with "conditions", how well one
    person's score represents a condition. `intervals` has the 95% interval of each, by its name.
    """

    target: Target
    agreement_single: float | NotEstimable
    consistency_single: float | NotEstimable
    consistency_mean: float | NotEstimable
    intervals: Mapping[str, Interval] | NotEstimable


def intraclass_correlation(
    table: ScoreTable, *, target: Target
) -> IntraclassCorrelation | NotEstimable:
    """Return ICC(2,1), ICC(3,1) and ICC(3,k) of the target, or why they are not estimable.

    They are ratios of the variances of targets, raters and residuals by the method of moments;
    with no cell missing these are Shrout and Fleiss' mean squares. A negative value means that
    targets differ less than expected by chance.
    """
    if isinstance(fit := two_way(table), NotEstimable):
        return fit
    if target == "conditions":
        fit = fit.transposed
    targets, residual = fit.row_variance, fit.residual_variance  # (9), mathematics/ordinal
    agreement = _ratio(fit, targets, fit.column_variance + residual)
    return IntraclassCorrelation(
        target=target,
        agreement_single=agreement,
        consistency_single=_ratio(fit, targets, residual),
        consistency_mean=_ratio(fit, targets, residual / len(fit.columns)),
        intervals=agreement
        if isinstance(agreement, NotEstimable)
        else _icc_intervals(fit, agreement),
    )


@np.errstate(divide="ignore", invalid="ignore")  # ends that are not finite are refused below
def _icc_intervals(fit: TwoWay, agreement: float) -> Mapping[str, Interval] | NotEstimable:
    """Return the F-based intervals (McGraw and Wong, Psychological Methods 1, 1996, table 7).

    With cells missing, the numbers of scores per target and per rater are those of Henderson's
    method III, as in `TwoWay.row_variance`, and the intervals are approximate.
    """
    targets, raters, df = len(fit.rows), len(fit.columns), fit.residual_df
    given, noise = int(fit.table.given.sum()), fit.residual_variance
    if noise <= 0:
        return NotEstimable("there is no residual, so there is no interval")
    if fit.row_squares <= 0:
        return NotEstimable("the targets do not differ, so there is no interval")
    n, k = (given - targets) / (raters - 1), (given - raters) / (targets - 1)
    rows, columns = fit.row_squares / (targets - 1), fit.column_squares / (raters - 1)
    f = rows / noise
    ends = fdtri(targets - 1, df, UPPER), fdtri(df, targets - 1, UPPER)
    signal = np.array([f / ends[0] - 1, f * ends[1] - 1])
    share = np.float64(k * agreement / (n * (1 - agreement)) if agreement < 1 else 0.0)
    level, rest = share * columns, (1 + share * (n - 1)) * noise
    v = (level + rest) ** 2 / (level**2 / (raters - 1) + rest**2 / df)
    below, above = fdtri(targets - 1, v, UPPER), fdtri(v, targets - 1, UPPER)
    both = k * columns + (k * n - k - n) * noise
    agree = np.array(
        [
            n * (rows - below * noise) / (below * both + n * rows),
            n * (above * rows - noise) / (both + n * above * rows),
        ]
    )
    found: dict[str, FloatArray] = {
        "agreement_single": agree,
        "consistency_single": signal / (signal + k),
        "consistency_mean": signal / (signal + k / raters),
    }
    if not all(np.isfinite(ends).all() and ends[0] <= ends[1] for ends in found.values()):
        return NotEstimable("the mean squares do not determine an interval")
    return {name: (float(ends[0]), float(ends[1])) for name, ends in found.items()}


def _ratio(fit: TwoWay, signal: float, noise: float) -> float | NotEstimable:
    total = signal + noise
    largest = fit.residual_variance + abs(fit.row_variance) + abs(fit.column_variance)
    if total <= 1e-12 * largest:
        return NotEstimable("targets and residuals do not vary, so their ratio is undefined")
    return signal / total
