"""From events to tables: which attempt counts, in what order, and what belongs to it."""

import gc
import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from analysis.loading.records import values
from analysis.loading.sessions import load_sessions
from protocol.journal.events import (
    DeviceOff,
    Event,
    NoteTaken,
    SessionResumed,
    StoredEvent,
    TouchEnded,
    TrialAborted,
    TrialExcluded,
    TrialStarted,
    WindowChanged,
)
from protocol.journal.state import NotAllowed
from protocol.plan.trials import Trial
from tests.analysis.chains import chain, published_chain
from tests.analysis.hostile_study import NOTES, Written, sessions, study_text
from tests.analysis.reports import PAPER, session_events

TEXT = study_text()


def paper_session(**changes: Any) -> list[Event]:
    return session_events(PAPER, 0, np.random.default_rng(3), **changes)


def answered(events: list[Event]) -> pd.DataFrame:
    return load_sessions([chain(events)]).answered


def trials_of(participant: str) -> pd.DataFrame:
    chains = [one.events for one in sessions(TEXT) if one.participant == participant]
    return load_sessions(chains).trials


def trials_in(session: Written) -> pd.DataFrame:
    return load_sessions([session.events]).trials


def test_answers_are_in_their_order_and_know_their_neighbours() -> None:
    trials = answered(paper_session())
    assert trials["trial_kind"].tolist() == ["baseline", "signal", *["trial"] * 5]
    scored = trials[trials["trial_kind"].eq("trial")]
    assert scored["place"].tolist() == [1, 2, 3, 4, 5]
    assert values(scored["previous"]) == [None, *scored["condition"][:-1]]
    assert trials[["place", "previous"]][:2].isna().all(axis=None)


@pytest.mark.parametrize(
    ("tag", "key", "value", "told"),
    [
        ("trial-started", "index", 99, "its events do not fit together"),
        ("touch-started", "touch", 99, "its events do not fit together"),
        (
            "touch-started",
            "touch",
            "x",
            "is damaged: touch-started, touch has a value that it cannot have",
        ),
        (
            "touch-ended",
            "read_back",
            [5],
            "is damaged: touch-ended, read_back has a value that it cannot have",
        ),
    ],
)
def test_a_session_that_cannot_be_read_is_named_with_its_event(
    tag: str, key: str, value: object, told: str
) -> None:
    events = [
        replace(event, payload={**event.payload, key: value}) if event.tag == tag else event
        for event in chain(paper_session())
    ]
    with pytest.raises(NotAllowed, match=rf"^session P01/1: (event \d+ )?{re.escape(told)}$"):
        load_sessions([events])


def test_a_trial_answered_again_counts_once_and_an_aborted_touch_not_at_all() -> None:
    events = paper_session()
    started = max(n for n, event in enumerate(events) if isinstance(event, TrialStarted))
    aborted = TrialAborted(index=6, why="a break")
    again = [*events[: started + 3], aborted, *events[started:]]
    found, without = load_sessions([chain(again)]), load_sessions([chain(events)])
    last, alone = (one.touches["attempt_id"].eq(one.answered.index[-1]) for one in (found, without))
    columns = ["planned", "force_n", "start_voltage_v", "end_voltage_v"]
    pd.testing.assert_frame_equal(
        found.touches[last][columns].reset_index(drop=True),
        without.touches[alone][columns].reset_index(drop=True),
    )
    assert len(found.touches) == len(without.touches) + 1
    twice = [*events[:-2], *events[started:]]
    assert len(answered(twice)) == len(without.answered)


def test_a_generator_that_is_off_gives_nothing_whatever_amplitude_it_keeps() -> None:
    def kept(event: Event) -> Event:
        if not isinstance(event, TouchEnded):
            return event
        start, *rest = event.read_back
        return replace(event, read_back=(replace(start, output=False, voltage_v=100.0), *rest))

    events = list(map(kept, paper_session()))
    touches, plain = (load_sessions([chain(it)]).touches for it in (events, paper_session()))
    assert (touches["start_voltage_v"] == 0).all()
    pd.testing.assert_series_equal(touches["end_voltage_v"], plain["end_voltage_v"])


