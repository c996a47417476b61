"""The table of transitions: what it allows, and that it refuses everything else."""

from datetime import UTC, datetime
from typing import Any

import pytest

from protocol.journal.state import Event, SessionState
from protocol.journal.transitions import TRANSITIONS, NotAllowed, next_state

STATES = {state for state, _ in TRANSITIONS} | set(TRANSITIONS.values())
TAGS = {tag for _, tag in TRANSITIONS}
FORBIDDEN = sorted((s, t) for s in STATES for t in TAGS if (s, t) not in TRANSITIONS)


@pytest.mark.parametrize(("state", "tag"), FORBIDDEN)
def test_what_the_table_does_not_allow_is_refused(state: str, tag: str) -> None:
    with pytest.raises(NotAllowed, match=f"{state} does not allow the event '{tag}'"):
        next_state(state, tag)


def event(tag: str, **payload: Any) -> Event:
    noon = datetime(2026, 1, 1, 12, tzinfo=UTC)
    return Event(seq=0, tag=tag, utc=noon, monotonic_s=0.0, payload=payload)


def test_every_state_can_be_reached_and_all_but_the_last_can_be_left() -> None:
    assert STATES - set(TRANSITIONS.values()) == {"new"}
    assert STATES - {state for state, _ in TRANSITIONS} == {"withdrawn"}


def test_a_trial_is_answered_once() -> None:
    state = SessionState(name="armed")
    for tag in ("trial-started", "answered"):
        state.take(event(tag, index=3))
    assert state.answered == {3}
    assert state.attempts == {3: 1}
    assert state.trial is None


def test_an_aborted_trial_stays_to_be_answered() -> None:
    state = SessionState(name="armed")
    for tag in ("trial-started", "trial-aborted", "trial-started"):
        state.take(event(tag, index=3))
    assert (state.answered, state.aborted, state.attempts) == (set(), [3], {3: 2})


@pytest.mark.parametrize(("state", "tag"), FORBIDDEN)
def test_what_is_refused_changes_nothing(state: str, tag: str) -> None:
    before, after = SessionState(name=state), SessionState(name=state)
    with pytest.raises(NotAllowed):
        after.take(event(tag, index=3, beam="1 mm", study_sha256="", reason="", indices=[]))
    assert after == before
