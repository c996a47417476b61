"""Intervals of effect sizes against published values, scipy and dense regressions."""

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from scipy import stats

from analysis.estimates import FloatArray, NotEstimable, ScoreTable
from analysis.report.report import report_html
from analysis.statistics.additive import AdditiveEffects, additive_effects
from analysis.statistics.intervals import (
    concordance_interval,
    mean_interval,
    rank_biserial_interval,
)
from analysis.statistics.two_way import IntraclassCorrelation, intraclass_correlation
from tests.analysis.reports import made

TableOf = Callable[[FloatArray], ScoreTable]

# Shrout and Fleiss 1979, table 2: four judges rate six targets.
JUDGES = np.array(
    [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7.0]]
)


def effects_of(table: ScoreTable) -> AdditiveEffects:
    found = additive_effects(table)
    assert isinstance(found, AdditiveEffects)
    return found


def test_the_published_correlations_have_the_intervals_of_rs_psych(table_of: TableOf) -> None:
    found = intraclass_correlation(table_of(JUDGES), target="subjects")
    assert isinstance(found, IntraclassCorrelation)
    assert isinstance(found.intervals, Mapping)
    assert found.intervals["agreement_single"] == pytest.approx((0.019, 0.761), abs=6e-4)
    assert found.intervals["consistency_single"] == pytest.approx((0.342, 0.946), abs=6e-4)
    assert found.intervals["consistency_mean"] == pytest.approx((0.676, 0.986), abs=6e-4)


def test_correlations_without_a_residual_have_no_interval(table_of: TableOf) -> None:
    found = intraclass_correlation(
        table_of(np.add.outer(np.arange(3.0), np.arange(4.0))), target="subjects"
    )
    assert isinstance(found, IntraclassCorrelation)
    assert found.intervals == NotEstimable("there is no residual, so there is no interval")


def test_targets_that_do_not_differ_have_no_interval(table_of: TableOf) -> None:
    scores = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 1.0]])
    found = intraclass_correlation(table_of(scores), target="subjects")
    assert isinstance(found, IntraclassCorrelation)
    assert found.intervals == NotEstimable("the targets do not differ, so there is no interval")


def test_effects_of_conditions_have_the_t_interval_of_the_subjects_own(
    published: ScoreTable,
) -> None:
    own = published.scores - published.scores.mean(axis=1, keepdims=True)
    expected = stats.ttest_1samp(own, 0.0).confidence_interval()
    found = np.array(list(effects_of(published).condition_intervals.values()))
    assert found[:, 0] == pytest.approx(expected.low - 0, abs=1e-10)
    assert found[:, 1] == pytest.approx(expected.high - 0, abs=1e-10)


def test_effects_of_subjects_have_the_error_of_a_dense_regression(table_of: TableOf) -> None:
    scores = np.where(np.arange(24).reshape(6, 4) % 7 == 3, np.nan, JUDGES)
    row, column = np.nonzero(~np.isnan(scores))
    # Deviations coding: effects sum to zero, the last is minus the sum of the others.
    rows, columns = (np.vstack([np.eye(n - 1), -np.ones(n - 1)]) for n in (6, 4))
    design = np.column_stack([np.ones(len(row)), rows[row], columns[column]])
    y = scores[row, column]
    fitted, residual, _, _ = np.linalg.lstsq(design, y)
    df = len(y) - design.shape[1]
    covariance = np.linalg.inv(design.T @ design) * residual[0] / df
    half = stats.t.ppf(0.975, df) * np.sqrt(covariance[1, 1])
    found = effects_of(table_of(scores)).subject_intervals["s0"]
    assert found == pytest.approx((fitted[1] - half, fitted[1] + half), rel=1e-9)


def test_a_mean_has_the_t_interval() -> None:
    values = np.array([1.0, 3.0, 4.0, 0.0])
    expected = stats.ttest_1samp(values, 0.0).confidence_interval()
    assert mean_interval(values) == pytest.approx((expected.low, expected.high), rel=1e-12)


@pytest.mark.parametrize("n", [1, 5, 9, 40])
@pytest.mark.parametrize("r", [-1.0, -0.4, 0.0, 0.7, 1.0])
def test_the_ends_for_a_rank_biserial_are_where_its_test_gives_05(r: float, n: int) -> None:
    variance = n * (n + 1) * (2 * n + 1) / 24 / (n * (n + 1) / 4) ** 2
    for end in rank_biserial_interval(r, n):
        assert -1 <= end <= 1
        z2 = stats.norm.ppf(0.975) ** 2
        assert (r - end) ** 2 == pytest.approx(z2 * (1 - end**2) * variance, abs=1e-12)


def test_the_interval_of_concordance_is_the_jackknife_of_rank_correlations() -> None:
    scores = np.random.default_rng(3).normal(size=(8, 5)) + np.arange(5)
    ranks = np.array([stats.rankdata(row) - 3 for row in scores])

    def mean_r(chosen: FloatArray) -> float:
        pairs = np.corrcoef(chosen)[np.triu_indices(len(chosen), 1)]
        return float(np.arctanh(pairs.mean()))

    left_out = np.array([mean_r(np.delete(ranks, one, axis=0)) for one in range(8)])
    error = np.sqrt(7 / 8 * ((left_out - left_out.mean()) ** 2).sum())
    half = stats.t.ppf(0.975, 7) * error
    ends = np.tanh(mean_r(ranks) + np.array([-half, half]))
    assert concordance_interval(ranks) == pytest.approx((1 + 7 * ends) / 8, rel=1e-9)


def test_subjects_who_all_agree_have_no_interval_in_place_of_one_without_width(
    table_of: TableOf,
) -> None:
    """Two subjects who differ by the same said, with 95% confidence, that everybody does."""
    alike = np.array([[5.0, 7.0, 9.0], [4.0, 6.0, 8.0]])
    assert isinstance(mean_interval(alike[:, 1] - alike[:, 0]), NotEstimable)
    assert isinstance(concordance_interval(np.tile([-1.0, 0.0, 1.0], (3, 1))), NotEstimable)
    found = additive_effects(table_of(alike))
    assert not isinstance(found, NotEstimable)
    assert not {**found.condition_intervals, **found.subject_intervals}
    page = report_html(made(alike))
    assert "−2.00 (no interval)" in page
    assert "0.500 (no interval)" in page


def test_too_few_subjects_have_no_interval() -> None:
    for found in (mean_interval(np.ones(1)), concordance_interval(np.eye(2))):
        assert isinstance(found, NotEstimable)
        assert "an interval needs at least" in found.reason
