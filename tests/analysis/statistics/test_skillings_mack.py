from collections.abc import Callable
from itertools import permutations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from analysis.no_answer import NoAnswer
from analysis.scores import FloatArray, ScoreTable
from analysis.statistics.friedman import Friedman, friedman
from analysis.statistics.skillings_mack import SkillingsMack, skillings_mack

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


def answer_to(table: ScoreTable) -> SkillingsMack:
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
    result = answer_to(table_of(np.array(ASSEMBLY)))
    assert result.statistic == pytest.approx(15.493049, abs=5e-7)
    assert result.untied == pytest.approx(result.statistic, rel=1e-12)
    assert result.df == 3
    assert result.p == pytest.approx(0.001440296302, abs=5e-13)


def test_without_holes_it_is_friedmans_test(published: ScoreTable) -> None:
    expected = friedman(published)
    assert isinstance(expected, Friedman)
    result = answer_to(published)
    assert result.statistic == pytest.approx(expected.chi2, rel=1e-12)
    assert result.df == 4
    assert result.p == pytest.approx(expected.p, rel=1e-10)


@settings(max_examples=60, deadline=None)
@given(
    arrays(np.float64, (3, 4), elements=st.integers(0, 3).map(float) | st.just(np.nan)),
)
def test_the_covariance_is_that_of_every_shuffling(table_of: TableOf, scores: FloatArray) -> None:
    result = skillings_mack(table_of(scores))
    if isinstance(result, NoAnswer):
        return
    sums = np.array([np.sum(choice, axis=0) for choice in product(*map(shufflings, scores))])
    total = np.sum([weighted_ranks(row) for row in scores], axis=0)
    covariance = np.cov(sums.T, ddof=0)
    inverse = np.linalg.pinv(covariance, rtol=1e-9, hermitian=True)
    assert result.statistic == pytest.approx(float(total @ inverse @ total), rel=1e-8, abs=1e-10)


def test_leaving_out_what_says_nothing_changes_nothing(table_of: TableOf) -> None:
    scores = np.array(ASSEMBLY)
    alone = np.array([[np.nan, 3.0, np.nan, np.nan], [np.nan] * 4])
    with_alone = answer_to(table_of(np.vstack([scores, alone])))
    assert with_alone.statistic == pytest.approx(answer_to(table_of(scores)).statistic, rel=1e-12)


@pytest.mark.parametrize(
    ("scores", "reason"),
    [
        ([[np.nan, np.nan]], "no score was given"),
        ([[1.0, np.nan], [np.nan, 2.0]], "no subject scored two conditions"),
        ([[1.0, 2.0, np.nan, np.nan], [np.nan, np.nan, 1.0, 2.0]], "compares c0, c1 with"),
        ([[3.0, 3.0, np.nan], [1.0] * 3], "every subject gave all conditions the same score"),
        ([[3.0, 4.0, np.nan], [1.0, np.nan, np.nan]], "2 subjects who scored two conditions"),
    ],
)
def test_tables_without_a_test_say_why(
    table_of: TableOf, scores: list[list[float]], reason: str
) -> None:
    result = skillings_mack(table_of(np.array(scores)))
    assert isinstance(result, NoAnswer)
    assert reason in result.reason
