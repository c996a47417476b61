"""From events to scores: who counts, what is missing, and what is left out."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from analysis.loading.sessions import load_sessions, rehearsed_with
from analysis.loading.study_data import NothingToReport, StudyData, load_study_data, study_data
from analysis.report.sections.session_checks import left_out_lines
from protocol.journal.events import (
    Event,
    SessionExcluded,
    SessionIncluded,
    SessionOpened,
    StudyAmended,
    TrialExcluded,
    TrialIncluded,
    Withdrawn,
)
from tests.analysis.chains import chain, published_chain, scored_session

CONDITIONS = ("voltage", "pressure")


def session(
    who: str, scores: Mapping[str, int | None], kind: str = "participant", number: int = 1
) -> list[Event]:
    return scored_session(who, scores.items(), CONDITIONS, kind=kind, session=number)


def loaded(*sessions: list[Event], rehearsals: bool = False) -> StudyData:
    return load_study_data(map(chain, sessions), rehearsals=rehearsals)


def test_a_score_that_was_not_given_is_missing() -> None:
    table = loaded(session("P01", {"voltage": 9, "pressure": None})).table
    assert table.scores[0, 0] == 9
    assert np.isnan(table.scores[0, 1])


def test_repeated_trials_are_averaged() -> None:
    scores = [("voltage", 9), ("voltage", 6), ("voltage", 1)]
    events = scored_session("P01", scores, CONDITIONS, practice={2})
    assert loaded(events).table.scores[0, 0] == 7.5


def test_a_participants_sessions_are_one_row() -> None:
    first, second = session("P01", {"voltage": 9}), session("P01", {"pressure": 5}, number=2)
    table = loaded(first, second).table
    assert table.subjects == ("P01",)
    assert table.scores.tolist() == [[9, 5]]


def test_rehearsals_are_left_out_unless_asked_for() -> None:
    sessions = [session("P01", {"voltage": 9}), session("P02", {"voltage": 1}, "rehearsal")]
    without = loaded(*sessions)
    assert (without.table.subjects, without.rehearsals_left_out) == (("P01",), 1)
    everything = loaded(*sessions, rehearsals=True)
    assert (everything.table.subjects, everything.rehearsals_left_out) == (("P01", "P02"), 0)


def test_rehearsals_of_another_study_file_are_counted_and_left_out() -> None:
    def begun(who: str, digest: str | None, kind: str = "rehearsal") -> list[Event]:
        first, *rest = session(who, {"voltage": 9}, kind)
        assert isinstance(first, SessionOpened)
        return [replace(first, study_sha256=digest), *rest]

    everybody = [begun("P01", "old"), begun("P02", "new"), begun("P03", None)]
    everybody.append(begun("P04", "old", "participant"))
    found = load_sessions(map(chain, everybody))
    data = study_data(rehearsed_with(found, "new"), rehearsals=True)
    assert data.table.subjects == ("P02", "P03", "P04")
    assert left_out_lines(data) == ["Left out: rehearsals of another study.toml: 1"]
    with pytest.raises(NothingToReport, match=r"rehearsals of another study.toml here \(1\)"):
        study_data(rehearsed_with(load_sessions([chain(everybody[0])]), "new"), rehearsals=True)


def test_a_rehearsal_stays_apart_from_the_session_of_that_name() -> None:
    rehearsal = session("P01", {"voltage": 1}, "rehearsal")
    excluded = [*session("P02", {"voltage": 2}, "rehearsal"), SessionExcluded(reason="noise")]
    sessions = [rehearsal, session("P01", {"voltage": 9}), excluded, session("P02", {})]
    found = loaded(*sessions, rehearsals=True)
    assert found.table.subjects == ("P01 (rehearsal)", "P01", "P02")
    assert found.table.scores[:2, 0].tolist() == [1, 9]
    assert [out.participant for out in found.left_out] == ["P02 (rehearsal)"]
    assert loaded(*sessions).table.subjects == ("P01", "P02")


def test_what_is_included_again_counts_and_is_told() -> None:
    events = [
        *session("P01", {"voltage": 9, "pressure": 5}),
        TrialExcluded(index=1, reason="a noise"),
        TrialIncluded(index=1, reason="it was next door"),
        SessionExcluded(reason="ill"),
        SessionIncluded(reason="that was P02"),
    ]
    found = loaded(events)
    assert (found.table.scores.tolist(), found.left_out) == ([[9, 5]], ())
    assert [(entry.trial, entry.what, entry.text) for entry in found.incidents] == [
        (1, "excluded", "a noise"),
        (1, "included again", "it was next door"),
        (None, "excluded", "ill"),
        (None, "included again", "that was P02"),
    ]


def test_nothing_but_rehearsals_names_the_option() -> None:
    with pytest.raises(NothingToReport, match=r"nothing but rehearsals .* --rehearsals"):
        loaded(session("P01", {}, "rehearsal"))


def test_an_empty_study_says_so() -> None:
    with pytest.raises(NothingToReport, match="no sessions here"):
        loaded([], rehearsals=True)


def test_an_unfinished_session_is_named() -> None:
    events = session("P01", {"voltage": 9})[:-1]
    assert loaded(events).unfinished == ("P01",)


def test_a_session_without_an_answer_has_a_row_all_the_same() -> None:
    table = loaded(session("P01", {"voltage": 9}), session("P02", {})).table
    assert table.subjects == ("P01", "P02")
    assert np.isnan(table.scores[1]).all()


def test_imported_scores_keep_the_order_of_their_columns() -> None:
    imported = published_chain("1", {"voltage": None, "direction": 7.5})
    result = load_study_data([imported], rehearsals=False)
    assert result.table.conditions == ("voltage", "direction")
    assert result.kinds == ("published",)
    assert np.array_equal(result.table.scores, [[np.nan, 7.5]], equal_nan=True)


def test_an_excluded_trial_does_not_count_but_is_counted() -> None:
    excluded = TrialExcluded(index=0, reason="a noise")
    result = loaded([*session("P01", {"voltage": 9, "pressure": 5}), excluded])
    assert np.isnan(result.table.scores[0, 0])
    assert (result.trials_excluded, result.unfinished) == (1, ())


def test_excluded_and_withdrawn_sessions_are_counted_and_nothing_more() -> None:
    excluded = [*session("P01", {"voltage": 9}), SessionExcluded(reason="fell asleep")]
    withdrawn = [*session("P03", {"voltage": 9}), Withdrawn()]
    amended: list[Event] = [StudyAmended(study_sha256="0", reason="a slip")]
    result = loaded(excluded, withdrawn, amended, session("P02", {"voltage": 8}))
    assert result.table.subjects == ("P02",)
    assert (result.sessions_excluded, result.sessions_withdrawn) == (1, 1)
