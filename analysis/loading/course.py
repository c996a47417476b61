"""The fold over the events of a session, which adds its rows to the tables."""

from array import array
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import lru_cache
from itertools import chain
from typing import Any

import numpy as np
import pandas as pd

from analysis.estimates import NotEstimable
from analysis.friction.recorded import TouchForces, reduced
from analysis.loading import records
from analysis.loading.records import (
    AnswerRow,
    AttemptRow,
    SessionRow,
    Table,
    TouchRow,
)
from analysis.loading.study_lock import rig_in_force
from device.friction.calibration import Calibration
from protocol.journal import events as journal
from protocol.journal.records import (
    ImportedRating,
    PlannedTrial,
    QuestionAnswer,
    TraceSample,
    TrackAnswer,
)
from protocol.study.study_question import IMPORTED_QUESTION
from protocol.study.touch import Touch
from protocol.study.track import Track, TrackTouch
from protocol.study_file.loading import StudyError, parsed_study
from protocol.tracks.procedure import TrackPlace, moved, start

_SESSION_COLUMNS = frozenset(entry.name for entry in fields(SessionRow))


@dataclass(kw_only=True)
class Rows:
    """The rows of the sessions read so far.

    `samples` holds three numbers per sample of a trace, and `forces` what is kept of the recording
    of each touch that has one.
    """

    sessions: Table[SessionRow] = field(default_factory=lambda: Table(SessionRow))
    attempts: Table[AttemptRow] = field(default_factory=lambda: Table(AttemptRow))
    touches: Table[TouchRow] = field(default_factory=lambda: Table(TouchRow))
    answers: Table[AnswerRow] = field(default_factory=lambda: Table(AnswerRow))
    sampled: list[int] = field(default_factory=list)
    # Bare numbers, because an object per sample would take several times the memory.
    samples: "array[float]" = field(default_factory=lambda: array("d"))
    forces: dict[int, TouchForces | NotEstimable] = field(default_factory=dict)
    incidents: list[records.Incident] = field(default_factory=list)
    exclusions: list[records.Exclusion] = field(default_factory=list)
    study_texts: dict[str, str] = field(default_factory=dict)

    def traces(self) -> pd.DataFrame:
        values = np.frombuffer(self.samples).reshape(-1, 3)
        traces = pd.DataFrame(values, columns=list(TraceSample._fields))
        return traces.assign(touch_id=self.sampled)