def test_a_resumed_session_goes_on_under_the_amended_plan() -> None:
    plain = paper_session(measured=False)
    last = plain[0].to_json()["trials"][-1]
    amended = {**last, "touches": [{**touch, "press": 2.0} for touch in last["touches"]]}
    resumed = SessionResumed.from_json({"trials": [amended]})
    after = load_sessions([chain([*plain[:3], resumed, *plain[3:]])]).touches
    before = load_sessions([chain(plain)]).touches
    of_last = after["attempt_id"].eq(after["attempt_id"].max())
    assert after["press"][of_last].unique().tolist() == [2.0]
    assert after["press"][~of_last].tolist() == before["press"][~of_last].tolist()


def test_each_version_that_recorded_a_session_is_told() -> None:
    """A session that was resumed by another version is none of the first version alone."""
    plain = paper_session(measured=False)
    first = plain[0].to_json()["versions"]["touchbeam"]
    resumed = [
        SessionResumed.from_json({"versions": {"touchbeam": version, "python": "3.12.1"}})
        for version in (first, "9.1.0", "9.1.0", first)
    ]
    (told,) = load_sessions([chain([*plain[:3], *resumed, *plain[3:]])]).sessions["versions"]
    assert told["touchbeam"] == f"{first}, then 9.1.0, then {first}"
    assert told["python"].endswith("3.12.1")
    (alone,) = load_sessions([chain([*plain[:3], SessionResumed.from_json({})])]).sessions[
        "versions"
    ]
    assert alone["touchbeam"] == first


def test_interruptions_and_notes_are_incidents() -> None:
    events = paper_session()
    events[-1:] = [
        NoteTaken(text="the phone rang"),
        WindowChanged(has_keys=True, is_shown=True),
        WindowChanged(has_keys=False, is_shown=True),
        WindowChanged(has_keys=False, is_shown=False),
        DeviceOff(confirmed=False, why="the session was interrupted"),
        SessionResumed.from_json({}),
    ]
    told = [(entry.what, entry.text) for entry in load_sessions([chain(events)]).incidents]
    assert told == [
        ("note", "the phone rang"),
        ("window minimised", ""),
        ("device off, not confirmed", "the session was interrupted"),
        ("resumed", ""),
    ]


def test_the_last_attempt_counts_and_the_others_are_counted() -> None:
    found = load_sessions([one.events for one in sessions(TEXT) if one.participant == "p_01"])
    repeated = found.trials.reset_index().iloc[2]
    assert (repeated["attempts"], repeated["aborted"]) == (2, 1)
    assert repeated["abort_reasons"] == "repeated at the operator's wish"
    touches = next(one.plan for one in sessions(TEXT)).trials[2].touches
    assert found.touches["attempt_id"].eq(repeated["attempt_id"]).sum() == len(touches)
    assert repeated["change"] == "same"


def test_a_trial_left_in_the_middle_has_its_touch_and_no_answer() -> None:
    found = load_sessions([one.events for one in sessions(TEXT) if one.participant == "D01"])
    left = found.trials.reset_index().iloc[1]
    assert (left["attempts"], left["answered"]) == (1, False)
    assert left[["change", "answered_utc", "duration_s"]].isna().all()
    touch = found.touches[found.touches["attempt_id"].eq(left["attempt_id"])]
    assert touch["commanded_voltage_v"].tolist() == [100.0]
    assert touch["start_voltage_v"].isna().all()
    assert found.sessions["session_completed"].tolist() == [False]


def practised_again() -> tuple[Written, Trial]:
    """A session whose practice trial was scored 3 and has begun again."""
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
    return session, trial


def test_practice_that_is_asked_again_counts_as_answered_last() -> None:
    session, trial = practised_again()
    session.answer(trial, 8)
    trials = trials_in(session)
    assert trials[["attempts", "aborted", "score"]].to_numpy().tolist() == [[2, 0, 8]]


