"""The fold over a journal's events: tables of sessions, attempts, touches and traces."""

from array import array
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache, singledispatchmethod
from itertools import chain
from typing import Any

import numpy as np
import pandas as pd

from analysis.loading.records import (
    AttemptRow,
    Exclusion,
    Incident,
    SessionRow,
    Table,
    TouchRow,
)
from protocol.journal.events import (
    Answered,
    BeamMounted,
    DeviceArmed,
    DeviceOff,
    Event,
    NoteTaken,
    Paused,
    PracticeRenewed,
    ResonanceMeasured,
    RigDescribed,
    ScoresImported,
    SessionCompleted,
    SessionExcluded,
    SessionOpened,
    SessionResumed,
    StoredEvent,
    StudyAmended,
    TouchEnded,
    TouchStarted,
    TrialAborted,
    TrialExcluded,
    TrialStarted,
    Withdrawn,
)
from protocol.journal.records import LIFTED_N, PlannedTrial, TraceSample
from protocol.study.touch import Touch

TRIAL = ["session_id", "trial_index"]
"""The columns that identify a trial."""


def is_scored(trials: pd.DataFrame) -> "pd.Series[bool]":
    """Return which of `trials` count for Table 4."""
    return trials["trial_kind"].isin(["trial", "published"])


@dataclass(frozen=True, kw_only=True, eq=False)
class Sessions:
    """All sessions of a journal as tables; `analysis.loading.records` describes their columns.

    - `sessions`: a `SessionRow` per session, with the index `session_id`.
    - `attempts`: an `AttemptRow` per attempt at a trial and per score of a published table, session
      by session, in the order of their beginnings, with the index `attempt_id`.
    - `touches`: a `TouchRow` per touch, with the index `touch_id`.
    - `traces`: a row per sample of the finger: `touch_id`, `t_s` (the device's clock), `force_n`,
      `position_m`.
    - `incidents`, `exclusions`: in the order of the journal; exclusions are the operator's.
    - `withdrawn`: the number of withdrawn sessions, which are not in the tables.
    """

    sessions: pd.DataFrame
    attempts: pd.DataFrame
    touches: pd.DataFrame
    traces: pd.DataFrame
    incidents: tuple[Incident, ...]
    exclusions: tuple[Exclusion, ...]
    withdrawn: int

    @cached_property
    def trials(self) -> pd.DataFrame:
        """The trials that were begun, each with its last attempt, in the order of the plan.

        `attempts` and `aborted` count all attempts and the aborted ones (missing for a published
        score); `abort_reasons` and `notes` are those of all attempts, one per line. The index is
        that of the last attempt.
        """
        attempts = self.attempts.rename_axis("attempt_id").reset_index()
        begun = attempts.groupby(TRIAL)
        counted = begun["attempt"].max()
        last = attempts.drop_duplicates(TRIAL, keep="last").set_index(TRIAL).sort_index()
        return (
            last.drop(columns=["attempt", "abort_reason"])
            .assign(
                attempts=counted,
                aborted=begun["abort_reason"].count().where(counted.notna()).astype("Int64"),
                abort_reasons=_lines(attempts, "abort_reason"),
                notes=_lines(attempts, "notes"),
            )
            .reset_index()
            .set_index("attempt_id")
        )

    @cached_property
    def answered(self) -> pd.DataFrame:
        """The trials that were answered, each with its last answer, in the order of the answers.

        `place` counts the scored trials of a session from 1; `previous` is the condition of the
        trial directly before, if that was scored too. Both are missing for trials without a score
        and for published scores, whose order is unknown.
        """
        found = self.attempts[self.attempts["answered"]]
        scored = found["trial_kind"].eq("trial")
        session = found["session_id"]
        after_scored = scored & scored.groupby(session).shift(fill_value=False)
        return found.assign(
            place=scored.groupby(session).cumsum().astype("Int64").where(scored),
            previous=found.groupby("session_id")["condition"].shift().where(after_scored),
        ).drop_duplicates(TRIAL, keep="last")

    @cached_property
    def places_m(self) -> "pd.Series[float]":
        """The place of each touch, by `touch_id`: the finger's median position.

        It is missing for a sliding finger and on a rig without sensors.
        """
        held = self.touches["place"].ne("path")
        samples = self.traces[self.traces["force_n"].gt(LIFTED_N)]
        places_m = samples.groupby("touch_id")["position_m"].median()
        return places_m.reindex(self.touches.index).where(held)


def _lines(attempts: pd.DataFrame, column: str) -> "pd.Series[str]":
    """Join the texts of each trial's attempts, one per line."""
    return attempts.dropna(subset=[column]).groupby(TRIAL)[column].agg("\n".join)


