"""The response of a trial and the direction of answers, as a table of all that can happen."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
import pytest

from analysis.loading.response import Directions, directions, responses

NAN = float("nan")


def trials(**columns: Sequence[object]) -> pd.DataFrame:
    size = len(next(iter(columns.values())))
    defaults: dict[str, Sequence[object]] = {
        "trial_kind": ["trial"] * size,
        "condition": ["voltage"] * size,
        "question": ["roughness"] * size,
        "change": [None] * size,
        "agrees": [None] * size,
        "score": [NAN] * size,
        "lowest_score": [NAN] * size,
        "expected": ["smoother"] * size,
    }
    return pd.DataFrame({**defaults, **columns})


@pytest.mark.parametrize(
    ("score_when", "answer", "agrees", "score", "response"),
    [
        # A study may ask for the score after the expected answer, after any change, or always.
        ("agrees", "smoother", True, 7.0, 8.0),
        ("agrees", "rougher", False, NAN, 0.0),
        ("agrees", "same", False, NAN, 0.0),
        ("noticed", "smoother", True, 0.0, 1.0),
        ("noticed", "rougher", False, 9.0, 0.0),
        ("noticed", "same", False, NAN, 0.0),
        ("always", "smoother", True, 10.0, 11.0),
        ("always", "rougher", False, 4.0, 0.0),
        ("always", "same", False, 2.0, 0.0),
    ],
)
@pytest.mark.parametrize("lowest", [0.0, 1.0, -5.0])
def test_every_answer_has_a_response(
    score_when: str, answer: str, agrees: bool, score: float, response: float, lowest: float
) -> None:
    row = trials(change=[answer], agrees=[agrees], score=[score + lowest])
    assert responses(row, lowest) == pytest.approx([response]), score_when


def test_a_trial_keeps_the_scale_that_it_was_scored_on() -> None:
    rows = trials(
        change=["smoother"] * 2, agrees=[True] * 2, score=[2.0, 7.0], lowest_score=[0.0, NAN]
    )
    assert responses(rows, 5.0).tolist() == [3.0, 3.0]


def test_where_no_change_is_expected_there_are_no_ways() -> None:
    rows = trials(expected=["same"], change=["rougher"], agrees=[False])
    assert directions(rows, "condition") == {}


def test_what_counts_for_no_condition_has_none() -> None:
    kinds = ["baseline", "signal", "practice", "catch", "track"]
    rows = trials(trial_kind=kinds, agrees=[True] * 5, score=[5.0] * 5)
    assert np.isnan(responses(rows, 0.0)).all()


def test_what_is_not_known_stays_so() -> None:
    rows = trials(agrees=[None, True, False], score=[NAN, NAN, NAN])
    np.testing.assert_array_equal(responses(rows, 0.0), [NAN, NAN, 0.0])


def test_without_a_question_it_is_the_score() -> None:
    published = trials(trial_kind=["published"] * 3, question=[None] * 3, score=[0.0, 9.0, NAN])
    np.testing.assert_array_equal(responses(published, 0.0), [0.0, 9.0, NAN])


def test_a_score_without_an_answer_in_a_table_of_answers_is_not_known() -> None:
    table = trials(
        trial_kind=["published"] * 3,
        question=["as expected?", None, "as expected?"],
        agrees=[True, None, False],
        score=[3.0, 9.0, 4.0],
    )
    np.testing.assert_array_equal(responses(table, 0.0), [4.0, NAN, 0.0])


def test_directions_are_counted_by_condition() -> None:
    rows = trials(
        condition=["a", "a", "a", "b", "b"],
        question=["roughness"] * 3 + ["places"] * 2,
        change=["smoother", "rougher", "same", "swapped", "not swapped"],
        agrees=[False, True, False, True, False],
    )
    assert directions(rows, "condition") == {
        ("a",): Directions(expected=1, contrary=1, same=1),
        ("b",): Directions(expected=1, contrary=0, same=1),
    }
