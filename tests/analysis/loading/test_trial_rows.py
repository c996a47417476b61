"""From events to records of trials: what is kept, of which attempt, and what is left out."""

from collections.abc import Sequence

import pytest

from analysis.loading.records import TrialRecord
from analysis.loading.sessions import NothingToExport, trials
from protocol.journal.events import StoredEvent
from tests.analysis.hostile_study import NOTES, Written, imported, sessions, study_text

TEXT = study_text()


def events(participant: str) -> list[list[StoredEvent]]:
    return [session.events for session in sessions(TEXT) if session.participant == participant]


def found(chains: Sequence[Sequence[StoredEvent]]) -> list[TrialRecord]:
    return list(trials(chains, rehearsals=False).trials)


def test_every_trial_that_was_begun_is_there_and_who_withdrew_is_not() -> None:
    everything = [session.events for session in sessions(TEXT)]
    read = trials(everything, rehearsals=False)
    assert {name: len(rows) for name, rows in read.by_session().items()} == {
        ("P-01", 1): 7,
        ("P01", 1): 7,
        ("P01", 2): 7,
        ("p_01", 1): 7,
        ("D01", 1): 2,
        ("E01", 1): 7,
    }
    left_out = (read.rehearsals_left_out, read.sessions_withdrawn, read.sessions_without_trials)
    assert left_out == (1, 1, 1)
    assert "R01" in trials(everything, rehearsals=True).participants


def test_withdrawn_is_withdrawn_even_before_the_payloads_are_erased() -> None:
    with pytest.raises(NothingToExport, match="no trials here: nobody has begun one, or all have"):
        found(events("W01"))


def test_nothing_but_rehearsals_names_the_option() -> None:
    with pytest.raises(NothingToExport, match=r"nothing but rehearsals here; .* --rehearsals"):
        found(events("R01"))


def test_the_last_attempt_counts_and_the_others_are_counted() -> None:
    repeated = found(events("p_01"))[2]
    assert (repeated.attempts, repeated.abort_reasons) == (2, ("repeated at the operator's wish",))
    assert len(repeated.touches) == len(repeated.planned["touches"])
    assert repeated.answer["change"] == "same"


def test_a_trial_left_in_the_middle_has_its_touch_and_no_answer() -> None:
    left = found(events("D01"))[1]
    assert (left.attempts, dict(left.answer), left.answered_utc) == (1, {}, None)
    assert [touch.commanded["voltage_v"] for touch in left.touches] == [100.0]
    assert not left.touches[0].read_back
    assert not left.session.completed


def test_practice_that_is_asked_again_counts_as_answered_last() -> None:
    session = Written("P01")
    session.arm()
    trial = session.plan.trials[2]
    session.start(trial)
    session.answer(trial, 3)
    session.add("device-off", confirmed=True, why="a break")
    session.add("session-resumed")
    session.add("practice-renewed", indices=[trial.index])
    session.arm()
    session.start(trial)
    session.answer(trial, 8)
    (record,) = found([session.events])
    assert (record.attempts, record.answer["score"]) == (2, 8)


def test_a_trial_is_as_planned_when_it_was_last_begun() -> None:
    session = Written("P01")
    session.arm()
    trial = session.plan.trials[2]
    session.start(trial)
    session.add("trial-aborted", index=trial.index, why="a break")
    session.add("device-off", confirmed=True, why="a break")
    planned = {**session.events[0].payload["trials"][2], "level": 0.5}
    session.add("session-resumed", trials=[planned], study_sha256="amended")
    session.arm()
    session.start(trial)
    session.answer(trial, 8)
    (record,) = found([session.events])
    assert (record.planned["level"], record.study_sha256) == (0.5, "amended")


def test_notes_stand_with_the_trial_they_were_typed_at() -> None:
    records = found(events("P-01"))
    assert [record.notes for record in records[:3]] == [
        (NOTES[0], NOTES[7]),
        (NOTES[1], NOTES[8]),
        (NOTES[2], NOTES[9]),
    ]


def test_a_note_before_the_first_trial_stands_with_it() -> None:
    session = Written("P01")
    session.add("note", text="late")
    session.arm()
    session.start(session.plan.trials[0])
    session.add("note", text="cold")
    assert found([session.events])[0].notes == ("late", "cold")


def test_what_was_taken_out_is_marked() -> None:
    excluded = [record.excluded for record in found([*events("P01"), *events("E01")])]
    assert excluded == ["no"] * 3 + ["trial"] + ["no"] * 10 + ["session"] * 7
    assert found(events("E01"))[0].session.exclusion == "fell asleep"


def test_a_published_table_has_a_trial_per_score() -> None:
    records = found([imported("1", {"voltage": 9, "pressure": None})])
    assert [(r.planned["condition"], r.answer["score"]) for r in records] == [
        ("voltage", 9),
        ("pressure", None),
    ]
    assert {record.session.kind for record in records} == {"published"}
