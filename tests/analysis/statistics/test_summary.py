"""Readings of withheld scores."""

from collections.abc import Callable

import numpy as np
import pytest

from analysis.estimates import FloatArray
from analysis.loading.score_table import ScoreTable
from analysis.statistics.summary import withheld_readings

TableOf = Callable[[FloatArray], ScoreTable]


def test_a_withheld_score_has_three_readings(table_of: TableOf) -> None:
    table = table_of(np.array([[7.0, np.nan], [3.0, 9.0]]))
    result = withheld_readings(table, ~table.given)
    assert list(result) == ["missing", "zero", "lowest"]
    assert np.isnan(result["missing"].scores[0, 1])
    assert result["zero"].scores.tolist() == [[7.0, 0.0], [3.0, 9.0]]
    assert result["lowest"].scores.tolist() == [[7.0, 3.0], [3.0, 9.0]]


def test_a_cell_without_an_answer_stays_missing_in_every_reading(table_of: TableOf) -> None:
    table = table_of(np.array([[7.0, np.nan, np.nan], [3.0, 9.0, 8.0]]))
    result = withheld_readings(table, np.array([[False, True, False], [False] * 3]))
    assert len(result) == 3
    assert all(np.isnan(reading.scores[0, 2]) for reading in result.values())
    assert (result["zero"].scores[0, 1], result["lowest"].scores[0, 1]) == (0.0, 3.0)


@pytest.mark.parametrize("score", [np.nan, 7.0])
def test_an_empty_and_a_complete_table_have_one_reading(table_of: TableOf, score: float) -> None:
    table = table_of(np.array([[score]]))
    assert withheld_readings(table, ~table.given) == {"missing": table}


def test_withheld_cells_must_be_empty_cells_of_the_table(table_of: TableOf) -> None:
    table = table_of(np.array([[7.0, np.nan]]))
    with pytest.raises(ValueError, match=r"must have shape \(1, 2\), got \(2,\)"):
        withheld_readings(table, np.zeros(2, dtype=np.bool_))
    with pytest.raises(ValueError, match="must have no score, got 1 with one"):
        withheld_readings(table, np.ones((1, 2), dtype=np.bool_))