class Course:
    """The fold over one session."""

    def __init__(self, rows: Rows) -> None:
        self._rows = rows
        self._planned: dict[int, PlannedTrial] = {}
        self._of_conditions: set[int] = set()
        self._attempts: dict[int, list[AttemptRow]] = {}
        self._excluded: dict[int, str] = {}
        self._included: dict[int, str] = {}
        self._at_desk: dict[str, AnswerRow] = {}
        self._early_notes: list[str] = []
        self._beam: str | None = None
        self._resonance: journal.ResonanceMeasured | None = None
        self._study_sha256: str | None = None
        self._study_text: str | None = None
        self._rig: Calibration | None = None
        self._places: dict[str, tuple[Track, TrackPlace] | None] = {}

    @property
    def _session(self) -> SessionRow:
        return self._rows.sessions.last

    @property
    def _attempt(self) -> AttemptRow:
        """The running attempt, or the last one."""
        return self._rows.attempts.last

    def read(self, events: Iterable[journal.StoredEvent]) -> None:
        """Add all events of the session; those without a handler say nothing about trials."""
        for stored in events:
            if (take := _HANDLERS.get(stored.tag)) is not None:
                self._stored = stored
                take(self, stored.record)
        self._session.planned_trials = len(self._of_conditions - self._excluded.keys())
        # Only now, because the operator may have taken an exclusion back in a later event.
        if self._session.exclusion is not None:
            self._exclude(self._session.exclusion)
        # A trial may be excluded before its last attempt.
        for index, why in self._excluded.items():
            self._exclude(why, index)
            for attempt in self._attempts.get(index, []):
                attempt.exclusion = why
        for index, why in self._included.items():
            for attempt in self._attempts.get(index, []):
                attempt.inclusion = why

    def _scores_imported(self, event: journal.ScoresImported) -> None:
        """Add a trial for each condition; its course is unknown."""
        self._rows.sessions.append(
            SessionRow(
                session_kind=event.kind,
                session_completed=True,
                imported_from=event.source and f"{event.source} (SHA-256 {event.source_sha256})",
                **_named_alike(event),
            )
        )
        ratings = event.ratings
        if ratings is None:
            ratings = tuple(
                ImportedRating(condition=name, score=event.scores.get(name))
                for name in event.conditions
            )
        for index, rating in enumerate(ratings):
            self._of_conditions.add(index)
            self._rows.attempts.append(
                AttemptRow(
                    session_id=self._rows.sessions.last_id,
                    trial_index=index,
                    trial_kind=event.kind,
                    condition=rating.condition,
                    answered=True,
                    score=rating.score,
                    contrast=rating.contrast,
                    **_imported_answer(rating.answer),
                )
            )

    def _session_opened(self, event: journal.SessionOpened) -> None:
        self._rows.sessions.append(SessionRow(session_kind=event.kind, **_named_alike(event)))
        self._under(event)

    def _session_resumed(self, event: journal.SessionResumed) -> None:
        told = self._session.versions = dict(self._session.versions)
        for name, now in event.versions.items():  # none by which a part was recorded goes untold
            if str(told.setdefault(name, now)).rpartition(records.CHANGED)[2] != now:
                told[name] = f"{told[name]}{records.CHANGED}{now}"
        self._under(event)
        self._incident("resumed")

    def _under(self, event: journal.SessionTerms) -> None:
        """Continue with the study and the plan with which the session was opened or resumed."""
        # A resumption need not repeat what the session was opened with.
        self._session.virtual = event.virtual or self._session.virtual
        self._rig = self._session.calibration = rig_in_force(event)
        self._planned |= {trial.index: trial for trial in event.trials}
        self._of_conditions |= {trial.index for trial in event.trials if trial.kind == "trial"}
        self._study_sha256 = event.study_sha256 or self._study_sha256
        if event.study_text is not None:
            # One copy of the text, which most sessions share.
            self._study_text = self._rows.study_texts.setdefault(event.study_text, event.study_text)

    def _practice_renewed(self, event: journal.PracticeRenewed) -> None:
        for index in event.indices:  # as in the session's own state, the answers count no longer
            for attempt in self._attempts.get(index, []):
                attempt.answered = False
        self._incident("practised again")

    def _device_armed(self, event: journal.DeviceArmed) -> None:
        self._session.device = event.idn

    def _rig_described(self, event: journal.RigDescribed) -> None:
        self._session.operator_noted = {**self._session.operator_noted, **event.answers}
        self._incident("rig", "; ".join(f"{name}: {said}" for name, said in event.answers.items()))

    def _beam_mounted(self, event: journal.BeamMounted) -> None:
        self._beam = event.beam

    def _resonance_measured(self, event: journal.ResonanceMeasured) -> None:
        self._resonance = event

    def _trial_started(self, event: journal.TrialStarted) -> None:
        planned, resonance = self._planned[event.index], self._resonance
        attempts = self._attempts.setdefault(event.index, [])
        attempt = AttemptRow.begun(
            planned,
            session_id=self._rows.sessions.last_id,
            attempt=len(attempts) + 1,
            notes="\n".join(self._early_notes) or None,
            started_utc=self._stored.utc,
            started_monotonic_s=self._stored.monotonic_s,
            resonance_hz=resonance.frequency_hz if resonance else None,
            resonance_tip_m_per_v=resonance.tip_m_per_v if resonance else None,
            study_sha256=self._study_sha256,
            study_text=self._study_text,
            lowest_score=_lowest_score(self._study_text),
            rig=self._rig,
        )
        self._early_notes = []
        attempts.append(attempt)
        self._rows.attempts.append(attempt)

    def _touch_started(self, event: journal.TouchStarted) -> None:
        touches = self._planned[self._attempt.trial_index].touches
        self._rows.touches.append(
            TouchRow(
                planned=_planned_touch(touches[event.touch]),
                attempt_id=self._rows.attempts.last_id,
                beam=self._beam,
                commanded_voltage_v=event.commanded.voltage_v,
                commanded_frequency_hz=event.commanded.frequency_hz,
            )
        )

    def _touch_recorded(self, event: journal.TouchRecorded) -> None:
        self._rows.forces[self._rows.touches.last_id] = reduced(event)

    def _touch_ended(self, event: journal.TouchEnded) -> None:
        touch = self._rows.touches.last
        touch.force_n = event.judged.force_n
        touch.force_ok = event.judged.force_ok
        touch.place_ok = event.judged.place_ok
        touch.speed_ok = event.judged.speed_ok
        if event.read_back:
            start, end = event.read_back[0], event.read_back[-1]
            # A generator keeps its amplitude while its output is off.
            touch.start_voltage_v, touch.end_voltage_v = (
                read_back.voltage_v * read_back.output for read_back in (start, end)
            )
            touch.start_frequency_hz, touch.end_frequency_hz = start.frequency_hz, end.frequency_hz
            touch.start_monitor_v, touch.end_monitor_v = start.monitor_v, end.monitor_v
        self._rows.sampled += [self._rows.touches.last_id] * len(event.trace)
        self._rows.samples.extend(chain.from_iterable(event.trace))

    def _answered(self, event: journal.Answered) -> None:
        attempt = self._attempt
        attempt.answered = True
        attempt.change, attempt.agrees, attempt.score = event.change, event.agrees, event.score
        # The second time is there only if a score was asked for.
        times_s: Sequence[float | None] = (*event.reaction_time_s, None, None)
        attempt.reaction_time_s, attempt.score_reaction_time_s = times_s[:2]
        if event.change is None and event.score is not None:  # the score was the only answer
            attempt.score_reaction_time_s = times_s[0]
        attempt.answered_utc = self._stored.utc
        if (told := event.track) is not None:
            attempt.level, attempt.level_value = told.level, told.value
            attempt.correct, attempt.reversal = told.correct, self._turned(told)
        if (began_s := attempt.started_monotonic_s) is not None:
            # The difference of two times has digits that no clock gave.
            attempt.duration_s = round(self._stored.monotonic_s - began_s, 6)
        for given in event.questions:
            self._add_answer(given, "trial", attempt_id=self._rows.attempts.last_id)

    def _turned(self, told: TrackAnswer) -> bool | None:
        """Return whether the rule of a track turned at an answer; None where no rule turns."""
        if told.role != "level" or told.level is None or told.correct is None:
            return None
        if told.name not in self._places:
            track = _track(self._study_text, told.name)
            self._places[told.name] = (track, start(track)) if track and track.turns else None
        if (known := self._places[told.name]) is None:
            return None
        track, before = known
        after = moved(track, before._replace(level=told.level), told.correct)
        self._places[told.name] = track, after
        return len(after.turned_at) > len(before.turned_at)

    def _question_answered(self, event: journal.QuestionAnswered) -> None:
        for name in event.moot or ():
            if (moot := self._at_desk.pop(name, None)) is not None:
                self._rows.answers.remove(moot)
        row = self._at_desk.get(event.name) if event.when == "desk" else None
        if row is not None:  # the operator corrects it
            row.answer, row.reaction_time_s = _plain(event.answer), event.reaction_time_s
        else:
            row = self._add_answer(event, event.when, block=event.block)
        if event.when == "desk":
            self._at_desk[event.name] = row

    def _add_answer(self, given: QuestionAnswer, when: str, **known: int | None) -> AnswerRow:
        row = AnswerRow(
            session_id=self._rows.sessions.last_id,
            name=given.name,
            when=when,
            answer=_plain(given.answer),
            reaction_time_s=given.reaction_time_s,
            **known,
        )
        self._rows.answers.append(row)
        return row

    def _trial_aborted(self, event: journal.TrialAborted) -> None:
        self._attempt.abort_reason = event.why
        self._incident("trial aborted", event.why, event.index)

    def _trial_deferred(self, event: journal.TrialDeferred) -> None:
        why = f"not as instructed: {', '.join(event.missed)}"
        self._attempt.abort_reason = why
        self._incident("trial repeated", why, event.index)

    def _paused(self, _: journal.Paused) -> None:
        self._incident("paused")

    def _note(self, event: journal.NoteTaken) -> None:
        """Add a note to the running or the last attempt, or else to the first one to come."""
        if self._attempts:
            told = self._attempt.notes
            self._attempt.notes = event.text if told is None else f"{told}\n{event.text}"
        else:
            self._early_notes.append(event.text)
        self._incident("note", event.text)

    def _window_changed(self, event: journal.WindowChanged) -> None:
        # Where keys go changes with each note of the operator; a page that nobody saw is worth one.
        if not event.is_shown:
            self._incident("window minimised")

    def _device_off(self, event: journal.DeviceOff) -> None:
        # To switch off is the normal end; only a voltage that may still be there is worth a note.
        if not event.confirmed:
            self._incident("device off, not confirmed", event.why)

    def _session_completed(self, _: journal.SessionCompleted) -> None:
        self._session.session_completed = True

    def _trial_excluded(self, event: journal.TrialExcluded) -> None:
        self._excluded[event.index] = event.reason
        self._included.pop(event.index, None)

    def _trial_included(self, event: journal.TrialIncluded) -> None:
        excluded = self._excluded.pop(event.index)
        self._included[event.index] = event.reason
        self._included_again(excluded, event.reason, event.index)

    def _session_excluded(self, event: journal.SessionExcluded) -> None:
        self._session.exclusion, self._session.inclusion = event.reason, None

    def _session_included(self, event: journal.SessionIncluded) -> None:
        self._included_again(self._session.exclusion or "", event.reason)
        self._session.exclusion, self._session.inclusion = None, event.reason

    def _included_again(self, excluded: str, included: str, trial: int | None = None) -> None:
        # Both decisions are listed, so that taking one back leaves a trace.
        self._incident("excluded", excluded, trial)
        self._incident("included again", included, trial)

    @property
    def _whose(self) -> dict[str, Any]:
        """Participant and session; `load_sessions` takes needless marks of rehearsals off."""
        row = self._session
        mark = records.REHEARSED if row.session_kind == "rehearsal" else ""
        return {"participant": f"{row.participant}{mark}", "session": row.session}

    def _incident(self, what: str, text: str = "", trial: int | None = None) -> None:
        entry = records.Incident(**self._whose, what=what, text=text, trial=trial)
        self._rows.incidents.append(entry)

    def _exclude(self, why: str, trial: int | None = None) -> None:
        entry = records.Exclusion(**self._whose, trial=trial, by="operator", why=why)
        self._rows.exclusions.append(entry)


