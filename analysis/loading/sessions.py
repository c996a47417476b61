"""From the journal's events to trials: what was asked, what was done, and what was answered.

Knows the tags and payloads of docs/journal.md, and no code of a session.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import lru_cache
from statistics import median
from typing import Any, Protocol

from analysis.loading.records import SessionRecord, TouchRecord, TrialRecord, Trials
from protocol.errors import BadInput
from protocol.study.questions import Question
from protocol.study.study import Study
from protocol.study.touch import Touch
from protocol.study_file.loading import StudyError, parsed_study

Happened = tuple[str, Mapping[str, Any]]
"""An event as far as the analysis is concerned: its tag and its payload."""

LIFTED_N = 0.02
"""Below this force the beam is not touched."""


@dataclass(frozen=True, kw_only=True)
class Drive:
    """What the device reported of itself: amplitude and frequency, relative to the resonance."""

    voltage_v: float
    frequency: float


@dataclass(frozen=True, kw_only=True)
class TouchDone:
    """A touch as planned, and as measured where the rig has sensors; None where it has not."""

    planned: Touch
    force_n: float | None = None
    place_m: float | None = None
    start: Drive | None = None
    end: Drive | None = None


@dataclass(frozen=True, kw_only=True)
class TrialRow:
    """One answered trial.

    `place` counts a session's scored trials from 1 in the order in which they were answered, and
    `previous` is the condition of the scored trial right before; both are None where the order is
    not known or the trial is not scored. `score` is NaN where none was given. `study` is the one in
    force, which may have been amended since; None where the journal does not hold it.
    """

    participant: str
    session: int
    index: int
    kind: str
    condition: str | None
    score: float
    question: Question | None = None
    expected: str | None = None
    change: str | None = None
    agrees: bool | None = None
    level: float = 1.0
    opposite: bool = False
    reaction_s: float | None = None
    place: int | None = None
    previous: str | None = None
    touches: tuple[TouchDone, ...] = ()
    study: Study | None = field(default=None, repr=False, compare=False)

    @property
    def is_scored(self) -> bool:
        """Whether the trial counts for Table 4."""
        return self.kind in {"trial", "published"}


def published_rows(payload: Mapping[str, Any]) -> list[TrialRow]:
    """Return a row per condition of a published subject; nothing is known of their order."""
    scores = payload["scores"]
    return [
        TrialRow(
            participant=payload["participant"],
            session=payload.get("session", 1),
            index=index,
            kind="published",
            condition=name,
            score=_number(scores.get(name)),
        )
        for index, name in enumerate(payload["conditions"])
    ]


def answered_trials(events: Sequence[Happened]) -> list[TrialRow]:
    """Return a session's answered trials in the order of their answers.

    A trial that was answered again - practice, after an interruption - counts as answered last.
    """
    tag, opened = events[0]
    if tag == "scores-imported":
        return published_rows(opened)
    reading = _Reading(opened=opened)
    for tag, payload in events[1:]:
        reading.take(tag, payload)
    return list(reading.rows.values())


@dataclass(kw_only=True)
class _Reading:
    """What has been read of a session so far."""

    opened: Mapping[str, Any]
    rows: dict[int, TrialRow] = field(default_factory=dict)
    _planned: dict[int, Mapping[str, Any]] = field(init=False)
    _study: Study | None = field(init=False)
    _resonance_hz: float | None = None
    _touches: list[Mapping[str, Any]] = field(default_factory=list)
    _places: int = 0
    _last: TrialRow | None = None

    def __post_init__(self) -> None:
        self._planned = {}
        self._study = None
        self._under(self.opened)

    def take(self, tag: str, payload: Mapping[str, Any]) -> None:
        match tag:
            case "session-resumed":
                self._under(payload)
            case "resonance-measured":
                self._resonance_hz = payload["frequency_hz"]
            case "trial-started":
                self._touches = []
            case "touch-ended":
                self._touches.append(payload)
            case "answered":
                self._answered(payload)

    def _under(self, begun: Mapping[str, Any]) -> None:
        """Go on under the study and the plan that the session was opened or resumed with."""
        self._planned |= {trial["index"]: trial for trial in begun.get("trials", ())}
        self._study = _study(begun.get("study_text")) or self._study

    def _answered(self, answer: Mapping[str, Any]) -> None:
        planned = self._planned.get(answer["index"], {})
        scored = answer["kind"] == "trial"
        self._places += scored
        reactions = answer.get("reaction_time_s") or [None]
        row = TrialRow(
            participant=self.opened["participant"],
            session=self.opened.get("session", 1),
            index=answer["index"],
            kind=answer["kind"],
            condition=answer["condition"],
            score=_number(answer["score"]),
            question=planned.get("question"),
            expected=planned.get("expected"),
            change=answer.get("change"),
            agrees=answer.get("agrees"),
            level=answer.get("level", 1.0),
            opposite=answer.get("opposite", False),
            reaction_s=reactions[0],
            place=self._places if scored else None,
            previous=self._previous(scored=scored),
            touches=self._done(planned),
            study=self._study,
        )
        self.rows.pop(row.index, None)
        self.rows[row.index] = self._last = row

    def _previous(self, *, scored: bool) -> str | None:
        last = self._last
        return last.condition if scored and last is not None and last.is_scored else None

    def _done(self, planned: Mapping[str, Any]) -> tuple[TouchDone, ...]:
        touches = planned.get("touches", ())
        measured = self._touches if len(self._touches) == len(touches) else [{}] * len(touches)
        return tuple(
            _touch_done(_touch(touch), made, self._resonance_hz)
            for touch, made in zip(touches, measured, strict=True)
        )


@lru_cache(maxsize=16)
def _study(text: str | None) -> Study | None:
    """The study of a file's text; None where there is none, or another touchbeam read it."""
    try:
        return None if text is None else parsed_study(text)
    except StudyError:
        return None


