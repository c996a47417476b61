"""From the journal's events to a record of every trial that was begun.

Knows tags and payloads, no code of a session. docs/journal.md lists the tags.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any, Protocol

from analysis.trial_records import SessionRecord, TouchRecord, TrialRecord, Trials
from protocol.errors import BadInput


class Recorded(Protocol):
    """An event of the journal: what happened, when, and what there is to say."""

    @property
    def tag(self) -> str:
        """What happened."""

    @property
    def utc(self) -> datetime:
        """Date and time."""

    @property
    def monotonic_s(self) -> float:
        """Seconds of a clock that never runs backwards."""

    @property
    def payload(self) -> Mapping[str, Any]:
        """What there is to say; empty once erased."""


class NothingToExport(BadInput):
    """A study without the trials that were asked for; the message says what to do."""


def trials(chains: Iterable[Sequence[Recorded]], *, rehearsals: bool) -> Trials:
    """Return every trial that was begun; those of rehearsals too if asked for.

    What a participant gave who has withdrawn is not looked at, erased or not. Excluded trials
    stay, marked. A published table has a trial for each of its scores.

    Raises:
        NothingToExport: there is no trial.
    """
    sessions = [chain for chain in chains if chain and chain[0].tag != "study-amended"]
    kept = [chain for chain in sessions if not any(event.tag == "withdrawn" for event in chain)]
    wanted = [chain for chain in kept if rehearsals or _kind(chain) != "rehearsal"]
    records = [_session_trials(chain) for chain in wanted]
    found = tuple(trial for session in records for trial in session)
    if not found:
        raise NothingToExport(
            "nothing but rehearsals here; name them with --rehearsals"
            if len(kept) > len(wanted)
            else "no trials here: nobody has begun one, or all have withdrawn"
        )
    return Trials(
        trials=found,
        rehearsals_left_out=len(kept) - len(wanted),
        sessions_withdrawn=len(sessions) - len(kept),
        sessions_without_trials=sum(not session for session in records),
    )


def _kind(chain: Sequence[Recorded]) -> str:
    return str(chain[0].payload.get("kind", "published"))


def _session_trials(chain: Sequence[Recorded]) -> tuple[TrialRecord, ...]:
    if chain[0].tag == "scores-imported":
        return _published_trials(chain)
    course = _Course(chain[0].payload)
    for event in chain[1:]:
        course.take(event)
    return course.records()


def _published_trials(chain: Sequence[Recorded]) -> tuple[TrialRecord, ...]:
    """A trial for each condition of an imported table; of how it was done nothing is known."""
    table = chain[0].payload
    session = SessionRecord(
        participant=table["participant"],
        number=table["session"],
        kind="published",
        opened=table,
        conditions=tuple(table["conditions"]),
        completed=True,
        exclusion=_last_reason(chain),
    )
    return tuple(
        TrialRecord(
            session=session,
            planned={"kind": "published", "condition": condition, "touches": ()},
            answer={"score": table["scores"].get(condition)},
        )
        for condition in session.conditions
    )


def _last_reason(chain: Sequence[Recorded]) -> str | None:
    reasons = [event.payload["reason"] for event in chain if event.tag == "session-excluded"]
    return reasons[-1] if reasons else None


@dataclass(kw_only=True)
class _Begun:
    """A trial on its way."""

    planned: Mapping[str, Any]
    attempts: int = 0
    abort_reasons: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    touches: list[TouchRecord] = field(default_factory=list)
    answer: Mapping[str, Any] = field(default_factory=dict)
    resonance: Mapping[str, float] = field(default_factory=dict)
    study_sha256: str | None = None
    started: Recorded | None = None
    answered: Recorded | None = None

    def start(self, event: Recorded, resonance: Mapping[str, float]) -> None:
        """Begin an attempt; what an earlier one left is forgotten, but not that there was one."""
        self.attempts += 1
        self.started, self.answered = event, None
        self.touches, self.answer, self.resonance = [], {}, resonance

    def record(self, session: SessionRecord, exclusion: str | None) -> TrialRecord:
        """Return what the trial has come to."""
        return TrialRecord(
            session=session,
            planned=self.planned,
            answer=self.answer,
            attempts=self.attempts,
            abort_reasons=tuple(self.abort_reasons),
            touches=tuple(self.touches),
            started_utc=self.started.utc if self.started else None,
            started_s=self.started.monotonic_s if self.started else None,
            answered_utc=self.answered.utc if self.answered else None,
            answered_s=self.answered.monotonic_s if self.answered else None,
            resonance=self.resonance,
            notes=tuple(self.notes),
            exclusion=exclusion,
            study_sha256=self.study_sha256,
        )


class _Course:
    """A session's course, event by event."""

    def __init__(self, opened: Mapping[str, Any]) -> None:
        self._opened = opened
        self._planned = {trial["index"]: trial for trial in opened["trials"]}
        self._study_sha256: str | None = opened.get("study_sha256")
        self._begun: dict[int, _Begun] = {}
        self._now = _Begun(planned={})
        self._excluded: dict[int, str] = {}
        self._session_exclusion: str | None = None
        self._completed = False
        self._device: str | None = None
        self._beam: str | None = None
        self._noted: dict[str, str] = {}
        self._resonance: Mapping[str, float] = {}

    def take(self, event: Recorded) -> None:
        """Take one more event in; tags that say nothing about trials are passed over."""
        if event.tag in _TAKEN:
            _TAKEN[event.tag](self, event)

    def records(self) -> tuple[TrialRecord, ...]:
        """Return the trials that were begun, in the order of the plan."""
        opened = self._opened
        session = SessionRecord(
            participant=opened["participant"],
            number=opened["session"],
            kind=opened["kind"],
            opened=opened,
            conditions=tuple(opened["conditions"]),
            completed=self._completed,
            device=self._device,
            operator_noted=self._noted,
            exclusion=self._session_exclusion,
        )
        return tuple(
            begun.record(session, self._excluded.get(index))
            for index, begun in sorted(self._begun.items())
        )

    def _session_resumed(self, event: Recorded) -> None:
        """The study may have been amended meanwhile, and what is to be touched with it."""
        self._study_sha256 = event.payload.get("study_sha256", self._study_sha256)
        self._planned |= {trial["index"]: trial for trial in event.payload.get("trials", ())}

    def _device_armed(self, event: Recorded) -> None:
        self._device = event.payload.get("idn")

    def _rig_described(self, event: Recorded) -> None:
        self._noted |= event.payload.get("answers", {})

    def _beam_mounted(self, event: Recorded) -> None:
        self._beam = event.payload["beam"]

    def _resonance_measured(self, event: Recorded) -> None:
        self._resonance = event.payload

    def _trial_started(self, event: Recorded) -> None:
        index = event.payload["index"]
        before_any = self._now.notes if not self._begun else []
        self._now = self._begun.setdefault(index, _Begun(planned=self._planned[index]))
        self._now.planned, self._now.study_sha256 = self._planned[index], self._study_sha256
        self._now.notes.extend(before_any)
        self._now.start(event, self._resonance)

    def _touch_started(self, event: Recorded) -> None:
        self._now.touches.append(
            TouchRecord(
                planned=self._now.planned["touches"][event.payload["touch"]],
                beam=self._beam,
                commanded=event.payload["commanded"],
            )
        )

    def _touch_ended(self, event: Recorded) -> None:
        read_back, judged = event.payload["read_back"], event.payload["judged"]
        self._now.touches[-1] = replace(self._now.touches[-1], read_back=read_back, judged=judged)

    def _answered(self, event: Recorded) -> None:
        self._now.answer, self._now.answered = event.payload, event

    def _trial_aborted(self, event: Recorded) -> None:
        self._now.abort_reasons.append(event.payload["why"])

    def _note(self, event: Recorded) -> None:
        """A note belongs to the trial that runs or was last begun, else to the first one."""
        self._now.notes.append(event.payload["text"])

    def _trial_excluded(self, event: Recorded) -> None:
        self._excluded[event.payload["index"]] = event.payload["reason"]

    def _session_excluded(self, event: Recorded) -> None:
        self._session_exclusion = event.payload["reason"]

    def _session_completed(self, _: Recorded) -> None:
        self._completed = True


_TAKEN: Mapping[str, Callable[[_Course, Recorded], None]] = {
    "session-resumed": _Course._session_resumed,
    "device-armed": _Course._device_armed,
    "rig-described": _Course._rig_described,
    "beam-mounted": _Course._beam_mounted,
    "resonance-measured": _Course._resonance_measured,
    "trial-started": _Course._trial_started,
    "touch-started": _Course._touch_started,
    "touch-ended": _Course._touch_ended,
    "answered": _Course._answered,
    "trial-aborted": _Course._trial_aborted,
    "note": _Course._note,
    "trial-excluded": _Course._trial_excluded,
    "session-excluded": _Course._session_excluded,
    "session-completed": _Course._session_completed,
}
