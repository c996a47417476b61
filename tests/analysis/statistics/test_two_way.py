"""The two-way fit and its statistics against dense regressions."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from analysis.estimates import FloatArray, NotEstimable, ScoreTable
from analysis.statistics.additive import (
    AdditiveEffects,
    GainHeterogeneity,
    additive_effects,
    gain_heterogeneity,
)
from analysis.statistics.two_way import (
    IntraclassCorrelation,
    TwoWay,
    intraclass_correlation,
    two_way,
)

TableOf = Callable[[FloatArray], ScoreTable]
SHAPES = st.tuples(st.integers(1, 7), st.integers(1, 6))
CELLS = st.integers(0, 10).map(float)
TABLES = SHAPES.flatmap(lambda shape: arrays(np.float64, shape, elements=CELLS))
INCOMPLETE = SHAPES.flatmap(
    lambda shape: arrays(np.float64, shape, elements=CELLS | st.just(np.nan))
)


def dense_squares(scores: FloatArray, *, rows: bool, columns: bool) -> tuple[float, int]:
    """Residual sum of squares and rank of the dummy-variable regression."""
    row, column = np.nonzero(~np.isnan(scores))
    parts = [np.ones((len(row), 1))]
    parts += [np.eye(scores.shape[0])[row]] * rows + [np.eye(scores.shape[1])[column]] * columns
    design = np.hstack(parts)
    y = scores[row, column]
    fitted = design @ np.linalg.lstsq(design, y)[0]
    return float(((y - fitted) ** 2).sum()), int(np.linalg.matrix_rank(design))


def effects_of(table: ScoreTable) -> AdditiveEffects:
    result = additive_effects(table)
    assert isinstance(result, AdditiveEffects)
    return result


def icc_of(scores: FloatArray, table_of: TableOf) -> IntraclassCorrelation:
    result = intraclass_correlation(table_of(scores), target="subjects")
    assert isinstance(result, IntraclassCorrelation)
    return result


@settings(max_examples=200, deadline=None)
@given(INCOMPLETE)
def test_incomplete_tables_agree_with_dummy_variables(
    table_of: TableOf, scores: FloatArray
) -> None:
    fit = two_way(table_of(scores))
    if isinstance(fit, NotEstimable):
        return
    squares, rank = dense_squares(scores, rows=True, columns=True)
    assert fit.residual_df == np.count_nonzero(~np.isnan(scores)) - rank
    assert fit.residual_squares == pytest.approx(squares, rel=1e-10, abs=1e-10)
    columns_only, _ = dense_squares(scores, rows=False, columns=True)
    assert fit.row_squares == pytest.approx(columns_only - squares, rel=1e-10, abs=1e-9)
    rows_only, _ = dense_squares(scores, rows=True, columns=False)
    assert fit.column_squares == pytest.approx(rows_only - squares, rel=1e-10, abs=1e-9)


@settings(max_examples=200, deadline=None)
@given(INCOMPLETE)
def test_a_fit_exists_exactly_when_dummy_variables_determine_it(
    table_of: TableOf, scores: FloatArray
) -> None:
    rows, columns = (~np.isnan(scores)).any(1).sum(), (~np.isnan(scores)).any(0).sum()
    assume(rows > 0)
    _, rank = dense_squares(scores, rows=True, columns=True)
    count = np.count_nonzero(~np.isnan(scores))
    solvable = min(rows, columns) >= 2 and rank == rows + columns - 1 and count > rank
    assert isinstance(two_way(table_of(scores)), TwoWay) == solvable


@settings(max_examples=150, deadline=None)
@given(TABLES)
def test_complete_tables_agree_with_shrout_and_fleiss(
    table_of: TableOf, scores: FloatArray
) -> None:
    n, k = scores.shape
    if min(n, k) < 2:
        return
    between = k * np.var(scores.mean(1), ddof=1)
    raters = n * np.var(scores.mean(0), ddof=1)
    residual = ((scores - scores.mean(1)[:, None] - scores.mean(0) + scores.mean()) ** 2).sum()
    residual /= (n - 1) * (k - 1)
    result = icc_of(scores, table_of)
    pairs = [
        (
            result.agreement_single,
            between + (k - 1) * residual + k * (raters - residual) / n,
        ),
        (result.consistency_single, between + (k - 1) * residual),
        (result.consistency_mean, between),
    ]
    for value, denominator in pairs:
        if isinstance(value, NotEstimable):
            assert denominator == pytest.approx(0.0, abs=1e-9)
        else:
            assert value == pytest.approx((between - residual) / denominator, rel=1e-7, abs=1e-10)


def test_icc_of_table_4_with_its_target_named(published: ScoreTable) -> None:
    subjects = intraclass_correlation(published, target="subjects")
    conditions = intraclass_correlation(published, target="conditions")
    assert isinstance(subjects, IntraclassCorrelation)
    assert isinstance(conditions, IntraclassCorrelation)
    assert (subjects.target, conditions.target) == ("subjects", "conditions")
    assert [
        subjects.agreement_single,
        subjects.consistency_single,
        subjects.consistency_mean,
    ] == pytest.approx([0.160075, 1 / 3, 5 / 7], abs=5e-7)
    assert [
        conditions.agreement_single,
        conditions.consistency_single,
        conditions.consistency_mean,
    ] == pytest.approx([0.519774, 0.618834, 0.935946], abs=5e-7)


def test_effects_of_table_4(published: ScoreTable) -> None:
    result = effects_of(published)
    assert list(result.conditions) == list(published.conditions)
    assert list(result.conditions.values()) == pytest.approx(
        [0.1333, 0.5778, 1.3556, 0.0222, -2.0889], abs=5e-5
    )
    assert list(result.subjects.values()) == pytest.approx(
        [0.289, 0.689, -1.311, 1.289, -0.511, 0.689, -0.111, -0.311, -0.711], abs=5e-4
    )
    assert result.grand_mean == pytest.approx(374 / 45, rel=1e-14)
    assert result.residual_df == 32
    assert result.residual_sd == pytest.approx(0.971825, abs=5e-7)
    assert result.subject_sd == pytest.approx(0.687184, abs=5e-7)
    assert result.shrinkage == pytest.approx(0.714286, abs=5e-7)
    assert set(result.subject_shrinkage.values()) == {result.shrinkage}


def test_gain_heterogeneity_of_table_4(published: ScoreTable) -> None:
    result = gain_heterogeneity(published)
    assert isinstance(result, GainHeterogeneity)
    assert result.df == (8, 24)
    assert result.f == pytest.approx(0.978, abs=5e-4)
    assert result.p == pytest.approx(0.3721, abs=5e-4)
    assert result.tau == 0.0
    assert np.mean(list(result.gains.values())) == pytest.approx(1.0, abs=1e-12)


def dense_slopes(scores: FloatArray) -> tuple[float, tuple[int, int], float, FloatArray]:
    """F, degrees of freedom, moment τ and slopes - 1 of a regression with all columns written out.

    The slopes are the shortest solution: they are determined up to a constant.
    """
    row, column = np.nonzero(~np.isnan(scores))
    y = scores[row, column]
    levels = np.hstack([np.eye(scores.shape[0])[row], np.eye(scores.shape[1])[column]])
    effects = np.linalg.lstsq(levels, y)[0][scores.shape[0] :]
    onto_levels = levels @ np.linalg.pinv(levels)
    slopes = np.eye(scores.shape[0])[row] * effects[column][:, None]
    slopes -= onto_levels @ slopes
    residuals = y - onto_levels @ y
    found = np.linalg.lstsq(slopes, residuals, rcond=1e-8)[0]
    left = residuals - slopes @ found
    added = int((np.linalg.svd(slopes, compute_uv=False) > 1e-8).sum())
    df = (added, len(y) - int(np.linalg.matrix_rank(levels)) - added)
    variance = (left @ left) / df[1]
    extra = residuals @ residuals - left @ left
    tau = np.sqrt(max(0.0, (extra - added * variance) / (slopes**2).sum()))
    return float(extra / added / variance), df, float(tau), np.asarray(found, dtype=np.float64)


@pytest.mark.parametrize("missing", [0.0, 0.15, 0.4])
def test_gain_heterogeneity_agrees_with_every_column_written(
    table_of: TableOf, missing: float
) -> None:
    rng = np.random.default_rng(8)
    scores = rng.normal(size=(8, 1)) + np.outer(rng.uniform(0, 3, 8), np.arange(5.0))
    scores += rng.normal(0.0, 0.5, (8, 5))
    scores[rng.random((8, 5)) < missing] = np.nan
    result = gain_heterogeneity(table_of(scores))
    f, df, tau, excess = dense_slopes(scores)
    assert isinstance(result, GainHeterogeneity)
    assert result.df == df == (7, int((~np.isnan(scores)).sum()) - 12 - 7)
    assert result.f == pytest.approx(f, rel=1e-9)
    assert result.tau == pytest.approx(tau, rel=1e-9)
    assert list(result.gains.values()) == pytest.approx(1 + excess - excess.mean(), rel=1e-8)


@pytest.mark.parametrize("effect", [0.0, 1.0])
@pytest.mark.parametrize("missing", [0.0, 0.2])
def test_equal_slopes_of_people_who_scatter_differently_are_seldom_rejected(
    table_of: TableOf, effect: float, missing: float
) -> None:
    rng = np.random.default_rng(6)
    scatter = np.array([2.8, *[0.7] * 8])[:, None]
    found = []
    for _ in range(400):
        scores = effect * np.array([0.1, 0.6, 1.4, 0.0, -2.1]) + scatter * rng.normal(size=(9, 5))
        scores[rng.random((9, 5)) < missing] = np.nan
        result = gain_heterogeneity(table_of(scores), shuffles=99)
        if isinstance(result, GainHeterogeneity):
            found.append((result.p <= 0.05, stats.f.sf(result.f, *result.df) <= 0.05))
    assert len(found) > 390
    rate, of_mandel = np.mean(found, axis=0)
    error = np.sqrt(0.05 * 0.95 / len(found))
    assert rate <= 0.05 + 2 * error
    assert of_mandel > 0.05 + 2 * error  # Mandel's F supposes that all scatter alike


@pytest.mark.parametrize(("noise", "power"), [([1.0] * 9, 0.8), ([2.8, *[0.7] * 8], 0.8)])
def test_different_slopes_are_found(table_of: TableOf, noise: list[float], power: float) -> None:
    rng = np.random.default_rng(7)
    scatter = np.array(noise)[:, None]
    found = []
    for _ in range(100):
        gains = rng.normal(1.0, 0.6, (9, 1))
        scores = gains * np.linspace(-3, 3, 5) + scatter * rng.normal(size=(9, 5))
        result = gain_heterogeneity(table_of(scores), shuffles=99)
        assert isinstance(result, GainHeterogeneity)
        found.append(result.p <= 0.05)
    assert np.mean(found) > power


def test_a_slope_confounded_with_one_condition_is_not_compared(table_of: TableOf) -> None:
    # No other subject scored the last condition, so its level and s0's slope are confounded.
    scores = np.array(
        [[2.0, np.nan, np.nan, 9.0], [1, 4, 6, np.nan], [3, 4, 8, np.nan], [2, 6, 6, np.nan]]
    )
    result = gain_heterogeneity(table_of(scores))
    assert isinstance(result, GainHeterogeneity)
    assert list(result.gains) == ["s1", "s2", "s3"]
    assert result.df == (2, 2)
    assert np.mean(list(result.gains.values())) == pytest.approx(1.0, rel=1e-12)


def test_a_known_spread_of_gains_is_recovered(table_of: TableOf) -> None:
    rng = np.random.default_rng(2)
    gains = rng.normal(1.0, 0.3, 400)
    scores = np.outer(gains, [-4.0, -1.0, 0.0, 2.0, 3.0]) + rng.normal(0.0, 1.0, (400, 5))
    result = gain_heterogeneity(table_of(scores))
    assert isinstance(result, GainHeterogeneity)
    assert result.tau == pytest.approx(0.3, abs=0.04)
    assert result.p == 1 / (1 + 3_000_000 // 2000)


def test_variances_of_incomplete_tables_are_unbiased(table_of: TableOf) -> None:
    rng = np.random.default_rng(5)
    holes = rng.random((12, 5)) < 0.25
    estimates = []
    for _ in range(400):
        scores = rng.normal(0, 1.5, (12, 1)) + rng.normal(0, 2.0, 5) + rng.normal(0, 1.0, (12, 5))
        fit = two_way(table_of(np.where(holes, np.nan, scores)))
        assert isinstance(fit, TwoWay)
        estimates.append([fit.row_variance, fit.column_variance, fit.residual_variance])
    error = np.std(estimates, axis=0) / np.sqrt(len(estimates))
    assert (np.abs(np.mean(estimates, axis=0) - [2.25, 4.0, 1.0]) < 4 * error).all()


def test_subjects_with_fewer_scores_are_shrunk_more(table_of: TableOf) -> None:
    scores = np.array([[1.0, 2, 4], [5, 6, 6], [9, 9, np.nan], [3, 3, 5]])
    result = effects_of(table_of(scores))
    assert result.subject_shrinkage["s2"] < result.subject_shrinkage["s0"]  # type: ignore[operator]
    assert result.subject_shrinkage["s0"] == result.shrinkage


def test_a_subject_without_scores_has_no_effect(table_of: TableOf) -> None:
    scores = np.array([[1.0, 2, 4], [np.nan] * 3, [5, 6, 6]])
    assert list(effects_of(table_of(scores)).subjects) == ["s0", "s2"]


@pytest.mark.parametrize(
    ("scores", "reason"),
    [
        ([[np.nan, np.nan]], "no score was given"),
        ([[1.0, 2.0]], "at least 2 of each with a score, got 1 and 2"),
        ([[1.0], [2.0]], "at least 2 of each with a score, got 2 and 1"),
        ([[1.0, np.nan], [np.nan, 2.0]], "no chain of subjects compares c0 with"),
        ([[1.0, 2.0], [1.0, np.nan]], "so there is no residual"),
    ],
)
def test_tables_without_effects_give_the_reason(
    table_of: TableOf, scores: list[list[float]], reason: str
) -> None:
    results = [
        additive_effects(table_of(np.array(scores))),
        gain_heterogeneity(table_of(np.array(scores))),
        intraclass_correlation(table_of(np.array(scores)), target="subjects"),
        intraclass_correlation(table_of(np.array(scores)), target="conditions"),
    ]
    for result in results:
        assert isinstance(result, NotEstimable)
        assert reason in result.reason


def test_equal_scores_have_effects_of_zero_and_no_correlation(table_of: TableOf) -> None:
    scores = np.full((4, 3), 0.1)
    effects = effects_of(table_of(scores))
    assert (effects.residual_sd, effects.subject_sd) == (0.0, 0.0)
    assert effects.shrinkage == NotEstimable("neither subjects nor residuals vary")
    assert isinstance(icc_of(scores, table_of).consistency_single, NotEstimable)
    assert gain_heterogeneity(table_of(scores)) == NotEstimable(
        "the conditions do not differ, so slopes cannot be estimated"
    )


@pytest.mark.parametrize("row", [[9, 9, 10, 8, 10], [7, 5, 8, 9, 4], [1, 2, 3, 4, 7]])
def test_rounding_is_no_spread_of_gains(table_of: TableOf, row: list[int]) -> None:
    for subjects in range(3, 12):
        found = gain_heterogeneity(table_of(np.tile(np.array(row, dtype=float), (subjects, 1))))
        assert isinstance(found, NotEstimable)
        assert "fit the scores exactly" in found.reason
