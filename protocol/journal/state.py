"""Where a session stands: a fold over its events, and nothing else."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from protocol.journal.transitions import next_state


@dataclass(frozen=True, kw_only=True, slots=True)
class Event:
    """One thing that happened. `tag` is a plain string; `payload` is JSON, empty once erased."""

    seq: int
    tag: str
    utc: datetime
    monotonic_s: float
    payload: Mapping[str, Any]
    erased: bool = False


@dataclass(kw_only=True)
class SessionState:
    """What the events so far add up to. Only `take` changes it."""

    name: str = "new"
    opened: Mapping[str, Any] | None = None
    trial: int | None = None
    beam: str | None = None
    answered: set[int] = field(default_factory=set)
    answered_twice: list[int] = field(default_factory=list)
    aborted: list[int] = field(default_factory=list)
    attempts: dict[int, int] = field(default_factory=dict)
    excluded: dict[int, str] = field(default_factory=dict)
    amended_to: list[str] = field(default_factory=list)
    last_answer: str = ""
    last_event_utc: datetime | None = None

    def take(self, event: Event) -> None:
        """Take one more event in.

        Raises:
            NotAllowed: the state does not permit it; nothing changes.
        """
        self.name = next_state(self.name, event.tag)
        self.last_event_utc = event.utc
        if not event.erased:
            self._take_payload(event.tag, event.payload)

    def _take_payload(self, tag: str, payload: Mapping[str, Any]) -> None:
        match tag:
            case "session-opened" | "scores-imported":
                self.opened = payload
            case "study-amended":
                self.amended_to.append(payload["study_sha256"])
            case "beam-mounted" | "session-resumed":  # meanwhile another may have been mounted
                self.beam = payload.get("beam")
            case "practice-renewed":
                self.answered.difference_update(payload["indices"])
            case "trial-excluded":
                self.excluded[payload["index"]] = payload["reason"]
            case "answered":
                self.last_answer = _in_words(payload)
                self._take_trial(tag, payload["index"])
            case "trial-started" | "trial-aborted":
                self._take_trial(tag, payload["index"])

    def _take_trial(self, tag: str, index: int) -> None:
        self.trial = index if tag == "trial-started" else None
        match tag:
            case "trial-started":
                self.attempts[index] = self.attempts.get(index, 0) + 1
            case "trial-aborted":
                self.aborted.append(index)
            case "answered":
                if index in self.answered:
                    self.answered_twice.append(index)
                self.answered.add(index)


def _in_words(answer: Mapping[str, Any]) -> str:
    change, score = answer.get("change"), answer.get("score")
    return ", ".join([change or "felt", *([] if score is None else [f"score {score}"])])


def folded(events: Iterable[Event]) -> SessionState:
    """Return the state that `events` lead to from the beginning.

    Raises:
        NotAllowed: one of them is not permitted where it stands.
    """
    state = SessionState()
    for event in events:
        state.take(event)
    return state
