from collections.abc import Callable

import numpy as np

from analysis.no_answer import NoAnswer
from analysis.scores import FloatArray, ScoreTable
from analysis.statistics.missing_scores import MissingScores, missing_scores

TableOf = Callable[[FloatArray], ScoreTable]


def test_a_missing_score_is_read_in_three_ways(table_of: TableOf) -> None:
    result = missing_scores(table_of(np.array([[7.0, np.nan], [3.0, 9.0]])))
    assert isinstance(result, MissingScores)
    assert np.isnan(result.missing.scores[0, 1])
    assert result.zero.scores.tolist() == [[7.0, 0.0], [3.0, 9.0]]
    assert result.lowest.scores.tolist() == [[7.0, 3.0], [3.0, 9.0]]


def test_no_score_at_all_has_no_lowest(table_of: TableOf) -> None:
    assert missing_scores(table_of(np.array([[np.nan]]))) == NoAnswer(
        reason="no score was given, so that there is no lowest one"
    )
