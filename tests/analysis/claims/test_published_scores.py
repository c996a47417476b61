"""The published scores: their uncertainty, and verdicts that move with the scores."""

import numpy as np
import pytest
from scipy import stats

from analysis.claims.published_scores import PUBLISHED, HumanScores, interval_of_all
from analysis.estimates import FloatArray, ScoreTable

CONDITIONS = ("frequency", "structure", "voltage", "direction", "pressure")


def people(scores: FloatArray) -> HumanScores:
    names = tuple(str(row) for row in range(len(scores)))
    return HumanScores(ScoreTable(subjects=names, conditions=CONDITIONS, scores=scores))


def test_the_p_values_of_voltage_are_those_of_table_4() -> None:
    found = PUBLISHED.p_holm("voltage", ["pressure", "structure", "frequency", "direction"])
    assert list(found) == ["pressure", "direction", "frequency", "structure"]
    assert list(found.values()) == pytest.approx([0.0390625, 0.1875, 0.3125, 0.5])


def test_only_a_significant_difference_decides() -> None:
    assert PUBLISHED.above("voltage", "pressure") is True
    assert PUBLISHED.above("structure", "pressure") is None
    assert PUBLISHED.above("pressure", "voltage") is False
    assert PUBLISHED.above("direction", "frequency") is False


def test_equal_conditions_are_not_told_apart() -> None:
    scores = np.full((9, 5), 7.0)
    scores[:, 0] = np.arange(9)
    assert people(scores).p_holm("voltage", ["pressure"]) == {"pressure": 1.0}


def test_every_pair_is_told_apart_with_enough_people() -> None:
    scores = np.tile([5.0, 6, 8, 4, 2], (12, 1)) + np.arange(12.0)[:, None] / 10
    assert all(people(scores).above("voltage", other) for other in CONDITIONS if other != "voltage")


def test_the_intervals_are_those_of_the_t_distribution() -> None:
    column = PUBLISHED.table.scores[:, 1]
    expected = stats.t.interval(0.95, 8, column.mean(), stats.sem(column))
    assert PUBLISHED.mean_interval("structure") == pytest.approx(expected)
    assert PUBLISHED.mean_in_words("structure") == "mean score 8.89, 95% CI 8.08 to 9.70"


@pytest.mark.parametrize("count", [9, 45])
def test_a_share_of_all_has_the_exact_interval(count: int) -> None:
    exact = stats.binomtest(count, count).proportion_ci(0.95, "exact")
    assert interval_of_all(count) == pytest.approx((exact.low, exact.high))
