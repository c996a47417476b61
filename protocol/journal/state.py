"""The state of a session: a fold over its events."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import datetime

from protocol.journal.events import (
    Answered,
    BeamMounted,
    Event,
    Opening,
    PracticeRenewed,
    ScoresImported,
    SessionOpened,
    SessionResumed,
    StoredEvent,
    TrialAborted,
    TrialExcluded,
    TrialStarted,
)
from protocol.journal.transitions import next_state

_FOLDED = frozenset(
    kind.TAG
    for kind in (
        SessionOpened,
        ScoresImported,
        SessionResumed,
        BeamMounted,
        PracticeRenewed,
        TrialStarted,
        TrialAborted,
        Answered,
        TrialExcluded,
    )
)
"""The other events change only the name of the state, so that long traces need not be parsed."""


@dataclass(kw_only=True)
class SessionState:
    """The result of the events so far. Only `take` changes it."""

    name: str = "new"
    opened: Opening | None = None
    trial: int | None = None
    beam: str | None = None
    answered: set[int] = field(default_factory=set)
    answered_twice: list[int] = field(default_factory=list)
    aborted: list[int] = field(default_factory=list)
    excluded: dict[int, str] = field(default_factory=dict)
    last_answer: str = ""
    last_event_utc: datetime | None = None

    @property
    def planned(self) -> set[int]:
        """Indices of the planned trials; empty for published scores or after a withdrawal."""
        return set() if self.opened is None else {trial.index for trial in self.opened.trials}

    def take(self, event: StoredEvent) -> None:
        """Apply one more event.

        Raises:
            NotAllowed: the state does not allow it; nothing changes.
            KeyError, TypeError, AttributeError: no build has written such a payload.
        """
        self.name = next_state(self.name, event.tag)
        self.last_event_utc = event.utc
        if event.tag in _FOLDED and not event.erased:
            self._take_record(event.record)

    def _take_record(self, event: Event) -> None:
        match event:
            case SessionOpened() | ScoresImported():
                self.opened = event
            case SessionResumed():
                self.beam = None  # another may have been mounted during the interruption
            case BeamMounted():
                self.beam = event.beam
            case PracticeRenewed():
                self.answered.difference_update(event.indices)
            case TrialExcluded():
                self.excluded[event.index] = event.reason
            case TrialStarted() | TrialAborted() | Answered():
                self._take_trial(event)

    def _take_trial(self, event: TrialStarted | TrialAborted | Answered) -> None:
        self.trial = event.index if isinstance(event, TrialStarted) else None
        match event:
            case TrialAborted():
                self.aborted.append(event.index)
            case Answered():
                self.last_answer = _in_words(event)
                if event.index in self.answered:
                    self.answered_twice.append(event.index)
                self.answered.add(event.index)


def _in_words(answer: Answered) -> str:
    score = [] if answer.score is None else [f"score {answer.score}"]
    return ", ".join([answer.change or "felt", *score])


def folded(events: Iterable[StoredEvent]) -> SessionState:
    """Return the state to which `events` lead from the beginning.

    Raises:
        NotAllowed: one of them is not allowed in the state before it.
        KeyError, TypeError, AttributeError: no build has written such a payload.
    """
    state = SessionState()
    for event in events:
        state.take(event)
    return state