def load_sessions(chains: Iterable[Sequence[StoredEvent]]) -> Sessions:
    """Return the sessions whose events `chains` yields, one session at a time.

    Events of a withdrawn session are not read, whether they are erased or not. The study's own
    chain is skipped.
    """
    rows = _Rows()
    withdrawn = 0
    for events in chains:
        if not events or events[0].tag == StudyAmended.TAG:
            continue
        if any(event.tag == Withdrawn.TAG for event in events):
            withdrawn += 1
            continue
        _Course(rows).read(events)
        rows.attempts.pack()
        rows.touches.pack()
    return Sessions(
        sessions=rows.sessions.frame(),
        attempts=rows.attempts.frame(),
        touches=rows.touches.frame(),
        traces=rows.traces(),
        incidents=tuple(rows.incidents),
        exclusions=tuple(rows.exclusions),
        withdrawn=withdrawn,
    )


@dataclass(kw_only=True)
class _Rows:
    """The rows of the sessions read so far; `samples` holds three numbers per sample of a trace."""

    sessions: Table[SessionRow] = field(default_factory=lambda: Table(SessionRow))
    attempts: Table[AttemptRow] = field(default_factory=lambda: Table(AttemptRow))
    touches: Table[TouchRow] = field(default_factory=lambda: Table(TouchRow))
    sampled: list[int] = field(default_factory=list)
    samples: "array[float]" = field(default_factory=lambda: array("d"))
    incidents: list[Incident] = field(default_factory=list)
    exclusions: list[Exclusion] = field(default_factory=list)
    study_texts: dict[str, str] = field(default_factory=dict)

    def traces(self) -> pd.DataFrame:
        """Return the samples, each with its touch."""
        values = np.frombuffer(self.samples).reshape(-1, 3)
        traces = pd.DataFrame(values, columns=list(TraceSample._fields))
        return traces.assign(touch_id=self.sampled)


