"""The state of a session is what its events make of it, one after the other."""

from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from protocol.journal.events import StoredEvent
from protocol.journal.state import NotAllowed, SessionState, folded, in_words

Happened = tuple[str, dict[str, Any]]
NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)
TRIALS = [{"index": index, "kind": "trial", "condition": "a"} for index in (0, 1, 2)]
OPENED: dict[str, Any] = {
    "participant": "P01",
    "session": 1,
    "kind": "participant",
    "conditions": ["a"],
    "trials": TRIALS,
}
ARMED = {"idn": "a board", "boot": 1, "device_time_s": 0.0}
TOUCH = {"touch": 0, "commanded": {"voltage_v": 1.0, "frequency_hz": 1.0, "ramp_v_per_s": 1.0}}


def answer(index: int, **given: Any) -> Happened:
    told = {"change": None, "score": None, **given}
    return "answered", {"index": index, "kind": "trial", "condition": "a", **told}


def after(*happened: Happened, erased: bool = False) -> SessionState:
    """The state after these events, a second apart, of a session that was opened."""
    events = [("session-opened", OPENED), *happened]
    return folded(
        StoredEvent(
            seq=seq,
            tag=tag,
            utc=NOON + timedelta(seconds=seq),
            monotonic_s=float(seq),
            payload={} if erased else payload,
            erased=erased,
        )
        for seq, (tag, payload) in enumerate(events)
    )


def started(index: int) -> Happened:
    return "trial-started", {"index": index, "kind": "trial"}


def test_a_new_session_has_nothing() -> None:
    state = folded([])
    assert state == SessionState(name="new")
    assert state.planned == set()
    assert state.last_event_utc is None
    assert (state.windowless, state.practice_rounds) == (False, 1)


def test_an_opened_session_has_its_plan() -> None:
    state = after()
    assert (state.name, state.planned) == ("idle", {0, 1, 2})
    assert state.opened is not None
    assert state.opened.participant == "P01"
    assert state.last_event_utc == NOON


def test_imported_scores_have_no_plan() -> None:
    payload = {"participant": "s1", "conditions": ["a"], "scores": {"a": 3.0}}
    state = folded(
        [StoredEvent(seq=0, tag="scores-imported", utc=NOON, monotonic_s=0.0, payload=payload)]
    )
    assert state.name == "completed"
    assert state.opened is not None
    assert state.planned == set()


def test_a_trial_is_running_until_it_is_answered_or_aborted() -> None:
    armed = ("device-armed", ARMED)
    assert after(armed, started(1)).trial == 1
    state = after(armed, started(1), ("trial-aborted", {"index": 1, "why": "x"}))
    assert (state.trial, state.aborted, state.answered) == (None, [1], set())
    state = after(armed, started(1), answer(1, change="rougher", score=4))
    assert (state.trial, state.aborted, state.answered) == (None, [], {1})
    assert state.answers == {1: "rougher, score 4"}
    assert state.answered_twice == []


@pytest.mark.parametrize(
    "became",
    [
        [],
        [answer(0)],
        [("trial-aborted", {"index": 0, "why": "x"})],
        [("trial-deferred", {"index": 0, "missed": ["force"], "after": 1})],
        [answer(0), ("device-off", {"confirmed": True}), ("practice-renewed", {"indices": [0]})],
    ],
)
def test_a_session_has_begun_with_its_first_trial(became: list[Happened]) -> None:
    armed = ("device-armed", ARMED)
    assert after(armed).begun == set()
    assert after(armed, started(0), *became).begun == {0}


@pytest.mark.parametrize(
    ("given", "shown"),
    [({}, "felt"), ({"change": "same"}, "same"), ({"change": "same", "score": 0}, "same, score 0")],
)
def test_an_answer_is_shown_with_its_score(given: dict[str, Any], shown: str) -> None:
    assert after(("device-armed", ARMED), started(0), answer(0, **given)).answers == {0: shown}


def test_a_trial_that_is_answered_twice_is_noted() -> None:
    armed = ("device-armed", ARMED)
    state = after(armed, started(1), answer(1), started(2), answer(2), started(1), answer(1))
    assert (state.answered, state.answered_twice) == ({1, 2}, [1])


def test_practice_that_is_renewed_is_open_again() -> None:
    off = ("device-off", {"confirmed": True, "why": "x"})
    armed = ("device-armed", ARMED)
    renewed = ("practice-renewed", {"indices": [0]})
    state = after(armed, started(0), answer(0), started(1), answer(1), off, renewed)
    assert state.answered == {1}
    again = after(armed, started(0), answer(0), off, renewed, armed, started(0), answer(0))
    assert again.answered_twice == []


def test_a_beam_is_mounted_until_the_session_is_resumed() -> None:
    events: list[Happened] = [("device-armed", ARMED), ("beam-mounted", {"beam": "b1"})]
    assert after(*events).beam == "b1"
    off = ("device-off", {"confirmed": True, "why": "x"})
    assert after(*events, off).beam == "b1"
    assert after(*events, off, ("session-resumed", {})).beam is None


def test_each_renewal_of_practice_is_counted() -> None:
    renewed: Happened = ("practice-renewed", {"indices": []})
    assert [after(*[renewed] * times).practice_rounds for times in range(3)] == [1, 2, 3]


