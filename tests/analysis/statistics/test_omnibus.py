"""Friedman and Skillings-Mack against brute force, scipy and published values."""

from collections.abc import Callable
from fractions import Fraction
from itertools import permutations, product

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from analysis.estimates import FloatArray, NotEstimable, ScoreTable
from analysis.statistics.omnibus import (
    Friedman,
    MonteCarlo,
    SkillingsMack,
    friedman,
    monte_carlo_p,
    omnibus_p,
    skillings_mack,
)

SHAPES = st.tuples(st.integers(2, 4), st.integers(2, 4))
SCORES = st.integers(0, 4).map(float)


def table_from(scores: FloatArray) -> ScoreTable:
    subjects, conditions = scores.shape
    return ScoreTable(
        subjects=tuple(f"s{row}" for row in range(subjects)),
        conditions=tuple(f"c{column}" for column in range(conditions)),
        scores=scores,
    )


def result_of(scores: FloatArray) -> Friedman:
    result = friedman(table_from(scores))
    assert isinstance(result, Friedman)
    return result


def reason(scores: FloatArray) -> str:
    result = friedman(table_from(scores))
    assert isinstance(result, NotEstimable)
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
    result = result_of(published.scores)
    assert result.chi2 == pytest.approx(21.452055, abs=5e-7)
    assert result.df == 4
    assert result.p == pytest.approx(2.5757e-4, rel=2e-5)
    assert result.p_exact == pytest.approx(2.7105e-5, rel=2e-5)
    assert result.kendall_w == pytest.approx(0.595890, abs=5e-7)
    assert result.rank_sums == (27.0, 32.5, 38.5, 25.0, 12.0)


def test_table_4_agrees_with_scipy(published: ScoreTable) -> None:
    result = result_of(published.scores)
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
    assert result_of(scores).p_exact == pytest.approx(float(brute_force_p(scores)), rel=1e-12)


@settings(max_examples=60, deadline=None)
@given(
    st.tuples(st.integers(2, 7), st.integers(3, 5)).flatmap(
        lambda shape: arrays(np.float64, shape, elements=SCORES)
    )
)
def test_chi_square_agrees_with_scipy(scores: FloatArray) -> None:
    assume(np.ptp(scores, axis=1).max() > 0)
    expected = stats.friedmanchisquare(*scores.T)
    assert result_of(scores).chi2 == pytest.approx(expected.statistic, rel=1e-10, abs=1e-12)


def test_two_conditions_are_a_sign_test() -> None:
    # Seven of eight prefer the second: 2 (1 + 8) / 2^8.
    scores = np.array([[0.0, 1.0]] * 7 + [[1.0, 0.0]])
    assert result_of(scores).p_exact == pytest.approx(18 / 256, rel=1e-14)


def test_scores_that_differ_in_their_last_bits_are_tied() -> None:
    nearly = np.array([[7.3 - 7.2, 5.1 - 5.0, 0.0]] * 2)
    exactly = np.array([[0.1, 0.1, 0.0]] * 2)
    assert result_of(nearly) == result_of(exactly)


def test_an_incomplete_table_gives_the_reason() -> None:
    assert "a value in every cell, but 1 of 4 are empty" in reason(
        np.array([[1.0, 2.0], [np.nan, 2.0]])
    )


def test_one_condition_cannot_be_compared() -> None:
    assert "at least 2 conditions, got 1" in reason(np.array([[1.0], [2.0]]))


def test_one_subject_is_not_enough() -> None:
    assert "at least 2 subjects, got 1" in reason(np.array([[1.0, 2.0, 3.0]]))


def test_a_large_study_has_only_the_approximation() -> None:
    scores = np.random.default_rng(4).permuted(np.tile(np.arange(6.0), (60, 1)), axis=1)
    result = result_of(scores)
    assert isinstance(result.p_exact, NotEstimable)
    assert "with 60 subjects" in result.p_exact.reason
    assert isinstance(result.monte_carlo, MonteCarlo)
    # Chi-square is accurate here.
    assert result.monte_carlo.p == pytest.approx(result.p, abs=4 * result.monte_carlo.error)


