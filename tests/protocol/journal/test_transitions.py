"""The table of transitions: it refuses every event that it does not list."""

from datetime import UTC, datetime

import pytest

from protocol.journal.events import (
    Answered,
    Event,
    StoredEvent,
    TrialAborted,
    TrialStarted,
)
from protocol.journal.state import TRANSITIONS, NotAllowed, SessionState, next_state

STATES = {state for state, _ in TRANSITIONS} | set(TRANSITIONS.values())
TAGS = {tag for _, tag in TRANSITIONS}
FORBIDDEN = sorted((s, t) for s in STATES for t in TAGS if (s, t) not in TRANSITIONS)


DRAWN = """
new        session-opened idle          scores-imported completed    study-amended amended
new        study-registered registered
amended    study-amended amended        study-registered registered
registered study-amended amended        study-registered registered
idle       session-resumed idle         practice-renewed idle        trial-excluded idle
idle       device-armed armed           session-completed completed  session-excluded dropped
idle       trial-included idle          rig-described idle           question-answered idle
armed      watchdog-tested armed        rig-described armed          resonance-measured armed
armed      beam-mounted armed           trial-started trial          paused paused
armed      device-off idle              practice-renewed armed       question-answered armed
armed      trials-not-needed armed      drive-started driving
driving    drive-started driving        drive-ended armed            device-off idle
driving    touch-recorded driving
paused     question-answered paused
trial      question-answered trial
touching   question-answered touching
paused     unpaused armed               device-off idle
trial      beam-mounted trial           touch-started touching
trial      answered armed               trial-aborted armed          trial-deferred armed
touching   touch-ended trial            trial-aborted armed          touch-recorded touching
completed  trial-excluded completed     session-excluded excluded    trial-included completed
dropped    session-included idle
excluded   session-included completed
"""
"""The table as docs/journal.md has it, without notes, windows and withdrawals."""
LIVING = {"idle", "armed", "paused", "trial", "touching", "driving", "completed"}


def test_the_table_is_the_one_that_is_documented() -> None:
    drawn: dict[tuple[str, str], str] = {}
    for state, *moves in map(str.split, DRAWN.strip().splitlines()):
        drawn |= {(state, tag): after for tag, after in zip(moves[::2], moves[1::2], strict=True)}
    drawn |= {(state, tag): state for state in LIVING for tag in ("note", "window-changed")}
    drawn |= {(state, "withdrawn"): "withdrawn" for state in LIVING | {"excluded", "dropped"}}
    assert drawn == TRANSITIONS


@pytest.mark.parametrize(("state", "tag"), FORBIDDEN)
def test_events_not_in_the_table_are_refused(state: str, tag: str) -> None:
    with pytest.raises(NotAllowed, match=f"{state} does not allow the event '{tag}'"):
        next_state(state, tag)


NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)
STARTED = TrialStarted(index=3, kind="trial")
ABORTED = TrialAborted(index=3, why="repeated at the operator's wish")
ANSWERED = Answered.from_json({"index": 3, "kind": "trial", "condition": "a", "score": 7})


def stored(event: Event) -> StoredEvent:
    return StoredEvent(seq=0, tag=event.TAG, utc=NOON, monotonic_s=0.0, payload=event.to_json())


def test_every_state_can_be_reached_and_all_but_the_last_can_be_left() -> None:
    assert STATES - set(TRANSITIONS.values()) == {"new"}
    assert STATES - {state for state, _ in TRANSITIONS} == {"withdrawn"}


def test_a_trial_is_answered_once() -> None:
    state = SessionState(name="armed")
    for event in (STARTED, ANSWERED):
        state.take(stored(event))
    assert state.answered == {3}
    assert state.trial is None
    assert state.answers == {3: "felt, score 7"}


def test_an_aborted_trial_remains_pending() -> None:
    state = SessionState(name="armed")
    for event in (STARTED, ABORTED, STARTED):
        state.take(stored(event))
    assert (state.answered, state.aborted, state.trial) == (set(), [3], 3)


@pytest.mark.parametrize(("state", "tag"), FORBIDDEN)
def test_a_refused_event_changes_nothing(state: str, tag: str) -> None:
    before, after = SessionState(name=state), SessionState(name=state)
    with pytest.raises(NotAllowed):
        after.take(StoredEvent(seq=0, tag=tag, utc=NOON, monotonic_s=0.0, payload={}))
    assert after == before