_HANDLERS = {
    tag: handler
    for tag in journal.TAGS
    if (handler := vars(Course).get(f"_{tag.replace('-', '_')}")) is not None
}
"""The methods that take events: each has the name of its event's tag."""


def _plain(answer: Any) -> Any:
    return tuple(answer) if isinstance(answer, list) else answer


def _named_alike(event: journal.ScoresImported | journal.SessionOpened) -> dict[str, Any]:
    """Return what the event and the row of its session have under the same name."""
    return {name: value for name, value in vars(event).items() if name in _SESSION_COLUMNS}


def _imported_answer(answer: str | None) -> dict[str, Any]:
    """Return what is known of a trial whose change was answered in words of an imported table."""
    if answer is None:
        return {}
    asked = {"question": IMPORTED_QUESTION, "expected": "expected", "change": answer}
    return {**asked, "agrees": answer == "expected"}


# Most sessions share their study.
@lru_cache(maxsize=64)
def _lowest_score(study_text: str | None) -> float | None:
    try:
        return None if study_text is None else float(parsed_study(study_text).rating.minimum)
    # A file from another version must not stop a report, which then takes the present scale.
    except StudyError:
        return None


@lru_cache(maxsize=64)
def _track(study_text: str | None, name: str) -> Track | None:
    """Return a track of the study in force; None where this version cannot read that file."""
    try:
        return None if study_text is None else parsed_study(study_text).track_of(name)
    except (StudyError, LookupError):
        return None


def _planned_touch(planned: Mapping[str, Any]) -> Touch:
    """Return the touch that is planned as the journal has it."""
    return _touch(tuple(planned.items()))


@lru_cache(maxsize=1024)
def _touch(planned: tuple[tuple[str, Any], ...]) -> Touch:
    """Return the planned touch; a study has few different ones, each of which is validated once."""
    # Those of tracks may have a place of their own.
    return (TrackTouch if "place_m" in dict(planned) else Touch).model_validate(dict(planned))
