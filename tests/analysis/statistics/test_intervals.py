"""Intervals of effect sizes against scipy and a jackknife."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from analysis.estimates import FloatArray, NotEstimable, ScoreTable
from analysis.report.report import report_html, report_json
from analysis.statistics.intervals import (
    concordance_interval,
    mean_interval,
    rank_biserial_interval,
)
from tests.analysis.reports import made

TableOf = Callable[[FloatArray], ScoreTable]


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


def test_subjects_who_all_agree_have_no_interval_in_place_of_one_without_width() -> None:
    """Two subjects who differ by the same said, with 95% confidence, that everybody does."""
    alike = np.array([[5.0, 7.0, 9.0], [4.0, 6.0, 8.0]])
    assert isinstance(mean_interval(alike[:, 1] - alike[:, 0]), NotEstimable)
    assert isinstance(concordance_interval(np.tile([-1.0, 0.0, 1.0], (3, 1))), NotEstimable)
    page = report_html(made(alike))
    assert "−2.00 (no interval)" in page


ALIKE = [[1.0, 2.0, 3.0]] * 7
FEW = [[1.0, 2.0, 3.0], [2.0, 3.0, 5.0], [1.0, 3.0, 2.0]]
ONE_DIFFERS = [*ALIKE, [2.0, 1.0, 3.0]]
TWO_DIFFER = [*ONE_DIFFERS, [1.0, 3.0, 2.0]]


@pytest.mark.parametrize("scores", [FEW, ONE_DIFFERS])
def test_an_interval_of_concordance_that_covers_every_value_is_not_told(
    scores: list[list[float]],
) -> None:
    ends = concordance_interval(np.array([stats.rankdata(row) - 2 for row in scores]))
    assert isinstance(ends, NotEstimable)
    assert "it would reach from 0 to 1" in ends.reason
    numbers, page = report_json(made(scores)), report_html(made(scores))
    assert numbers["kendall_w_interval"] is None
    assert numbers["kendall_w_interval_reason"] == ends.reason
    assert f"(no interval: {ends.reason})" in page
    assert "rank-biserial r 0.965" in page
    assert "W 0.959" not in page, "it vouches for no interval that is not there"


def test_an_interval_of_concordance_with_an_end_is_told() -> None:
    numbers, page = report_json(made(TWO_DIFFER)), report_html(made(TWO_DIFFER))
    low, high = numbers["kendall_w_interval"]
    assert 0 <= low < numbers["kendall_w"] < high < 0.995
    assert f" [{low:.2f},\N{NO-BREAK SPACE}{high:.2f}], corrected for ties" in page
    assert "W 0.959" in page


def test_too_few_subjects_have_no_interval() -> None:
    for found in (mean_interval(np.ones(1)), concordance_interval(np.eye(2))):
        assert isinstance(found, NotEstimable)
        assert "an interval needs at least" in found.reason