def test_eight_conditions_have_only_the_approximation() -> None:
    result = result_of(np.arange(8.0)[None, :] * np.ones((3, 1)))
    assert isinstance(result.p_exact, NotEstimable)
    assert "at most 7 conditions, got 8" in result.p_exact.reason


def test_shufflings_give_the_exact_p_within_their_error(published: ScoreTable) -> None:
    table = table_from(published.scores[:, [0, 1, 3]])
    exact = friedman(table)
    assert isinstance(exact, Friedman)
    assert isinstance(exact.p_exact, float)
    assert exact.monte_carlo is None
    ranks = np.array([stats.rankdata(row) - 2 for row in table.scores])
    found = monte_carlo_p(ranks, table.given, lambda sums: (sums**2).sum(axis=1))
    assert found == monte_carlo_p(ranks, table.given, lambda sums: (sums**2).sum(axis=1))
    assert found.shuffles == 100_000
    assert found.error == pytest.approx(np.sqrt(found.p * (1 - found.p) / 100_001), rel=1e-12)
    assert found.p == pytest.approx(exact.p_exact, abs=4 * found.error)


def test_a_p_of_shufflings_is_never_zero() -> None:
    agreed = result_of(np.tile(np.arange(8.0), (30, 1)))
    assert isinstance(agreed.monte_carlo, MonteCarlo)
    assert agreed.monte_carlo.p == 1 / (1 + agreed.monte_carlo.shuffles)


def test_a_table_too_large_to_be_shuffled_often_has_the_p_of_chi_square() -> None:
    """Of 625 shufflings no p could be below 1/626, and each errs by several percent."""
    scores = np.random.default_rng(629).integers(0, 11, (2000, 8)).astype(float)
    found = result_of(scores)
    expected = stats.friedmanchisquare(*scores.T)
    assert found.monte_carlo is None
    assert found.best_p == found.p == pytest.approx(expected.pvalue, rel=1e-9)
    assert found.p == pytest.approx(0.053, abs=5e-4)
    clear = result_of(scores + np.arange(8) / 4)
    assert clear.best_p < 1e-30
    missing = np.where(np.arange(8) == np.arange(2000)[:, None] % 50, np.nan, scores)
    test = skillings_mack(table_from(missing))
    assert isinstance(test, SkillingsMack)
    assert (test.monte_carlo, test.best_p) == (None, test.p)


def test_few_subjects_are_shuffled_however_many_their_conditions() -> None:
    found = result_of(np.random.default_rng(3).permuted(np.tile(np.arange(60.0), (10, 1)), axis=1))
    assert isinstance(found.monte_carlo, MonteCarlo)
    assert found.monte_carlo.shuffles == 16_666


@pytest.mark.parametrize("shape", [(13, 5), (7, 6)])
def test_tables_past_enumeration_have_the_p_of_shufflings(shape: tuple[int, int]) -> None:
    scores = np.random.default_rng(11).integers(3, 11, shape) + np.arange(shape[1]) / 2
    result = result_of(scores)
    assert isinstance(result.p_exact, NotEstimable)
    assert isinstance(result.monte_carlo, MonteCarlo)
    rng, ranks = np.random.default_rng(5), np.array([stats.rankdata(row) for row in scores])
    sums = np.array([rng.permuted(ranks, axis=1).sum(axis=0) for _ in range(4000)])
    own = (sums.var(axis=1) >= ranks.sum(axis=0).var() - 1e-9).mean()
    assert result.monte_carlo.p == pytest.approx(own, abs=4 * np.sqrt(own * (1 - own) / 4000))


TableOf = Callable[[FloatArray], ScoreTable]