def test_touches_without_a_finger_are_counted_once_for_each_answered_trial() -> None:
    armed, felt = ("device-armed", ARMED), {"force_ok": True, "place_ok": False}
    once, again = answer(0, judged=[felt, {}, {}]), answer(0, judged=[{}, felt])
    assert after(armed, started(0), once).unfelt == {0: 2}
    assert after(armed, started(0), once, started(0), again).unfelt == {0: 1}


def test_touches_of_answered_practice_are_counted_if_they_were_judged() -> None:
    right, wrong = {"force_ok": True, "place_ok": True}, {"force_ok": True, "place_ok": False}
    armed, judged = ("device-armed", ARMED), [right, {}, wrong]
    practice = answer(0, kind="practice", judged=judged)
    assert after(armed, started(0), practice).practised == [True, False]
    assert after(armed, started(0), answer(0, judged=judged)).practised == []


def test_a_drawn_pass_is_shown_as_such() -> None:
    drawn = answer(0, kind="pass", change="same")
    assert after(("device-armed", ARMED), started(0), drawn).answers == {0: "drawn"}


def test_the_last_touch_is_known_until_its_trial_is_over() -> None:
    armed, second = ("device-armed", ARMED), ("touch-started", {**TOUCH, "touch": 2})
    touching = after(armed, started(1), second)
    assert (touching.touch, touching.windowless) == (2, False)
    aborted = ("trial-aborted", {"index": 1, "why": "x"})
    assert after(armed, started(1), second, aborted, started(1)).touch is None


@pytest.mark.parametrize(("trace", "windowless"), [(None, True), ({"keys": []}, False)])
def test_a_response_without_a_trace_was_given_without_a_window(
    trace: dict[str, Any] | None, windowless: bool
) -> None:
    ready = {"answer": "ready", "reaction_time_s": 1.0, "trace": trace}
    touch = ("touch-started", {**TOUCH, "instruction": ready})
    assert after(("device-armed", ARMED), started(1), touch).windowless is windowless


def test_a_deferred_trial_is_noted_with_the_one_before_it() -> None:
    deferred = ("trial-deferred", {"index": 0, "after": 2})
    state = after(("device-armed", ARMED), started(0), deferred)
    assert (state.deferred, state.trial, state.answered) == ([(0, 2)], None, set())


def test_a_question_is_noted_with_the_block_that_it_followed() -> None:
    told = {"answer": "a", "reaction_time_s": 1.0, "trace": None}
    asked = {"name": "q", "when": "block", **told}
    first, second = (("question-answered", {**asked, "block": block}) for block in (1, None))
    assert after(("device-armed", ARMED), first, second).questions == {
        ("q", 1): "a",
        ("q", None): "a",
    }


def test_an_excluded_trial_keeps_its_reason_until_it_is_included() -> None:
    excluded = ("trial-excluded", {"index": 2, "reason": "a slip"})
    state = after(excluded)
    assert state.excluded == {2: "a slip"}
    assert state.name == "idle"
    assert after(excluded, ("trial-included", {"index": 2, "reason": "it was none"})).excluded == {}


def test_a_session_excluded_before_its_end_or_after_it_is_shown_as_excluded() -> None:
    excluded = ("session-excluded", {"reason": "ill"})
    before, later = after(excluded), after(("session-completed", {}), excluded)
    assert (before.name, later.name) == ("dropped", "excluded")
    for state in (before, later):
        assert state.is_excluded
        assert state.shown_name == "excluded"
        assert in_words(state.name, running=False) == "excluded"
    assert not after().is_excluded
    assert after().shown_name == "idle"
    assert in_words("touching", running=True) == "running"
    assert in_words("idle", running=False) == "interrupted"


def test_of_erased_events_only_the_state_is_left() -> None:
    armed = ("device-armed", ARMED)
    state = after(armed, started(0), answer(0), ("withdrawn", {}), erased=True)
    assert state.name == "withdrawn"
    assert (state.opened, state.planned, state.answered) == (None, set(), set())
    assert state.last_event_utc == NOON + timedelta(seconds=4)


def test_long_traces_are_not_read_for_the_state() -> None:
    """A payload that nobody can parse does no harm where nothing of it is needed."""
    state = after(("device-armed", {"what": "nobody wrote"}))
    assert state.name == "armed"


@pytest.mark.parametrize(
    ("answers", "said"),
    [({"skin": "dry", "room": "", "beam": "clean"}, "skin dry, beam clean"), ({}, "nothing")],
)
def test_what_the_operator_noted_is_said_without_what_is_empty(
    answers: dict[str, str], said: str
) -> None:
    described = ("rig-described", {"answers": answers})
    assert after(("device-armed", ARMED), described).noted == said


def test_a_damaged_event_is_told_by_its_key() -> None:
    with pytest.raises(NotAllowed, match=r"^event 2 is damaged: trial-started, index is missing$"):
        after(("device-armed", ARMED), ("trial-started", {"kind": "trial"}))


def test_an_event_that_is_not_allowed_changes_nothing() -> None:
    with pytest.raises(NotAllowed, match="a session that is idle does not allow"):
        after(started(0))
