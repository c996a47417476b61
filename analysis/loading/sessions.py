"""The sessions of a journal as tables: sessions, attempts, touches and traces."""

import gc
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar

import pandas as pd

from analysis.estimates import NotEstimable
from analysis.friction.recorded import TouchForces
from analysis.loading.course import Course, Rows
from analysis.loading.records import REHEARSED, Exclusion, Incident, with_plans
from analysis.loading.study_lock import Decisions
from protocol.errors import IMPOSSIBLE
from protocol.journal import events as journal
from protocol.journal.records import LIFTED_N
from protocol.journal.state import NotAllowed, damage

_Told = TypeVar("_Told", Incident, Exclusion)

TRIAL = ["session_id", "trial_index"]
"""The columns that identify a trial."""
SCORED_KINDS = frozenset({"trial", "published"})
"""The kinds of trial that count for the table of scores."""


def is_scored(trials: pd.DataFrame) -> "pd.Series[bool]":
    """Return which of `trials` count for the table of scores."""
    return trials["trial_kind"].isin(SCORED_KINDS)


@dataclass(frozen=True, kw_only=True, eq=False)
class Sessions:
    """All sessions of a journal as tables; `analysis.loading.records` describes their columns.

    - `sessions`: a `SessionRow` per session, with the index `session_id`, and `subject`: what
      tells the participant from a rehearsal of the same name.
    - `attempts`: an `AttemptRow` per attempt at a trial and per score of a published table, session
      by session, in the order of their beginnings, with the index `attempt_id`.
    - `touches`: a `TouchRow` per touch and its plan, with the index `touch_id`.
    - `answers`: an `AnswerRow` per answer to a question of the study's own.
    - `traces`: a row per sample of the finger: `touch_id`, `t_s` (the device's clock), `force_n`,
      `position_m`.
    - `forces`: by `touch_id`, what is kept of the recordings, or why one says nothing.
    - `incidents`, `exclusions`: in the order of the journal; exclusions are the operator's.
    - `withdrawn`: the number of withdrawn sessions, which are not in the tables, and
      `withdrawn_completed` how many of them had been completed.
    - `decisions`: on the study as a whole, each with its UTC.
    - `other_rehearsals`: how many rehearsals `rehearsed_with` has left out.
    """

    sessions: pd.DataFrame
    attempts: pd.DataFrame
    touches: pd.DataFrame
    answers: pd.DataFrame
    traces: pd.DataFrame
    forces: Mapping[int, TouchForces | NotEstimable]
    incidents: tuple[Incident, ...]
    exclusions: tuple[Exclusion, ...]
    withdrawn: int = 0
    withdrawn_completed: int = 0
    decisions: Decisions = ()
    other_rehearsals: int = 0

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
                # A published score was not attempted: 0 aborted attempts would be made up.
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
        given = self.attempts[self.attempts.answered]
        scored = given["trial_kind"].eq("trial")
        session = given["session_id"]
        # After a catch trial or practice there is no condition whose effect could carry over.
        after_scored = scored & scored.groupby(session).shift(fill_value=False)
        return given.assign(
            place=scored.groupby(session).cumsum().astype("Int64").where(scored),
            previous=given.groupby("session_id")["condition"].shift().where(after_scored),
        ).drop_duplicates(TRIAL, keep="last")

    @cached_property
    def places_m(self) -> "pd.Series[float]":
        """The place of each touch, by `touch_id`: the finger's median position.

        It is missing for a sliding finger and on a rig without sensors.
        """
        held = self.touches["place"].ne("path")
        # A finger off the beam has no place.
        samples = self.traces[self.traces["force_n"].gt(LIFTED_N)]
        places_m = samples.groupby("touch_id")["position_m"].median()
        return places_m.reindex(self.touches.index).where(held)


def _lines(attempts: pd.DataFrame, column: str) -> "pd.Series[str]":
    """Join the texts of each trial's attempts, one per line."""
    return attempts.dropna(subset=[column]).groupby(TRIAL)[column].agg("\n".join)


def rehearsed_with(found: Sessions, study_sha256: str) -> Sessions:
    """Return `found` without the rehearsals of other study files than that of the digest.

    One of an early build, which does not tell its file, stays.
    """
    rehearsal = found.sessions["session_kind"].eq("rehearsal")
    other = rehearsal & ~found.sessions["study_sha256"].fillna(study_sha256).eq(study_sha256)
    return replace(found, sessions=found.sessions[~other], other_rehearsals=int(other.sum()))


def load_sessions(chains: Iterable[Sequence[journal.StoredEvent]]) -> Sessions:
    """Return the sessions whose events `chains` yields, one session at a time.

    Events of a withdrawn session are not read, whether they are erased or not. Sliding experiments
    and scripts are skipped.
    """
    rows = Rows()
    withdrawn = withdrawn_completed = 0
    decisions: Decisions = ()
    with _garbage_left():
        for events in chains:
            if not events:
                continue
            if events[0].tag in {journal.StudyAmended.TAG, journal.StudyRegistered.TAG}:
                decisions = [(event.utc, event.record) for event in events]
                continue
            tags = {event.tag for event in events}
            if journal.Withdrawn.TAG in tags:
                withdrawn += 1
                withdrawn_completed += journal.SessionCompleted.TAG in tags
                continue
            opened: Any = events[0].record
            if isinstance(opened, journal.SessionOpened) and opened.participant in journal.NOBODY:
                continue
            try:
                Course(rows).read(events)
                # Only between sessions: later events still change the rows of the running one.
                for table in (rows.attempts, rows.touches, rows.answers):
                    table.pack()
            except IMPOSSIBLE as error:
                name = f"{opened.participant}/{opened.session}"
                raise NotAllowed(f"session {name}: {damage(events)}") from error
    return sessions_of(
        rows, withdrawn=withdrawn, withdrawn_completed=withdrawn_completed, decisions=decisions
    )


def sessions_of(rows: Rows, **known: Any) -> Sessions:
    """Return the tables of `rows`; `known` is what they do not tell."""
    sessions = rows.sessions.frame()
    rehearsed = sessions["session_kind"].eq("rehearsal")
    names = sessions["participant"]
    # Only names that stand for a participant and for a rehearsal need a mark.
    apart = set(names[rehearsed]) & set(names[~rehearsed])

    def told(entry: _Told) -> _Told:
        plain = entry.participant.removesuffix(REHEARSED)
        return entry if plain in apart else replace(entry, participant=plain)

    return Sessions(
        sessions=sessions.assign(
            subject=names.where(~(rehearsed & names.isin(apart)), names + REHEARSED)
        ),
        attempts=rows.attempts.frame(),
        touches=with_plans(rows.touches.frame()),
        answers=rows.answers.frame(),
        traces=rows.traces(),
        forces=rows.forces,
        incidents=tuple(map(told, rows.incidents)),
        exclusions=tuple(map(told, rows.exclusions)),
        **known,
    )


@contextmanager
def _garbage_left() -> Iterator[None]:
    """Let the garbage collector rest meanwhile, as it was before afterwards.

    Events refer to nothing that refers to them, so that they go without it. It would walk through
    everything in the memory again and again, which takes a third of the time.
    """
    collected = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collected:
            gc.enable()