# Skillings and Mack 1981, page 173: assembly times of four methods by nine people.
ASSEMBLY = [
    [3.2, 4.1, 3.8, 4.2],
    [3.1, 3.9, 3.4, 4.0],
    [4.3, 3.5, 4.6, 4.8],
    [3.5, 3.6, 3.9, 4.0],
    [3.6, 4.2, 3.7, 3.9],
    [4.5, 4.7, 3.7, np.nan],
    [np.nan, 4.2, 3.4, np.nan],
    [4.3, 4.6, 4.4, 4.9],
    [3.5, np.nan, 3.7, 3.9],
]


def skillings_mack_of(table: ScoreTable) -> SkillingsMack:
    result = skillings_mack(table)
    assert isinstance(result, SkillingsMack)
    return result


def weighted_ranks(row: FloatArray) -> FloatArray:
    count = np.count_nonzero(~np.isnan(row))
    ranks: FloatArray = stats.rankdata(row, nan_policy="omit")
    return np.where(np.isnan(row), 0.0, (ranks - (count + 1) / 2) * np.sqrt(12 / (count + 1)))


def shufflings(row: FloatArray) -> list[FloatArray]:
    """Every order of one subject's weighted ranks over the cells the subject scored."""
    seen = ~np.isnan(row)
    orders = []
    for order in permutations(weighted_ranks(row)[seen]):
        ranks = np.zeros(len(row))
        ranks[seen] = order
        orders.append(ranks)
    return orders


def test_the_published_example(table_of: TableOf) -> None:
    result = skillings_mack_of(table_of(np.array(ASSEMBLY)))
    assert result.statistic == pytest.approx(15.493049, abs=5e-7)
    assert result.untied == pytest.approx(result.statistic, rel=1e-12)
    assert result.df == 3
    assert result.p == pytest.approx(0.001440296302, abs=5e-13)


def test_a_complete_table_gives_friedmans_statistic(published: ScoreTable) -> None:
    expected = friedman(published)
    assert isinstance(expected, Friedman)
    result = skillings_mack_of(published)
    assert result.statistic == pytest.approx(expected.chi2, rel=1e-12)
    assert result.df == 4
    assert result.p == pytest.approx(expected.p, rel=1e-10)


@settings(max_examples=60, deadline=None)
@given(
    arrays(np.float64, (3, 4), elements=st.integers(0, 3).map(float) | st.just(np.nan)),
)
def test_the_covariance_is_that_of_every_shuffling(table_of: TableOf, scores: FloatArray) -> None:
    result = skillings_mack(table_of(scores))
    if isinstance(result, NotEstimable):
        return
    sums = np.array([np.sum(choice, axis=0) for choice in product(*map(shufflings, scores))])
    total = np.sum([weighted_ranks(row) for row in scores], axis=0)
    covariance = np.cov(sums.T, ddof=0)
    inverse = np.linalg.pinv(covariance, rtol=1e-9, hermitian=True)
    assert result.statistic == pytest.approx(float(total @ inverse @ total), rel=1e-8, abs=1e-10)


def test_shufflings_of_the_scores_given_agree_with_all_of_them(table_of: TableOf) -> None:
    scores = np.array([[1, 2, 3, 4], [2, 1, np.nan, 3], [1, np.nan, 2, 2], [np.nan, 1, 3, 2.0]])
    sums = np.array([np.sum(choice, axis=0) for choice in product(*map(shufflings, scores))])
    inverse = np.linalg.pinv(np.cov(sums.T, ddof=0), rtol=1e-9, hermitian=True)
    statistics = np.einsum("ij,jk,ik->i", sums, inverse, sums)
    found = skillings_mack_of(table_of(scores))
    assert found.monte_carlo is not None
    exact = float((statistics >= found.statistic - 1e-9).mean())
    assert found.monte_carlo.p == pytest.approx(exact, abs=4 * found.monte_carlo.error)


def test_uninformative_rows_change_nothing(table_of: TableOf) -> None:
    scores = np.array(ASSEMBLY)
    alone = np.array([[np.nan, 3.0, np.nan, np.nan], [np.nan] * 4])
    with_alone = skillings_mack_of(table_of(np.vstack([scores, alone])))
    assert with_alone.statistic == pytest.approx(
        skillings_mack_of(table_of(scores)).statistic, rel=1e-12
    )


