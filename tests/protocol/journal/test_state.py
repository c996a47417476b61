"""The state of a session is what its events make of it, one after the other."""

from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from protocol.journal.events import StoredEvent
from protocol.journal.state import SessionState, folded
from protocol.journal.transitions import NotAllowed

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


def test_an_excluded_trial_keeps_its_reason() -> None:
    state = after(("trial-excluded", {"index": 2, "reason": "a slip"}))
    assert state.excluded == {2: "a slip"}
    assert state.name == "idle"


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


def test_an_event_that_is_not_allowed_changes_nothing() -> None:
    with pytest.raises(NotAllowed, match="a session that is idle does not allow"):
        after(started(0))
