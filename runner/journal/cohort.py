"""The cohort as recorded in the journal: sessions, their states and their slots."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime, timedelta
from math import inf
from typing import Any

from protocol.errors import BadInput, listed
from protocol.journal.events import Opening, terms_in
from protocol.journal.records import PlannedTrial
from protocol.journal.state import EXCLUDED, SessionState
from protocol.plan.plan import SlotState, arrivals, next_slot
from protocol.plan.trials import Trial
from protocol.study.study import Study
from runner.journal.names import STUDY_CHAIN, parsed_name
from runner.journal.store import Journal, state_of
from runner.journal.verification import readable_events

_GONE = {*EXCLUDED, "withdrawn"}


@dataclass(frozen=True, kw_only=True)
class SessionSummary:
    """One session in the status of a study."""

    participant: str
    session: int
    kind: str
    state: str
    slot: int | None
    answered: int
    planned: int
    excluded_trials: int
    group: str | None

    def record(self) -> dict[str, Any]:
        return {name: value for name, value in asdict(self).items() if name != "group" or value}


def states(journal: Journal) -> dict[str, SessionState]:
    """Return the states of all sessions by name, without the study's own chain."""
    names = [name for name in journal.sessions() if name != STUDY_CHAIN]
    return {name: state_of(name, readable_events(journal, name)) for name in names}


def planned_trials(journal: Journal, chain: str) -> list[PlannedTrial]:
    """Return the trials as last planned; raises `BadInput` if withdrawn or imported."""
    planned: dict[int, PlannedTrial] = {}
    for terms in terms_in(readable_events(journal, chain)):
        planned |= {trial.index: trial for trial in terms.trials}
    if not planned:
        raise BadInput(f"{chain} has no plan: withdrawn, or imported scores")
    return list(planned.values())


def session_summaries(sessions: Mapping[str, SessionState]) -> list[SessionSummary]:
    """Return a summary of each session, in the order in which they were opened."""
    summaries = []
    for name, state in sessions.items():
        named, opened = parsed_name(name), state.opened
        summaries.append(
            SessionSummary(
                participant=named.participant,
                session=named.number,
                kind=named.kind or ("unknown" if opened is None else opened.kind),
                state=state.shown_name,
                slot=None if opened is None else opened.slot,
                answered=len(state.answered),
                planned=len(state.planned),
                excluded_trials=len(state.excluded),
                group=None if opened is None else opened.group,
            )
        )
    return summaries


