"""."""

import numpy as np
import pytest

from analysis.estimates import NotEstimable, ScoreTable


def test_a_table_keeps_its_own_copy_that_nobody_changes() -> None:
    scores = np.array([[1.0, np.nan]])
    table = ScoreTable(subjects=("1",), conditions=("a", "b"), scores=scores)
    scores[0, 0] = 9.0
    assert table.scores[0, 0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        table.scores[0, 0] = 3.0


def test_a_table_says_what_is_missing() -> None:
    table = ScoreTable(subjects=("1",), conditions=("a", "b"), scores=np.array([[1.0, np.nan]]))
    assert (table.missing_count, table.is_complete) == (1, False)
    assert table.given.tolist() == [[True, False]]


@pytest.mark.parametrize(
    ("subjects", "conditions", "scores", "message"),
    [
        (("1", "1"), ("a",), [[1.0], [2.0]], "each subject must be named once, got '1' 2 times"),
        (("1",), ("a", "a"), [[1.0, 2.0]], "each condition must be named once, got 'a' 2 times"),
        ((), ("a",), np.empty((0, 1)), "at least one subject, got 0"),
        (("1",), ("a",), [[1.0, 2.0]], r"shape \(1, 1\), got \(1, 2\)"),
        (("1",), ("a",), [[np.inf]], "finite or missing, got inf"),
    ],
)
def test_a_table_refuses_what_cannot_be_scores(
    subjects: tuple[str, ...], conditions: tuple[str, ...], scores: object, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        ScoreTable(subjects=subjects, conditions=conditions, scores=np.array(scores))


def test_having_no_answer_needs_a_reason() -> None:
    with pytest.raises(ValueError, match="must not be empty, got ''"):
        NotEstimable("")