def test_practice_that_is_cut_off_when_it_is_asked_again_has_no_answer() -> None:
    session, trial = practised_again()
    session.add("trial-aborted", index=trial.index, why="stopped")
    found = load_sessions([session.events])
    assert found.answered.empty
    assert found.trials["score"].isna().all()


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
    trials = trials_in(session)
    assert trials[["level", "study_sha256"]].to_numpy().tolist() == [[0.5, "amended"]]


def test_notes_stand_with_the_trial_they_were_typed_at() -> None:
    notes = trials_of("P-01")["notes"][:3].tolist()
    assert notes == [f"{NOTES[at]}\n{NOTES[at + 7]}" for at in range(3)]


def test_a_note_before_the_first_trial_stands_with_it() -> None:
    session = Written("P01")
    session.add("note", text="late")
    session.arm()
    session.start(session.plan.trials[0])
    session.add("note", text="cold")
    assert trials_in(session)["notes"].tolist() == ["late\ncold"]


def test_notes_and_reasons_of_all_attempts_are_kept() -> None:
    session = Written("P01")
    session.arm()
    first = session.plan.trials[0]
    for word in ("one", "two"):
        session.start(first)
        session.add("note", text=word)
        session.abort(first, f"reason {word}")
    trials = trials_in(session)
    assert trials["notes"].tolist() == ["one\ntwo"]
    assert trials["abort_reasons"].tolist() == ["reason one\nreason two"]


def test_what_was_taken_out_is_marked_and_listed() -> None:
    events = [*paper_session(), TrialExcluded(index=3, reason="a noise")]
    found = load_sessions([chain(events)])
    assert values(found.trials["exclusion"]) == [None] * 3 + ["a noise"] + [None] * 3
    assert [(entry.trial, entry.why) for entry in found.exclusions] == [(3, "a noise")]
    assert trials_of("E01")["exclusion"].isna().all()


def test_the_place_of_a_touch_is_the_median_of_its_trace_while_the_finger_was_down() -> None:
    found = load_sessions([chain(paper_session())])
    held = found.touches["place"].ne("path")
    assert found.places_m.notna().tolist() == held.tolist()
    lifted = found.traces.assign(force_n=0.0)
    assert replace(found, traces=lifted).places_m.isna().all()


def test_a_published_table_has_a_trial_per_score() -> None:
    found = load_sessions([published_chain("1", {"voltage": 9.0, "pressure": None})])
    assert found.trials["condition"].tolist() == ["voltage", "pressure"]
    assert values(found.trials["score"]) == [9.0, None]
    assert found.trials[["attempts", "aborted"]].isna().all(axis=None)
    assert found.sessions["session_kind"].tolist() == ["published"]


def test_of_no_sessions_there_are_tables_without_rows() -> None:
    found = load_sessions([])
    assert all(one.empty for one in (found.sessions, found.trials, found.answered, found.places_m))


def test_a_seed_or_a_note_may_be_anything() -> None:
    events = [*paper_session(), NoteTaken(text="half \ud800 a character")]
    events[0] = replace(events[0], seed=10**30)  # type: ignore[call-arg]
    found = load_sessions([chain(events)])
    assert found.sessions["seed"].tolist() == [10**30]
    assert found.trials["notes"].iloc[-1] == "half \ud800 a character"


@pytest.mark.parametrize("before", [True, False])
def test_garbage_is_collected_after_loading_as_it_was_before(before: bool) -> None:
    while_loading: list[bool] = []

    def chains() -> Iterator[list[StoredEvent]]:
        while_loading.append(gc.isenabled())
        yield chain(paper_session())
        raise LookupError

    (gc.enable if before else gc.disable)()
    try:
        with pytest.raises(LookupError):
            load_sessions(chains())
        assert (while_loading, gc.isenabled()) == ([False], before)
    finally:
        gc.enable()
