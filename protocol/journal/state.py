"""The state of a session: a fold over its events."""

from collections.abc import Iterable, Mapping, Set
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from protocol.errors import IMPOSSIBLE, WorkFailed
from protocol.journal import events
from protocol.journal.events import TAGS, Opening, StoredEvent
from protocol.journal.records import TrackAnswer

# The states of a session and the events that each allows; all other events are refused.
# docs/journal.md draws the table.

EXCLUDED = ("excluded", "dropped")
"""A session excluded after its completion or before it, which it is again once included."""
UNFINISHED = ("idle", "armed", "paused", "trial", "touching", "driving")
_LIVING = (*UNFINISHED, "completed")

_TABLE = """
new        session-opened idle        scores-imported completed  study-amended amended
new        study-registered registered
amended    study-amended amended      study-registered registered
registered study-amended amended      study-registered registered
idle       session-resumed idle       practice-renewed idle      device-armed armed
idle       session-completed completed
idle       rig-described idle         question-answered idle
armed      watchdog-tested armed      rig-described armed        resonance-measured armed
armed      beam-mounted armed         trial-started trial        question-answered armed
armed      paused paused              device-off idle            practice-renewed armed
armed      trials-not-needed armed    drive-started driving
paused     question-answered paused   unpaused armed             device-off idle
trial      question-answered trial    beam-mounted trial         touch-started touching
trial      answered armed             trial-aborted armed        trial-deferred armed
touching   question-answered touching touch-recorded touching    touch-ended trial
touching   trial-aborted armed
driving    drive-started driving      touch-recorded driving     drive-ended armed
driving    device-off idle
idle       trial-excluded idle        trial-included idle        session-excluded dropped
completed  trial-excluded completed   trial-included completed   session-excluded excluded
dropped    session-included idle
excluded   session-included completed
"""
# A session is completed only from `idle`: none counts as complete whose output was not read back as
# off. What decides on the group is answered before the device is armed, and in a trial the operator
# corrects an answer. A touch that is broken off has no end of its own.
TRANSITIONS: dict[tuple[str, str], str] = {
    **{
        (state, TAGS[tag].TAG): after
        for state, *moves in map(str.split, _TABLE.strip().splitlines())
        for tag, after in zip(moves[::2], moves[1::2], strict=True)
    },
    **{
        (state, tag): state
        for state in _LIVING
        for tag in (events.NoteTaken.TAG, events.WindowChanged.TAG)
    },
    **{(state, events.Withdrawn.TAG): "withdrawn" for state in (*_LIVING, *EXCLUDED)},
}
"""(state, event) → state. `armed`: the device may be driven. `idle`: it is off and not armed."""


def in_words(state: str, *, running: bool) -> str:
    """Return a session's state as people call it: all unfinished ones are one.

    >>> in_words("touching", running=False), in_words("completed", running=False)
    ('interrupted', 'completed')
    """
    if state in UNFINISHED:
        return "running" if running else "interrupted"
    return EXCLUDED[0] if state in EXCLUDED else state


class NotAllowed(WorkFailed):
    """An event that the session's state does not allow."""


def next_state(state: str, tag: str) -> str:
    """Return the state after the event `tag`, or raise NotAllowed if the table has none."""
    try:
        return TRANSITIONS[state, tag]
    except KeyError:
        raise NotAllowed(f"a session that is {state} does not allow the event {tag!r}") from None