@pytest.mark.parametrize(
    ("scores", "reason"),
    [
        ([[np.nan, np.nan]], "there is no score that counts"),
        ([[1.0, np.nan], [np.nan, 2.0]], "no subject scored two conditions"),
        ([[1.0, 2.0, np.nan, np.nan], [np.nan, np.nan, 1.0, 2.0]], "compares c0, c1 with"),
        (
            [[3.0, 3.0, np.nan], [1.0] * 3],
            "every subject has the same score or response in all conditions",
        ),
        (
            [[3.0, 4.0, np.nan], [1.0, np.nan, np.nan]],
            "2 subjects must score two conditions, got 1",
        ),
    ],
)
def test_tables_without_a_test_give_the_reason(
    table_of: TableOf, scores: list[list[float]], reason: str
) -> None:
    result = skillings_mack(table_of(np.array(scores)))
    assert isinstance(result, NotEstimable)
    assert reason in result.reason


@settings(max_examples=200, deadline=None)
@given(
    st.tuples(st.integers(2, 6), st.integers(2, 5)).flatmap(
        lambda shape: arrays(np.float64, shape, elements=SCORES | st.just(np.nan))
    )
)
def test_conditions_are_compared_exactly_when_dummy_variables_tell_them_apart(
    table_of: TableOf, scores: FloatArray
) -> None:
    scores = scores[:, (~np.isnan(scores)).any(axis=0)]
    several = scores[(~np.isnan(scores)).sum(axis=1) >= 2]
    assume(len(several) >= 2)
    row, column = np.nonzero(~np.isnan(several))
    rows, columns = several.shape
    design = np.hstack([np.eye(rows)[row], np.eye(columns)[column]])
    told_apart = np.linalg.matrix_rank(design) == rows + columns - 1
    result = skillings_mack(table_of(scores))
    refused = isinstance(result, NotEstimable) and "no chain of subjects" in result.reason
    assert refused == (not told_apart)


def rounded_scores(seed: int, subjects: int, conditions: int, missing: float = 0.0) -> FloatArray:
    """Forty tables of whole scores with ceilings, half points and missing cells."""
    rng = np.random.default_rng([seed, subjects, conditions])
    shape = (40, subjects, conditions)
    scores = np.clip(np.round(rng.normal(7.5, 2.0, shape)), 0, 10)
    scores[10:20] = np.round(2 * rng.normal(5, 1, shape)[10:20]) / 2
    scores[20] = 10.0
    scores[21, :, :2] = 3.0
    scores[22] += 0.1 + 0.2  # sums that are equal but for rounding
    scores[rng.random(shape) < missing] = np.nan
    return scores


@pytest.mark.parametrize(("subjects", "conditions"), [(7, 5), (8, 4), (5, 3), (9, 2), (1, 3)])
def test_a_simulated_table_has_friedman_s_exact_p_or_that_of_chi_square(
    subjects: int, conditions: int
) -> None:
    scores = rounded_scores(2, subjects, conditions)
    if conditions > 3:  # the exact p, which is not compared here, takes a second
        scores = scores[[0, 10, 20, 21, 22]]
    for table in map(table_from, scores):
        test, p = friedman(table), omnibus_p(table)
        if not isinstance(test, Friedman):
            assert np.isnan(p)
        elif conditions <= 3 and not isinstance(test.p_exact, NotEstimable):
            assert p == test.p_exact
        else:
            assert p == test.p


def test_a_simulated_table_with_missing_scores_has_the_p_of_skillings_and_mack() -> None:
    scores = rounded_scores(3, 9, 5, missing=0.15)
    tables = [table_from(each) for each in scores if np.isnan(each).any()]
    assert len(tables) > 30
    for table in tables:
        test = skillings_mack(table)
        expected = np.nan if isinstance(test, NotEstimable) else test.p
        np.testing.assert_equal(omnibus_p(table), expected)