class _Course:
    """The fold over one session."""

    def __init__(self, rows: _Rows) -> None:
        self._rows = rows
        self._planned: dict[int, PlannedTrial] = {}
        self._attempts: dict[int, list[AttemptRow]] = {}
        self._excluded: dict[int, str] = {}
        self._early_notes: list[str] = []
        self._beam: str | None = None
        self._resonance: ResonanceMeasured | None = None
        self._study_sha256: str | None = None
        self._study_text: str | None = None

    @property
    def _session(self) -> SessionRow:
        return self._rows.sessions.last

    @property
    def _attempt(self) -> AttemptRow:
        """The running attempt, or the last one."""
        return self._rows.attempts.last

    def read(self, events: Iterable[StoredEvent]) -> None:
        """Add all events of the session; those without a handler say nothing about trials."""
        take = self._take  # looking this method up takes longer than most of its work
        for stored in events:
            self._stored = stored
            take(stored.record)
        # A trial may be excluded before its last attempt.
        for index, why in self._excluded.items():
            self._exclude(why, index)
            for attempt in self._attempts.get(index, []):
                attempt.exclusion = why

    @singledispatchmethod
    def _take(self, _: Event) -> None:
        pass

    @_take.register
    def _scores_imported(self, event: ScoresImported) -> None:
        """Add a trial for each condition; its course is unknown."""
        self._rows.sessions.append(
            SessionRow(
                participant=event.participant,
                session=event.session,
                session_kind=event.kind,
                conditions=event.conditions,
                session_completed=True,
                imported_from=event.source and f"{event.source} (SHA-256 {event.source_sha256})",
            )
        )
        for index, condition in enumerate(event.conditions):
            self._rows.attempts.append(
                AttemptRow(
                    session_id=self._rows.sessions.last_id,
                    trial_index=index,
                    trial_kind=event.kind,
                    condition=condition,
                    answered=True,
                    score=event.scores.get(condition),
                )
            )

    @_take.register
    def _session_opened(self, event: SessionOpened) -> None:
        self._rows.sessions.append(
            SessionRow(
                participant=event.participant,
                session=event.session,
                session_kind=event.kind,
                conditions=event.conditions,
                language=event.language,
                slot=event.slot,
                seed=event.seed,
                study_sha256=event.study_sha256,
                versions=event.versions,
            )
        )
        self._under(event)

    @_take.register
    def _session_resumed(self, event: SessionResumed) -> None:
        self._under(event)
        self._incident("resumed")

    def _under(self, event: SessionOpened | SessionResumed) -> None:
        """Continue with the study and the plan with which the session was opened or resumed."""
        self._planned |= {trial.index: trial for trial in event.trials}
        self._study_sha256 = event.study_sha256 or self._study_sha256
        if event.study_text is not None:
            # One copy of the text, which most sessions share.
            self._study_text = self._rows.study_texts.setdefault(event.study_text, event.study_text)

    @_take.register
    def _practice_renewed(self, _: PracticeRenewed) -> None:
        self._incident("practised again")

    @_take.register
    def _device_armed(self, event: DeviceArmed) -> None:
        self._session.device = event.idn

    @_take.register
    def _rig_described(self, event: RigDescribed) -> None:
        self._session.operator_noted = {**self._session.operator_noted, **event.answers}
        self._incident("rig", "; ".join(f"{name}: {said}" for name, said in event.answers.items()))

    @_take.register
    def _beam_mounted(self, event: BeamMounted) -> None:
        self._beam = event.beam

    @_take.register
    def _resonance_measured(self, event: ResonanceMeasured) -> None:
        self._resonance = event

    @_take.register
    def _trial_started(self, event: TrialStarted) -> None:
        planned, resonance = self._planned[event.index], self._resonance
        attempts = self._attempts.setdefault(event.index, [])
        attempt = AttemptRow(
            session_id=self._rows.sessions.last_id,
            trial_index=event.index,
            attempt=len(attempts) + 1,
            block=planned.block,
            trial_kind=planned.kind,
            condition=planned.condition,
            level=planned.level,
            opposite=planned.opposite,
            question=planned.question,
            expected=planned.expected,
            notes="\n".join(self._early_notes) or None,
            started_utc=self._stored.utc,
            started_monotonic_s=self._stored.monotonic_s,
            resonance_hz=resonance.frequency_hz if resonance else None,
            resonance_tip_m_per_v=resonance.tip_m_per_v if resonance else None,
            study_sha256=self._study_sha256,
            study_text=self._study_text,
        )
        self._early_notes = []
        attempts.append(attempt)
        self._rows.attempts.append(attempt)

    @_take.register
    def _touch_started(self, event: TouchStarted) -> None:
        touches = self._planned[self._attempt.trial_index].touches
        planned = _touch(tuple(sorted(touches[event.touch].items())))
        self._rows.touches.append(
            TouchRow(
                attempt_id=self._rows.attempts.last_id,
                planned=planned,
                beam=self._beam,
                place=planned.place,
                direction=planned.direction,
                coverage=planned.coverage,
                press=planned.press,
                planned_voltage_v=planned.voltage_v,
                planned_end_voltage_v=planned.end_voltage_v,
                planned_frequency=planned.frequency,
                planned_end_frequency=planned.end_frequency,
                commanded_voltage_v=event.commanded.voltage_v,
                commanded_frequency_hz=event.commanded.frequency_hz,
            )
        )

    @_take.register
    def _touch_ended(self, event: TouchEnded) -> None:
        touch = self._rows.touches.last
        touch.force_n = event.judged.force_n
        touch.force_ok = event.judged.force_ok
        touch.place_ok = event.judged.place_ok
        if event.read_back:
            start, end = event.read_back[0], event.read_back[-1]
            touch.start_voltage_v, touch.end_voltage_v = start.voltage_v, end.voltage_v
            touch.start_frequency_hz, touch.end_frequency_hz = start.frequency_hz, end.frequency_hz
            touch.start_monitor_v, touch.end_monitor_v = start.monitor_v, end.monitor_v
        self._rows.sampled += [self._rows.touches.last_id] * len(event.trace)
        self._rows.samples.extend(chain.from_iterable(event.trace))

    @_take.register
    def _answered(self, event: Answered) -> None:
        attempt = self._attempt
        attempt.answered = True
        attempt.change, attempt.agrees, attempt.score = event.change, event.agrees, event.score
        times_s: Sequence[float | None] = (*event.reaction_time_s, None, None)
        attempt.reaction_time_s, attempt.score_reaction_time_s = times_s[:2]
        attempt.answered_utc = self._stored.utc
        began_s = attempt.started_monotonic_s
        if began_s is not None:
            attempt.duration_s = round(self._stored.monotonic_s - began_s, 6)

    @_take.register
    def _trial_aborted(self, event: TrialAborted) -> None:
        self._attempt.abort_reason = event.why
        self._incident("trial aborted", event.why, event.index)

    @_take.register
    def _paused(self, _: Paused) -> None:
        self._incident("paused")

    @_take.register
    def _note_taken(self, event: NoteTaken) -> None:
        """Add a note to the running or the last attempt, or else to the first one to come."""
        if self._attempts:
            told = self._attempt.notes
            self._attempt.notes = event.text if told is None else f"{told}\n{event.text}"
        else:
            self._early_notes.append(event.text)
        self._incident("note", event.text)

    @_take.register
    def _device_off(self, event: DeviceOff) -> None:
        if not event.confirmed:
            self._incident("device off, not confirmed", event.why)

    @_take.register
    def _session_completed(self, _: SessionCompleted) -> None:
        self._session.session_completed = True

    @_take.register
    def _trial_excluded(self, event: TrialExcluded) -> None:
        self._excluded[event.index] = event.reason

    @_take.register
    def _session_excluded(self, event: SessionExcluded) -> None:
        self._session.exclusion = event.reason
        self._exclude(event.reason)

    def _incident(self, what: str, text: str = "", trial: int | None = None) -> None:
        session = self._session
        self._rows.incidents.append(
            Incident(
                participant=session.participant,
                session=session.session,
                what=what,
                text=text,
                trial=trial,
            )
        )

    def _exclude(self, why: str, trial: int | None = None) -> None:
        session = self._session
        self._rows.exclusions.append(
            Exclusion(
                participant=session.participant,
                session=session.session,
                trial=trial,
                by="operator",
                why=why,
            )
        )


@lru_cache(maxsize=1024)
def _touch(planned: tuple[tuple[str, Any], ...]) -> Touch:
    """Return the planned touch; a study has few different ones, each of which is validated once."""
    return Touch.model_validate(dict(planned))
