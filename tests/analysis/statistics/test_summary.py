"""."""

from collections.abc import Callable

import numpy as np
import pytest

from analysis.estimates import FloatArray, NotEstimable
from analysis.loading.score_table import ScoreTable
from analysis.statistics.summary import MissingScores, missing_scores

TableOf = Callable[[FloatArray], ScoreTable]


def test_a_withheld_score_is_read_in_three_ways(table_of: TableOf) -> None:
    table = table_of(np.array([[7.0, np.nan], [3.0, 9.0]]))
    result = missing_scores(table, ~table.given)
    assert isinstance(result, MissingScores)
    assert np.isnan(result.missing.scores[0, 1])
    assert result.zero.scores.tolist() == [[7.0, 0.0], [3.0, 9.0]]
    assert result.lowest.scores.tolist() == [[7.0, 3.0], [3.0, 9.0]]


def test_a_cell_that_nobody_answered_stays_missing_in_every_reading(table_of: TableOf) -> None:
    table = table_of(np.array([[7.0, np.nan, np.nan], [3.0, 9.0, 8.0]]))
    result = missing_scores(table, np.array([[False, True, False], [False] * 3]))
    assert isinstance(result, MissingScores)
    for read in (result.missing, result.zero, result.lowest):
        assert np.isnan(read.scores[0, 2])
    assert (result.zero.scores[0, 1], result.lowest.scores[0, 1]) == (0.0, 3.0)


def test_no_score_at_all_has_no_lowest(table_of: TableOf) -> None:
    table = table_of(np.array([[np.nan]]))
    assert missing_scores(table, ~table.given) == NotEstimable(
        reason="no score was given, so that there is no lowest one"
    )


def test_withheld_cells_must_be_empty_ones_of_the_table(table_of: TableOf) -> None:
    table = table_of(np.array([[7.0, np.nan]]))
    with pytest.raises(ValueError, match=r"must have shape \(1, 2\), got \(2,\)"):
        missing_scores(table, np.zeros(2, dtype=np.bool_))
    with pytest.raises(ValueError, match="must have no score, got 1 with one"):
        missing_scores(table, np.ones((1, 2), dtype=np.bool_))
