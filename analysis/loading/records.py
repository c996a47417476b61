"""What is known of a trial: session, plan, touches, answer, and what was decided later."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any


@dataclass(frozen=True, kw_only=True)
class TouchRecord:
    """One touch of a trial: as planned, as commanded, as read back and as judged."""

    planned: Mapping[str, Any]
    beam: str | None
    commanded: Mapping[str, Any]
    read_back: Sequence[Mapping[str, Any]] = ()
    judged: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class SessionRecord:
    """What holds for all trials of a session. `kind`: participant, rehearsal or published."""

    participant: str
    number: int
    kind: str
    opened: Mapping[str, Any]
    conditions: tuple[str, ...]
    completed: bool
    device: str | None = None
    operator_noted: Mapping[str, str] = field(default_factory=dict)
    exclusion: str | None = None


@dataclass(frozen=True, kw_only=True)
class TrialRecord:
    """One trial: its plan, its last attempt, and what was decided afterwards.

    `answer` is empty if the trial was begun and never answered. `exclusion` is why the trial, not
    its whole session, was taken out. `study_sha256` is the digest of the study that was in force.
    """

    session: SessionRecord
    planned: Mapping[str, Any]
    answer: Mapping[str, Any]
    attempts: int | None = None
    abort_reasons: tuple[str, ...] = ()
    touches: tuple[TouchRecord, ...] = ()
    started_utc: datetime | None = None
    answered_utc: datetime | None = None
    started_s: float | None = None
    answered_s: float | None = None
    resonance: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    exclusion: str | None = None
    study_sha256: str | None = None

    @property
    def excluded(self) -> str:
        """What took it out of the analysis: `no`, `trial` or `session`."""
        if self.session.exclusion is not None:
            return "session"
        return "no" if self.exclusion is None else "trial"


@dataclass(frozen=True, kw_only=True)
class Trials:
    """The trials to export, and how many sessions are not among them."""

    trials: tuple[TrialRecord, ...]
    rehearsals_left_out: int
    sessions_withdrawn: int
    sessions_without_trials: int

    @property
    def participants(self) -> tuple[str, ...]:
        """Whose trials these are, in order of appearance."""
        return tuple(dict.fromkeys(trial.session.participant for trial in self.trials))

    def summary(self) -> str:
        """Return in one line what is here and what is not."""
        excluded = sum(trial.excluded != "no" for trial in self.trials)
        return (
            f"{_counted(len(self.trials), 'trial')} of "
            f"{_counted(len(self.participants), 'participant')} "
            f"({_counted(excluded, 'trial')} excluded, marked); left out: "
            f"{_counted(self.rehearsals_left_out, 'rehearsal')}, "
            f"{_counted(self.sessions_withdrawn, 'withdrawn session')}"
        )

    def by_session(self) -> dict[tuple[str, int], tuple[TrialRecord, ...]]:
        """Return the trials by participant and number of the session, in order."""
        found: dict[tuple[str, int], tuple[TrialRecord, ...]] = {}
        for trial in self.trials:
            name = (trial.session.participant, trial.session.number)
            found[name] = (*found.get(name, ()), trial)
        return found


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
