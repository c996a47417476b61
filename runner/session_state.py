"""Where a session stands: a fold over its events, and nothing else."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any

from runner.transitions import next_state


@dataclass(frozen=True, kw_only=True)
class Event:
    """One thing that happened. `tag` is a plain string; `payload` is JSON."""

    seq: int
    tag: str
    utc: datetime
    monotonic_s: float
    payload: Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class SessionState:
    """What the events so far add up to."""

    name: str = "new"
    opened: Mapping[str, Any] | None = None
    trial: int | None = None
    beam: str | None = None
    answered: frozenset[int] = frozenset()
    aborted: tuple[int, ...] = ()
    attempts: Mapping[int, int] = field(default_factory=dict)


def after(state: SessionState, tag: str, payload: Mapping[str, Any]) -> SessionState:
    """Return `state` after one more event.

    Raises:
        NotAllowed: the state does not permit it.
    """
    moved = replace(state, name=next_state(state.name, tag))
    match tag:
        case "session-opened" | "scores-imported":
            return replace(moved, opened=payload)
        case "beam-mounted":
            return replace(moved, beam=payload["beam"])
        case "trial-started":
            index = payload["index"]
            attempts = {**state.attempts, index: state.attempts.get(index, 0) + 1}
            return replace(moved, trial=index, attempts=attempts)
        case "answered":
            return replace(moved, trial=None, answered=state.answered | {payload["index"]})
        case "trial-aborted":
            return replace(moved, trial=None, aborted=(*state.aborted, payload["index"]))
    return moved


def folded(events: Iterable[Event]) -> SessionState:
    """Return the state that `events` lead to from the beginning."""
    state = SessionState()
    for event in events:
        state = after(state, event.tag, event.payload)
    return state
