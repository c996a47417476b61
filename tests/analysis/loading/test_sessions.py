"""From events to trials, and from trials to what the model predicts for what was done."""

from typing import Any

import numpy as np
import pytest

from analysis.loading.exclusions import Exclusion
from analysis.loading.sessions import Happened, answered_trials
from analysis.loading.study_data import NothingToReport, load_study_data
from analysis.trials.contrasts import stepped, trial_contrasts
from device.friction.changes import CONDITIONS
from device.friction.contrasts import predicted_contrast
from protocol.study.design import Exclusions
from protocol.study_file.loading import parsed_study, template
from tests.analysis.reports import EXTENDED, PAPER, imported, session_events

FORCE = {"planned": 0.5, "measured": 0.75}


def paper_session(**changes: Any) -> list[Happened]:
    return session_events(PAPER, 0, np.random.default_rng(3), **changes)


def test_rows_are_in_the_order_of_answers_and_know_their_neighbours() -> None:
    rows = answered_trials(paper_session())
    assert [row.kind for row in rows] == ["baseline", "signal", *["trial"] * 5]
    scored = [row for row in rows if row.is_scored]
    assert [row.place for row in scored] == [1, 2, 3, 4, 5]
    assert scored[0].previous is None
    assert [row.previous for row in scored[1:]] == [row.condition for row in scored[:-1]]


def test_a_trial_answered_again_counts_once_and_an_aborted_touch_not_at_all() -> None:
    events = paper_session()
    last = len(events) - 3
    started = max(n for n, (tag, _) in enumerate(events) if tag == "trial-started")
    again = [*events[: started + 3], ("trial-aborted", {"index": 6}), *events[started:]]
    assert answered_trials(again)[-1].touches == answered_trials(events)[-1].touches
    twice = [*events[: last + 1], *events[last:]]
    assert len(answered_trials(twice)) == len(answered_trials(events))


def test_what_was_planned_is_predicted_where_nothing_was_measured() -> None:
    found = load_study_data([paper_session(measured=False)], rehearsals=False)
    contrasts = trial_contrasts(PAPER, found.rows)
    assert not contrasts.measured.any()
    for row, contrast in zip(found.rows, contrasts.by_law["coulomb"], strict=True):
        if row.condition is not None:
            assert contrast == pytest.approx(
                predicted_contrast(CONDITIONS[row.condition], "coulomb"), rel=0.02
            )


def test_measured_force_is_taken_in_place_of_the_planned_one() -> None:
    found = []
    for force_n in FORCE.values():
        events = [
            (tag, {**payload, "judged": {"force_n": force_n}} if tag == "touch-ended" else payload)
            for tag, payload in paper_session(measured=False)
        ]
        rows = load_study_data([events], rehearsals=False).rows
        signal = next(number for number, row in enumerate(rows) if row.kind == "signal")
        found.append(trial_contrasts(PAPER, rows).by_law["consistent"][signal])
    assert found[1] > found[0], "the inertial load counts less under a heavier finger"


def under(text: str, events: list[Happened]) -> list[Happened]:
    return [(events[0][0], {**events[0][1], "study_text": text}), *events[1:]]


def test_a_trial_is_predicted_under_the_study_that_was_in_force() -> None:
    text = template("paper")
    heavy = text.replace("force_n = 0.5", "force_n = 2.0")
    assert parsed_study(heavy).touch.force_n == 2.0
    plain = paper_session(measured=False)
    resumed: list[Happened] = [*plain[:3], ("session-resumed", {"study_text": heavy}), *plain[3:]]
    found = [
        trial_contrasts(PAPER, answered_trials(events)).by_law["consistent"][1]
        for events in (plain, under(text, plain), under(heavy, plain), under(text, resumed))
    ]
    assert found[0] == found[1] != found[2] == found[3]


def test_a_resumed_session_goes_on_under_the_amended_plan() -> None:
    plain = paper_session(measured=False)
    last = plain[0][1]["trials"][-1]
    amended = {**last, "touches": [{**touch, "press": 2.0} for touch in last["touches"]]}
    resumed: list[Happened] = [*plain[:3], ("session-resumed", {"trials": [amended]}), *plain[3:]]
    before, after = answered_trials(plain), answered_trials(resumed)
    assert before[:-1] == after[:-1]
    assert {done.planned.press for done in after[-1].touches} == {2.0}


def test_a_study_that_cannot_be_read_any_more_gives_way_to_the_present_one() -> None:
    plain = paper_session(measured=False)
    assert answered_trials(under("[study]\nfuture = 1", plain)) == answered_trials(plain)


def test_measured_values_count_in_steps_from_the_planned_one() -> None:
    assert stepped(0.5028, 0.5, 0.025) == 0.5
    assert stepped(0.6, 0.5, 0.025) == 0.6
    assert stepped(0.0421, 0.0414, 0.0005) == 0.0419


def test_a_published_condition_without_a_scene_has_no_prediction() -> None:
    rows = imported([[5, 6]], names=("voltage", "temperature")).rows
    found = trial_contrasts(PAPER, rows).by_law["consistent"]
    assert found[0] == predicted_contrast(CONDITIONS["voltage"])
    assert np.isnan(found[1])


def with_reaction(events: list[Happened], index: int, seconds: float) -> list[Happened]:
    return [
        (tag, {**payload, "reaction_time_s": [seconds]})
        if tag == "answered" and payload["index"] == index
        else (tag, payload)
        for tag, payload in events
    ]


def test_a_hasty_trial_is_left_out_by_rule_and_said() -> None:
    events = with_reaction(paper_session(), 4, 0.1)
    found = load_study_data([events], rehearsals=False, rules=Exclusions(min_reaction_s=0.2))
    why = "answered after 0.1 s, sooner than 0.2 s"
    assert found.left_out == (Exclusion(participant="P01", session=1, trial=4, by="rule", why=why),)
    assert 4 not in {row.index for row in found.rows}


def test_a_participant_who_breaks_a_rule_is_left_out_and_the_others_stay() -> None:
    rng = np.random.default_rng(5)
    guesser = [
        (tag, {**payload, "agrees": False} if payload.get("kind") == "catch" else payload)
        for tag, payload in session_events(EXTENDED, 0, rng)
    ]
    sessions = [guesser, session_events(EXTENDED, 1, rng)]
    found = load_study_data(sessions, rehearsals=False, rules=EXTENDED.exclusions)
    assert found.table.subjects == ("P02",)
    assert found.left_out[0].why == "a change reported on 4 of 4 catch trials, more than 50%"


def test_rules_that_leave_nobody_say_so() -> None:
    with pytest.raises(NothingToReport, match="leave nobody: P01 has 5 valid trials, fewer than 6"):
        load_study_data([paper_session()], rehearsals=False, rules=Exclusions(min_trials=6))


def test_interruptions_and_notes_are_told() -> None:
    events = paper_session()
    events[-1:] = [
        ("note", {"text": "the phone rang"}),
        ("device-off", {"confirmed": False, "why": "the session was interrupted"}),
        ("session-resumed", {}),
    ]
    told = [
        (entry.what, entry.text) for entry in load_study_data([events], rehearsals=False).incidents
    ]
    assert told == [
        ("note", "the phone rang"),
        ("device off, not confirmed", "the session was interrupted"),
        ("resumed", ""),
    ]
