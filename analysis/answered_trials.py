"""From the journal's events to trials: what was asked, what was done, and what was answered.

Knows the tags and payloads of docs/journal.md, and no code of a session.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from statistics import median
from typing import Any

from protocol.questions import Question
from protocol.study import Study
from protocol.study_file import StudyError, parsed_study
from protocol.touch import Touch

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
