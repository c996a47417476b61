"""Signed ranks and Holm against brute force and scipy."""

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from analysis.estimates import FloatArray, NotEstimable, ScoreTable
from analysis.statistics.corrections import holm, holm_of_rows
from analysis.statistics.signed_rank import (
    PairwiseTest,
    SignedRank,
    doubled_midranks,
    pairwise_signed_ranks,
    signed_rank,
)


def result_of(differences: FloatArray) -> SignedRank:
    result = signed_rank(differences)
    assert isinstance(result, SignedRank)
    return result


def brute_force(differences: FloatArray) -> tuple[float, float]:
    """V and the share of sign patterns that put it as far from its middle."""
    changed = differences[differences != 0]
    ranks = stats.rankdata(np.abs(changed))
    observed = ranks[changed > 0].sum()
    far = abs(observed - ranks.sum() / 2)
    values = [np.dot(ranks, signs) for signs in product((0, 1), repeat=len(ranks))]
    return observed, float(np.mean([abs(value - ranks.sum() / 2) >= far for value in values]))


def named(tests: tuple[PairwiseTest, ...], a: str, b: str) -> PairwiseTest:
    return next(test for test in tests if (test.a, test.b) == (a, b))


def test_only_voltage_against_pressure_survives_in_table_4(published: ScoreTable) -> None:
    tests = pairwise_signed_ranks(published)
    assert len(tests) == 10
    surviving = [test for test in tests if isinstance(test.p_holm, float) and test.p_holm < 0.05]
    assert [(test.a, test.b) for test in surviving] == [("voltage", "pressure")]
    best = surviving[0]
    assert isinstance(best.test, SignedRank)
    assert (best.test.statistic, best.test.n, best.test.n_zero) == (45.0, 9, 0)
    assert (best.test.p, best.test.method, best.test.rank_biserial) == (0.00390625, "exact", 1.0)
    assert best.p_holm == 0.0390625


def test_zeros_do_not_sharpen_frequency_against_voltage(published: ScoreTable) -> None:
    # scipy's "exact" under Pratt gives .0039 here; five differences of one sign give 2/32.
    test = named(pairwise_signed_ranks(published), "frequency", "voltage").test
    assert isinstance(test, SignedRank)
    assert (test.statistic, test.n_zero, test.p) == (0.0, 4, 0.0625)


@settings(max_examples=150, deadline=None)
@given(arrays(np.float64, st.integers(1, 9), elements=st.integers(-4, 4).map(float)))
def test_ties_and_zeros_agree_with_every_sign_pattern(differences: FloatArray) -> None:
    assume(differences.any())
    statistic, p = brute_force(differences)
    result = result_of(differences)
    assert result.statistic == statistic
    assert result.p == pytest.approx(p, rel=1e-12)
    assert result.n_zero == np.count_nonzero(differences == 0)


@pytest.mark.parametrize("count", [5, 20, 50])
def test_without_ties_p_agrees_with_scipy(count: int) -> None:
    differences = np.random.default_rng(count).normal(0.4, 1.0, count)
    expected = stats.wilcoxon(differences, method="exact")
    assert result_of(differences).p == pytest.approx(expected.pvalue, rel=1e-10)


def test_many_differences_have_the_normal_approximation_with_ties() -> None:
    differences = np.random.default_rng(3).integers(-3, 5, 300).astype(np.float64)
    result = result_of(differences)
    expected = stats.wilcoxon(differences, method="approx", axis=None)
    assert (result_of(differences[:200]).method, result.method) == ("exact", "normal")
    assert result.p == pytest.approx(expected.pvalue, rel=1e-10)


def test_missing_scores_drop_their_own_pair_only() -> None:
    assert result_of(np.array([1.0, np.nan, 2.0])) == result_of(np.array([1.0, 2.0]))


def test_zero_differences_have_no_test() -> None:
    assert signed_rank(np.array([0.0, 0.0, np.nan, 1e-12])) == NotEstimable(
        "no difference in any subject (zeros: 3)"
    )


def test_holm_does_not_count_a_pair_without_differences(
    table_of: Callable[[FloatArray], ScoreTable],
) -> None:
    scores = np.array([[1.0, 2.0, 2.0], [1.0, 4.0, 4.0], [0.0, 3.0, 3.0]])
    tests = pairwise_signed_ranks(table_of(scores))
    assert isinstance(named(tests, "c1", "c2").p_holm, NotEstimable)
    assert named(tests, "c0", "c1").p_holm == 2 * 0.25


def test_holm_does_not_count_a_pair_without_scores(
    table_of: Callable[[FloatArray], ScoreTable],
) -> None:
    scores = np.array([[1.0, 2.0, np.nan], [1.0, 4.0, np.nan], [0.0, 3.0, np.nan]])
    tests = pairwise_signed_ranks(table_of(scores))
    assert named(tests, "c0", "c1").p_holm == 0.25
    unscored = named(tests, "c0", "c2")
    assert isinstance(unscored.p_holm, NotEstimable)
    assert unscored.test == NotEstimable("no subject has both scores")


def test_swapping_two_conditions_keeps_p_and_mirrors_v(published: ScoreTable) -> None:
    differences = published.scores[:, 0] - published.scores[:, 4]
    forth, back = result_of(differences), result_of(-differences)
    assert (forth.p, forth.rank_biserial) == (back.p, -back.rank_biserial)


@given(st.lists(st.floats(0.0, 1.0), max_size=8))
def test_holm_is_monotone_and_never_smaller(p_values: list[float]) -> None:
    corrected = holm(p_values)
    assert all(new >= old for new, old in zip(corrected, p_values, strict=True))
    assert all(0.0 <= new <= 1.0 for new in corrected)
    order = np.argsort(p_values, kind="stable")
    assert list(np.array(corrected)[order]) == sorted(corrected)


SHAPES = st.tuples(st.integers(1, 5), st.integers(1, 6))
CELLS = st.integers(0, 4).map(float) | st.just(np.nan)


@given(SHAPES.flatmap(lambda shape: arrays(np.float64, shape, elements=CELLS)))
def test_ranks_agree_with_scipy(scores: FloatArray) -> None:
    expected = 2 * stats.rankdata(scores, axis=1, nan_policy="omit")
    assert np.array_equal(doubled_midranks(scores), np.nan_to_num(expected))


def test_ranks_are_midranks_of_the_scores_that_there_are() -> None:
    rng = np.random.default_rng(4)
    scores = np.clip(np.round(rng.normal(7.5, 2.0, (40, 6, 4))), 0, 10)
    scores[rng.random(scores.shape) < 0.3] = np.nan
    expected = stats.rankdata(scores, axis=-1, nan_policy="omit")
    assert (doubled_midranks(scores) == np.nan_to_num(2 * expected)).all()


def test_a_row_without_tests_has_no_correction() -> None:
    assert np.isnan(holm_of_rows(np.full((1, 3), np.nan))).all()