_KNOWN_TOUCHES: dict[tuple[tuple[str, Any], ...], Touch] = {}


def _touch(record: Mapping[str, Any]) -> Touch:
    """The planned touch; a study has few different ones, so that each is validated once."""
    key = tuple(sorted(record.items()))
    if key not in _KNOWN_TOUCHES:
        _KNOWN_TOUCHES[key] = Touch.model_validate(record)
    return _KNOWN_TOUCHES[key]


def _touch_done(planned: Touch, made: Mapping[str, Any], resonance_hz: float | None) -> TouchDone:
    force_n = (made.get("judged") or {}).get("force_n")
    read_back = made.get("read_back") or []
    return TouchDone(
        planned=planned,
        force_n=force_n or None,
        place_m=_place_m(planned, made.get("trace") or []),
        start=_drive(read_back[0], resonance_hz) if read_back else None,
        end=_drive(read_back[-1], resonance_hz) if read_back else None,
    )


def _place_m(planned: Touch, trace: Sequence[Sequence[float]]) -> float | None:
    """Where a place was touched; a finger that slides has no one place."""
    places_m = [place_m for _, force_n, place_m in trace if force_n > LIFTED_N]
    if planned.place == "path" or not places_m:
        return None
    return median(places_m)


def _drive(read_back: Mapping[str, Any], resonance_hz: float | None) -> Drive | None:
    """The drive that was read back; None where no resonance was measured to compare it with."""
    if resonance_hz is None:
        return None
    return Drive(
        voltage_v=round(read_back["voltage_v"], 3),
        frequency=round(read_back["frequency_hz"] / resonance_hz, 6),
    )


def _number(score: float | None) -> float:
    return math.nan if score is None else float(score)


@dataclass(frozen=True, kw_only=True)
class Incident:
    """Something that interrupted a session or that the operator noted."""

    participant: str
    session: int
    what: str
    text: str = ""
    trial: int | None = None


@dataclass(frozen=True, kw_only=True)
class SessionStory:
    """What is known of one session that was neither excluded nor withdrawn.

    `excluded_trials` maps the index of a trial to the reason for taking it out.
    """

    participant: str
    number: int
    kind: str
    conditions: tuple[str, ...]
    rows: tuple[TrialRow, ...]
    finished: bool
    excluded_trials: Mapping[int, str]
    incidents: tuple[Incident, ...]
    opened: Mapping[str, Any]

    @property
    def kept(self) -> tuple[TrialRow, ...]:
        """The trials that were not excluded."""
        return tuple(row for row in self.rows if row.index not in self.excluded_trials)


def session_story(events: Sequence[Happened]) -> SessionStory:
    """Return what the events of one session say; the first one opens or imports it."""
    tag, opened = events[0]
    published = tag == "scores-imported"
    return SessionStory(
        participant=opened["participant"],
        number=opened.get("session", 1),
        kind="published" if published else opened["kind"],
        conditions=tuple(opened["conditions"]),
        rows=tuple(answered_trials(events)),
        finished=published or any(tag == "session-completed" for tag, _ in events),
        excluded_trials={
            payload["index"]: payload.get("reason", "")
            for tag, payload in events
            if tag == "trial-excluded"
        },
        incidents=tuple(_incidents(opened, events)),
        # The plan and the study are long and have been read.
        opened={
            name: value for name, value in opened.items() if name not in {"trials", "study_text"}
        },
    )


def _incidents(opened: Mapping[str, Any], events: Sequence[Happened]) -> list[Incident]:
    found = []
    for tag, payload in events:
        said = _in_words(tag, payload)
        if said is not None:
            found.append(
                Incident(
                    participant=opened["participant"],
                    session=opened.get("session", 1),
                    what=said[0],
                    text=said[1],
                    trial=payload.get("index"),
                )
            )
    return found


def _in_words(tag: str, payload: Mapping[str, Any]) -> tuple[str, str] | None:
    """What a reader of the report is told of an event, None for what is no incident."""
    if tag == "device-off" and payload.get("confirmed") is not False:
        return None
    if tag == "rig-described":
        answers = payload.get("answers", {})
        return "rig", "; ".join(f"{name}: {said}" for name, said in answers.items())
    what = _INCIDENTS.get(tag)
    if what is None:
        return None
    return what, str(payload.get("text") or payload.get("why") or "")


_INCIDENTS = {
    "session-resumed": "resumed",
    "practice-renewed": "practised again",
    "paused": "paused",
    "trial-aborted": "trial aborted",
    "note": "note",
    "device-off": "device off, not confirmed",
}


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
