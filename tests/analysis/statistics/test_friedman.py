from fractions import Fraction
from itertools import permutations, product

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from analysis.no_answer import NoAnswer
from analysis.scores import FloatArray, ScoreTable
from analysis.statistics.friedman import Friedman, friedman

SHAPES = st.tuples(st.integers(2, 4), st.integers(2, 4))
SCORES = st.integers(0, 4).map(float)


def table_from(scores: FloatArray) -> ScoreTable:
    subjects, conditions = scores.shape
    return ScoreTable(
        subjects=tuple(f"s{row}" for row in range(subjects)),
        conditions=tuple(f"c{column}" for column in range(conditions)),
        scores=scores,
    )


def answer_to(scores: FloatArray) -> Friedman:
    result = friedman(table_from(scores))
    assert isinstance(result, Friedman)
    return result


def reason(scores: FloatArray) -> str:
    result = friedman(table_from(scores))
    assert isinstance(result, NoAnswer)
    return result.reason


def brute_force_p(scores: FloatArray) -> Fraction:
    """The share of all shufflings within rows whose rank sums are at least as unequal."""
    rows = [[int(2 * rank) for rank in stats.rankdata(row)] for row in scores]
    shuffled = [
        sum(total**2 for total in map(sum, zip(*arrangement, strict=True)))
        for arrangement in product(*(list(permutations(row)) for row in rows))
    ]
    observed = sum(total**2 for total in map(sum, zip(*rows, strict=True)))
    return Fraction(sum(value >= observed for value in shuffled), len(shuffled))


def test_table_4_as_published(published: ScoreTable) -> None:
    result = answer_to(published.scores)
    assert result.chi2 == pytest.approx(21.452055, abs=5e-7)
    assert result.df == 4
    assert result.p == pytest.approx(2.5757e-4, rel=2e-5)
    assert result.p_exact == pytest.approx(2.7105e-5, rel=2e-5)
    assert result.kendall_w == pytest.approx(0.595890, abs=5e-7)
    assert result.rank_sums == (27.0, 32.5, 38.5, 25.0, 12.0)


def test_table_4_agrees_with_scipy(published: ScoreTable) -> None:
    result = answer_to(published.scores)
    expected = stats.friedmanchisquare(*published.scores.T)
    assert result.chi2 == pytest.approx(expected.statistic, rel=1e-12)
    assert result.p == pytest.approx(expected.pvalue, rel=1e-12)


@settings(max_examples=150, deadline=None)
@given(SHAPES.flatmap(lambda shape: arrays(np.float64, shape, elements=SCORES)))
def test_small_tables_with_ties_agree_with_every_shuffling(scores: FloatArray) -> None:
    assume(len(set(permutations(range(scores.shape[1])))) ** scores.shape[0] <= 14_000)
    if np.ptp(scores, axis=1).max() == 0:
        assert "the same score" in reason(scores)
        return
    assert answer_to(scores).p_exact == pytest.approx(float(brute_force_p(scores)), rel=1e-12)


@settings(max_examples=60, deadline=None)
@given(
    st.tuples(st.integers(2, 7), st.integers(3, 5)).flatmap(
        lambda shape: arrays(np.float64, shape, elements=SCORES)
    )
)
def test_chi_square_agrees_with_scipy(scores: FloatArray) -> None:
    assume(np.ptp(scores, axis=1).max() > 0)
    expected = stats.friedmanchisquare(*scores.T)
    assert answer_to(scores).chi2 == pytest.approx(expected.statistic, rel=1e-10, abs=1e-12)


def test_two_conditions_are_a_sign_test() -> None:
    # Seven of eight prefer the second: 2 (1 + 8) / 2^8.
    scores = np.array([[0.0, 1.0]] * 7 + [[1.0, 0.0]])
    assert answer_to(scores).p_exact == pytest.approx(18 / 256, rel=1e-14)


def test_scores_that_differ_in_their_last_bits_are_tied() -> None:
    nearly = np.array([[7.3 - 7.2, 5.1 - 5.0, 0.0]] * 2)
    exactly = np.array([[0.1, 0.1, 0.0]] * 2)
    assert answer_to(nearly) == answer_to(exactly)


def test_a_missing_score_is_no_answer_but_a_reason() -> None:
    assert "every score, 1 of 4 are missing" in reason(np.array([[1.0, 2.0], [np.nan, 2.0]]))


def test_one_condition_is_nothing_to_compare() -> None:
    assert "at least 2 conditions, got 1" in reason(np.array([[1.0], [2.0]]))


def test_one_subject_agrees_with_nobody() -> None:
    assert "at least 2 subjects to agree, got 1" in reason(np.array([[1.0, 2.0, 3.0]]))


def test_a_large_study_has_the_approximation_only() -> None:
    scores = np.random.default_rng(4).permuted(np.tile(np.arange(6.0), (60, 1)), axis=1)
    result = answer_to(scores)
    assert isinstance(result.p_exact, NoAnswer)
    assert "with 60 subjects" in result.p_exact.reason
    assert 0.0 < result.p <= 1.0


def test_eight_conditions_have_the_approximation_only() -> None:
    result = answer_to(np.arange(8.0)[None, :] * np.ones((3, 1)))
    assert isinstance(result.p_exact, NoAnswer)
    assert "at most 7 conditions, got 8" in result.p_exact.reason