@dataclass(kw_only=True)
class SessionState:
    """The result of the events so far. Only `take` changes it.

    `touch` is the number of the running trial's last touch, None before its first one.
    `questions` holds each answer that was given apart from the trials, by name and block.
    """

    name: str = "new"
    opened: Opening | None = None
    begun: set[int] = field(default_factory=set)
    """Trials that were begun, whatever became of them."""
    trial: int | None = None
    touch: int | None = None
    windowless: bool = False
    """Whether the last touch was begun without a window, which leaves a trace of each response."""
    beam: str | None = None
    described: Mapping[str, str] = field(default_factory=dict)
    """What the operator answered before the session, or before it was resumed."""
    answers: dict[int, str] = field(default_factory=dict)
    questions: dict[tuple[str, int | None], Any] = field(default_factory=dict)
    answered_twice: list[int] = field(default_factory=list)
    aborted: list[int] = field(default_factory=list)
    deferred: list[tuple[int, int]] = field(default_factory=list)
    """Trials that come again, each with the one after which it does."""
    tracks: dict[str, list[TrackAnswer]] = field(default_factory=dict)
    """The answers of each track, in their order, from which its next level follows."""
    not_needed: set[int] = field(default_factory=set)
    """Trials of tracks that have reached their stop."""
    practised: list[bool] = field(default_factory=list)
    """Whether each judged touch of answered practice trials was as instructed."""
    unfelt: dict[int, int] = field(default_factory=dict)
    """How many touches of each answered trial showed no finger; all where no sensor sees one."""
    practice_rounds: int = 1
    excluded: dict[int, str] = field(default_factory=dict)
    completed_utc: datetime | None = None
    last_event_utc: datetime | None = None

    @property
    def answered(self) -> Set[int]:
        """Indices of the trials that have been answered."""
        return self.answers.keys()

    @property
    def planned(self) -> set[int]:
        """Indices of the trials that are planned and needed; none for published scores."""
        trials = () if self.opened is None else self.opened.trials
        return {trial.index for trial in trials} - self.not_needed

    @property
    def noted(self) -> str:
        """What the operator answered, in words; `nothing` if no question has an answer."""
        told = (f"{asked} {answer}" for asked, answer in self.described.items() if answer)
        return ", ".join(told) or "nothing"

    @property
    def is_excluded(self) -> bool:
        """Whether the whole session is excluded."""
        return self.name in EXCLUDED

    @property
    def shown_name(self) -> str:
        """The name of the state for people and programs: one for all excluded sessions."""
        return EXCLUDED[0] if self.is_excluded else self.name

    def take(self, event: StoredEvent) -> None:
        """Apply one more event. Where the state does not allow it, NotAllowed changes nothing."""
        tag = event.tag
        # First of all, so that a refused event changes nothing.
        self.name = next_state(self.name, tag)
        self.last_event_utc = event.utc
        if tag == events.SessionCompleted.TAG:
            self.completed_utc = event.utc
        # After a withdrawal the tags still lead to the state, and there is no payload to look at.
        if (handler := _HANDLERS.get(tag)) is not None and not event.erased:
            handler(self, event.record)

    def _session_opened(self, event: Opening) -> None:
        self.opened = event

    _scores_imported = _session_opened

    def _session_resumed(self, _: events.SessionResumed) -> None:
        self.beam = None  # another beam may have been mounted during an interruption

    def _beam_mounted(self, event: events.BeamMounted) -> None:
        self.beam = event.beam

    def _rig_described(self, event: events.RigDescribed) -> None:
        self.described = event.answers

    def _practice_renewed(self, event: events.PracticeRenewed) -> None:
        # Practice that is renewed counts as not answered: the session then asks for it again.
        again = set(event.indices)
        self.answers = {n: text for n, text in self.answers.items() if n not in again}
        self.practice_rounds += 1

    def _question_answered(self, event: events.QuestionAnswered) -> None:
        for name in event.moot or ():
            self.questions.pop((name, None), None)
        self.questions[event.name, event.block] = event.answer

    def _trial_started(self, event: events.TrialStarted) -> None:
        self.trial, self.touch = event.index, None
        self.begun.add(event.index)

    def _touch_started(self, event: events.TouchStarted) -> None:
        self.touch = event.touch
        self.windowless = bool(event.instruction and event.instruction.trace is None)

    def _trial_aborted(self, event: events.TrialAborted) -> None:
        self.trial = self.touch = None
        self.aborted.append(event.index)

    def _trial_deferred(self, event: events.TrialDeferred) -> None:
        self.trial = self.touch = None
        self.deferred.append((event.index, event.after))

    def _trials_not_needed(self, event: events.TrialsNotNeeded) -> None:
        self.trial = self.touch = None
        self.not_needed.update(event.indices)

    def _answered(self, event: events.Answered) -> None:
        self.trial = self.touch = None
        if event.kind == "practice":
            self.practised += [not made.missed for made in event.judged if made.judged]
        if event.track is not None:
            self.tracks.setdefault(event.track.name, []).append(event.track)
        score = [] if event.score is None else [f"score {event.score}"]
        # No session writes such a journal: `verify` reports it.
        if event.index in self.answers:
            self.answered_twice.append(event.index)
        done = "drawn" if event.kind == "pass" else event.change or "felt"
        self.answers[event.index] = ", ".join([done, *score])
        self.unfelt[event.index] = sum(not made.judged for made in event.judged)

    def _trial_excluded(self, event: events.TrialExcluded) -> None:
        self.excluded.pop(event.index, None)  # the last one stands last
        self.excluded[event.index] = event.reason

    def _trial_included(self, event: events.TrialIncluded) -> None:
        self.excluded.pop(event.index, None)


_HANDLERS = {
    tag: handler
    for tag in TAGS
    if (handler := vars(SessionState).get(f"_{tag.replace('-', '_')}")) is not None
}
"""The methods that take events, each with the name of its event's tag.

Other events change only the name of the state, so that long traces need not be parsed.
"""


def damage(events: Iterable[StoredEvent]) -> str:
    """Return what is wrong with events that could not be used, although their tags are known."""
    return next(filter(None, (it.damage() for it in events)), "its events do not fit together")


def folded(chain: Iterable[StoredEvent]) -> SessionState:
    """Return the state to which the events of `chain` lead from the beginning.

    Raise NotAllowed, with its number, for the first event that may not come or is damaged.
    """
    state = SessionState()
    for event in chain:
        try:
            state.take(event)
        except NotAllowed as error:
            raise NotAllowed(f"event {event.seq}: {error}") from None
        except IMPOSSIBLE as error:
            wrong = event.damage() or f"event {event.seq} does not fit those before it"
            raise NotAllowed(wrong) from error
    return state