@dataclass(frozen=True)
class Arrival:
    """A participant who comes to a session of a `kind`, the chain of the name `chain`.

    `sessions` are all of the study so far.
    """

    sessions: Mapping[str, SessionState]
    participant: str
    kind: str
    chain: str = ""

    @property
    def begun(self) -> Opening | None:
        """How the session was opened, None if it was not yet."""
        return self.sessions[self.chain].opened if self.chain in self.sessions else None

    def slot(self, group: str | None = None) -> int:
        """Return the slot among the sessions of the kind and of the `group`, if any.

        A session that has been opened keeps its own. Else a participant keeps the slot of an
        earlier session; a new participant takes the first slot that is neither in use nor finished.
        Rehearsals have slots of their own and use up none of a participant's.
        """
        if self.begun is not None and self.begun.slot is not None:
            return self.begun.slot
        alike, taken = (self.kind, group), dict[int, SlotState]()
        for state in self.sessions.values():
            opened = state.opened
            if opened is None or (opened.kind, opened.group) != alike or opened.slot is None:
                continue
            if opened.participant == self.participant and state.name not in _GONE:
                return opened.slot
            # Several people may have had one slot after another, if the earlier ones were excluded.
            taken[opened.slot] = _slot_state(state, taken.get(opened.slot, "free"))
        highest = max(taken, default=-1)
        return next_slot([taken.get(slot, "free") for slot in range(highest + 1)])

    @property
    def known_group(self) -> str | None:
        """The group that the participant has by this session or by an earlier one."""
        had = [state.opened for state in self._theirs().values()]
        known = [self.begun] if self.begun is not None else had
        return next((it.group for it in known if it and it.group is not None), None)

    def group(self, study: Study, asked: str | None = None, *, by: str = "--group") -> str | None:
        """Return the participant's group, None in a study without groups.

        A group that was given once stays. Else it is the one `asked` for, or by chance the next in
        the order of arrival whose slot is free. Rehearsals are drawn unless one is asked for. Raise
        `BadInput` for no such group, another one, or if somebody has to say which, `by` an option.
        """
        names, group, who = listed(study.groups) or "none", self.known_group, self.participant
        if asked is not None and asked not in study.groups:
            raise BadInput(f"{by} must be a group of the study ({names}), got {asked!r}")
        if not study.group or self.begun is not None:
            why = "began in"
        elif group:
            why = "belongs to"
        else:
            by_chance = study.design.assign_groups == "at random" and self.kind == "participant"
            if asked is not None and not by_chance:
                return asked
            if self.kind == "participant" and not by_chance:
                raise BadInput(f"{who} has no group yet: give one of {names} with {by}")
            somebody = Arrival(self.sessions, "", self.kind)
            free = {name: somebody.slot(name) for name in study.groups}
            group = next(name for name, slot in arrivals(study, self.kind) if slot == free[name])
            why = "is assigned at random to"
        if asked not in {None, group}:
            raise BadInput(f"{who} {why} the group {group}, got {by} {asked}; leave it out")
        return group

    def told(self, study: Study) -> dict[str, Any]:
        """Return the participant's answers to what is asked in the first session alone."""
        once = {question.name for question in study.question if question.sessions == "first"}
        others = [state for name, state in self._theirs().items() if name != self.chain]
        given = [answer for state in others for answer in state.questions.items()]
        return {name: answer for (name, block), answer in given if block is None and name in once}

    def next_due(self, study: Study) -> "Due | None":
        """Return when the next session is due; None at any time, or if none is left."""
        completed = [state for state in self._theirs().values() if state.name == "completed"]
        left = len(completed) < study.design.sessions
        return due_between(study, completed[-1]) if completed and left else None

    def _theirs(self) -> dict[str, SessionState]:
        """Return the participant's sessions of the kind, those apart that do not count any more."""
        who = (self.participant, self.kind)
        return {
            name: state
            for name, state in self.sessions.items()
            if state.name not in _GONE and state.opened is not None
            if (state.opened.participant, state.opened.kind) == who
        }


Due = tuple[datetime, datetime]
"""From when until when a session may begin."""
NEVER = datetime.max.replace(tzinfo=UTC)


def due_between(study: Study, before: SessionState) -> Due | None:
    """Return when the session after a completed one is due; None at any time."""
    if study.design.hours_between is None or before.completed_utc is None:
        return None
    least, most = study.design.hours_between
    ended = before.completed_utc
    # A date has no infinity: where no hours are the most, the last there is stands for it.
    last = NEVER if most == inf else ended + timedelta(hours=most)
    return ended + timedelta(hours=least), last


def due_in_words(due: Due) -> str:
    """Return when a session is due, in the computer's time zone."""
    first, *last = (f"{moment.astimezone():%A %d %B %H:%M}" for moment in due if moment < NEVER)
    return f"from {first} to {last[0]}" if last else f"from {first} on"


def cannot_go_on(study: Study, trials: Iterable[Trial], before: SessionState) -> str:
    """Return why a session cannot go on with `trials`, its plan under `study`; '' if it can."""
    opened = before.opened.trials if before.opened else ()
    # Answers are stored by number: under another plan they would belong to other trials.
    planned, begun = (
        [(trial.index, trial.kind, trial.condition, trial.track) for trial in each]
        for each in (trials, opened)
    )
    # So are the levels of tracks: on another grid the next level would not follow from them.
    levels = {track.name: dict(enumerate(track.values)) for track in study.track}
    moved = any(
        told.level is not None and levels.get(told.name, {}).get(told.level) != told.value
        for answers in before.tracks.values()
        for told in answers
    )
    if not moved and planned == begun:
        return ""
    what, stay = "levels" if moved else "trials", len(before.answered)
    return f"cannot go on, because the study has other {what} now; its answers ({stay}) stay"


def _slot_state(state: SessionState, before: SlotState) -> SlotState:
    """Return the state of a session's slot; a finished session settles it for good."""
    gone = state.name in _GONE
    # Of a session that is gone the order was used as planned, whatever is thought of its data.
    used = gone and 0 < len(state.planned) <= len(state.answered)
    if before == "done" or state.name == "completed" or used:
        return "done"
    return "dropped" if gone else "running"
