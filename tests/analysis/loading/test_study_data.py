"""From events to scores: who counts, what is missing, and what is left out."""

from typing import Any

import numpy as np
import pytest

from analysis.loading.sessions import Happened
from analysis.loading.study_data import NothingToReport, load_study_data


def session(who: str, scores: dict[str, Any], kind: str = "participant") -> list[Happened]:
    opened = {"participant": who, "kind": kind, "conditions": ["voltage", "pressure"]}
    answers: list[Happened] = [
        ("answered", {"index": i, "kind": "trial", "condition": name, "score": score})
        for i, (name, score) in enumerate(scores.items())
    ]
    return [("session-opened", opened), *answers, ("session-completed", {})]


def test_a_score_that_was_not_given_is_missing() -> None:
    table = load_study_data(
        [session("P01", {"voltage": 9, "pressure": None})], rehearsals=False
    ).table
    assert table.scores[0, 0] == 9
    assert np.isnan(table.scores[0, 1])


def test_repeated_trials_are_averaged() -> None:
    events = [
        *session("P01", {"voltage": 9}),
        ("answered", {"index": 7, "kind": "trial", "condition": "voltage", "score": 6}),
        ("answered", {"index": 8, "kind": "practice", "condition": "voltage", "score": 1}),
    ]
    assert load_study_data([events], rehearsals=False).table.scores[0, 0] == 7.5


def test_a_participants_sessions_are_one_row() -> None:
    first, second = session("P01", {"voltage": 9}), session("P01", {"pressure": 5})
    table = load_study_data([first, second], rehearsals=False).table
    assert table.subjects == ("P01",)
    assert table.scores.tolist() == [[9, 5]]


def test_rehearsals_are_left_out_unless_asked_for() -> None:
    sessions = [session("P01", {"voltage": 9}), session("P02", {"voltage": 1}, "rehearsal")]
    without = load_study_data(sessions, rehearsals=False)
    assert (without.table.subjects, without.rehearsals_left_out) == (("P01",), 1)
    everything = load_study_data(sessions, rehearsals=True)
    assert (everything.table.subjects, everything.rehearsals_left_out) == (("P01", "P02"), 0)


def test_nothing_but_rehearsals_names_the_option() -> None:
    with pytest.raises(NothingToReport, match=r"nothing but rehearsals .* --rehearsals"):
        load_study_data([session("P01", {}, "rehearsal")], rehearsals=False)


def test_an_empty_study_says_so() -> None:
    with pytest.raises(NothingToReport, match="no sessions here"):
        load_study_data([[]], rehearsals=True)


def test_an_unfinished_session_is_named() -> None:
    events = session("P01", {"voltage": 9})[:-1]
    assert load_study_data([events], rehearsals=False).unfinished == ("P01",)


def test_imported_scores_keep_the_order_of_their_columns() -> None:
    payload = {
        "participant": "1",
        "conditions": ["voltage", "direction"],
        "scores": {"direction": 7, "voltage": None},
    }
    result = load_study_data([[("scores-imported", payload)]], rehearsals=False)
    assert result.table.conditions == ("voltage", "direction")
    assert result.kinds == ("published",)
    assert np.array_equal(result.table.scores, [[np.nan, 7]], equal_nan=True)


def test_an_excluded_trial_does_not_count_but_is_counted() -> None:
    events = [*session("P01", {"voltage": 9, "pressure": 5}), ("trial-excluded", {"index": 0})]
    result = load_study_data([events], rehearsals=False)
    assert np.isnan(result.table.scores[0, 0])
    assert (result.trials_excluded, result.unfinished) == (1, ())


def test_excluded_and_withdrawn_sessions_are_counted_and_nothing_more() -> None:
    excluded: list[Happened] = [*session("P01", {"voltage": 9}), ("session-excluded", {})]
    withdrawn: list[Happened] = [("session-opened", {}), ("withdrawn", {})]
    amended: list[Happened] = [("study-amended", {})]
    sessions = [excluded, withdrawn, amended, session("P02", {"voltage": 8})]
    result = load_study_data(sessions, rehearsals=False)
    assert result.table.subjects == ("P02",)
    assert (result.sessions_excluded, result.sessions_withdrawn) == (1, 1)
