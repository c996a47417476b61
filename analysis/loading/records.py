"""Rows of the tables of sessions, attempts, touches and answers; exclusions and incidents.

A field of a row is a column of its table; its type decides on the column's (see `Table`), and None
is a missing value. Names end in the unit: `_s`, `_v` (amplitude, peak), `_hz`, `_m`, `_n`. A
frequency without a unit is relative to the resonance.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Generic, Self, TypeVar, get_type_hints

import numpy as np
import pandas as pd

from analysis.estimates import IntArray
from protocol.journal.records import PlannedTrial
from protocol.plan.trials import Trial
from protocol.study.columns import PLANNED_PER_TOUCH
from protocol.study.touch import Touch

Row = TypeVar("Row")

REHEARSED = " (rehearsal)"
"""Follows the name of a rehearsal's participant where the session of that name is there, too."""

CHANGED = ", then "
"""Between the versions that recorded a session that was resumed by another one."""

FIRST_OF_TODAY = 2
"""The first major version whose rules on exclusions are today's."""


def is_older(versions: Mapping[str, str]) -> bool:
    """Return whether a session of these `SessionRow.versions` was recorded before today's rules.

    One that a later version continued was not; nor a published table, which no version recorded.

    >>> is_older({"touchbeam": "1.0.0"}), is_older({"touchbeam": "1.0.0, then 2.1.0"})
    (True, False)
    """
    major = versions.get("touchbeam", "").rpartition(CHANGED)[2].partition(".")[0]
    return major.isdecimal() and int(major) < FIRST_OF_TODAY


TEXT = pd.StringDtype("python", na_value=np.nan)
"""The type of text columns. (The pyarrow storage refuses text that is not valid Unicode.)"""

_COLUMN_TYPES: Mapping[Any, Any] = {
    str: TEXT,
    str | None: TEXT,
    int: "int64",
    # Of whole numbers and truth values, only pandas' own types can hold a missing one.
    int | None: "Int64",
    bool: "bool",
    bool | None: "boolean",
    float: "float64",
    float | None: "float64",
    # Microseconds are what Python's datetime has, so that nothing is rounded.
    datetime | None: "datetime64[us, UTC]",
}
"""The column's type for each type of field; any other field makes a column of Python objects."""


@dataclass(kw_only=True, slots=True)
class SessionRow:
    """A session, or a subject of a published table.

    `session_kind` is participant, rehearsal or published; `exclusion` is the operator's reason for
    excluding the whole session, `inclusion` the one for taking an exclusion back, `study_sha256`
    the digest of the study file at its beginning, and `imported_from` the file of a published
    table, with its digest. `registration` is the digest that seeded the plan, and `calibration` the
    rig in force in a registered session. `planned_trials` counts those of conditions, answered or
    not, without those that the operator excluded.
    """

    participant: str
    session: int
    session_kind: str
    conditions: tuple[str, ...]
    session_completed: bool = False
    exclusion: str | None = None
    inclusion: str | None = None
    language: str | None = None
    answer_order: str | None = None
    slot: int | None = None
    group: str | None = None
    seed: Any = None  # an integer of any size
    study_sha256: str | None = None
    imported_from: str | None = None
    versions: Mapping[str, str] = field(default_factory=dict)
    virtual: Any = None  # a `VirtualTruth`
    device: str | None = None
    registration: str | None = None
    calibration: Any = None  # a `Calibration`
    operator_noted: Mapping[str, str] = field(default_factory=dict)
    planned_trials: int = 0


@dataclass(kw_only=True, slots=True)
class AttemptRow:
    """An attempt at a trial, with its plan at that time; or a score of a published table.

    - `trial_index`: the trial's place in the plan, or the score's place in its table, from 0.
    - `attempt`: counts from 1; missing for a published score, as are plan and course.
    - `score`: missing where it was not asked for or not given.
    - `notes`: the operator's, from the attempt's beginning until the next one, one per line.
    - `exclusion`, `inclusion`: the operator's reasons for excluding the trial and for taking that
      back.
    - `study_sha256`, `study_text`: the study file in force; `lowest_score`: of its scale, as far as
      it is known.
    - `contrast`: predicted by the author of an imported table, if it was.
    - `rig`: as calibrated at that time, in a registered session.
    - `track` and what follows: of a trial of a track, whose `level` is the number of its level;
      `track_role` and `interval` as planned, the others as with its answer in the journal;
      `reversal`: whether its rule turned at this answer, missing where no rule turns.
    """

    session_id: int
    trial_index: int
    trial_kind: str
    condition: str | None
    attempt: int | None = None
    block: int | None = None
    level: float | None = 1.0
    opposite: bool = False
    question: str | None = None
    expected: str | None = None
    answered: bool = False
    change: str | None = None
    agrees: bool | None = None
    score: float | None = None
    reaction_time_s: float | None = None
    score_reaction_time_s: float | None = None
    abort_reason: str | None = None
    notes: str | None = None
    exclusion: str | None = None
    inclusion: str | None = None
    started_utc: datetime | None = None
    answered_utc: datetime | None = None
    started_monotonic_s: float | None = None
    duration_s: float | None = None
    resonance_hz: float | None = None
    resonance_tip_m_per_v: float | None = None
    study_sha256: str | None = None
    study_text: Any = None
    lowest_score: float | None = None
    contrast: float | None = None
    rig: Any = None  # a `Calibration`
    track: str | None = None
    track_role: str | None = None
    interval: int | None = None
    level_value: float | None = None
    correct: bool | None = None
    reversal: bool | None = None

    @classmethod
    def begun(cls, planned: PlannedTrial | Trial, **known: Any) -> Self:
        """Return the row of an attempt at a `planned` trial; `known` are its other columns."""
        if (of := planned.track) is not None:
            known |= {"track": of.name, "track_role": of.role, "interval": of.interval}
        return cls(
            trial_index=planned.index,
            block=planned.block,
            trial_kind=planned.kind,
            condition=planned.condition,
            level=planned.level if of is None else None,
            opposite=planned.opposite,
            question=planned.question,
            expected=planned.expected,
            **known,
        )


@dataclass(kw_only=True, slots=True)
class TouchRow:
    """A touch that was begun: as planned (`with_plans`), commanded, read back and judged.

    - `start_*`, `end_*`: as read back; missing if the touch was cut short.
    - `force_n` (median), `force_ok`, `place_ok`: missing also on a rig without sensors; `speed_ok`
      where speed is not judged, too.
    """

    attempt_id: int
    planned: Touch
    beam: str | None
    commanded_voltage_v: float
    commanded_frequency_hz: float
    start_voltage_v: float | None = None
    end_voltage_v: float | None = None
    start_frequency_hz: float | None = None
    end_frequency_hz: float | None = None
    start_monitor_v: float | None = None
    end_monitor_v: float | None = None
    force_n: float | None = None
    force_ok: bool | None = None
    place_ok: bool | None = None
    speed_ok: bool | None = None


def with_plans(touches: pd.DataFrame) -> pd.DataFrame:
    """Return the table of touches with columns for what was planned of each."""
    # A study plans few different touches, and a table has many.
    places, plans = _numbered(touches["planned"].tolist())
    told = {
        it.name: pd.Series(
            [getattr(plan, it.planned) for plan in plans], dtype=TEXT if it.levels else "float64"
        )
        for it in PLANNED_PER_TOUCH
    }
    return touches.join(pd.DataFrame(told).iloc[places].reset_index(drop=True))


def _numbered(values: Sequence[Any]) -> tuple[IntArray, list[Any]]:
    """Return the place of each value among the different objects, and those."""
    # By identity, because 1, 1.0 and True are equal, and a mapping has no hash.
    place_of: dict[int, int] = {}
    places = [place_of.setdefault(id(value), len(place_of)) for value in values]
    told = dict(zip(places, values, strict=True))
    return np.array(places, np.int64), list(told.values())


@dataclass(kw_only=True, slots=True)
class AnswerRow:
    """The answer to a question of the study's own.

    - `attempt_id`: the row of the attempt if it is about a trial.
    - `when`: as in the study file; `block` is the number of the block just over.
    - `answer`: a label's value, a tuple of them, a number or a text; None if it was skipped.
    """

    session_id: int
    name: str
    when: str
    answer: Any
    reaction_time_s: float
    attempt_id: int | None = None
    block: int | None = None


class Table(Generic[Row]):
    """A table that grows row by row.

    Rows are packed into a part of the table when there are many of them, since the garbage
    collector slows down with the number of long-lived objects.
    """

    ROWS_OF_A_PART = 5_000

    def __init__(self, row_type: type[Row]) -> None:
        self._types = {
            name: _COLUMN_TYPES.get(hint, object) for name, hint in get_type_hints(row_type).items()
        }
        self._parts: list[pd.DataFrame] = []
        self._packed = 0
        self._rows: list[Row] = []

    @property
    def last(self) -> Row:
        """The last row; it may be changed until the rows are packed."""
        return self._rows[-1]

    @property
    def last_id(self) -> int:
        return self._packed + len(self._rows) - 1

    def append(self, row: Row) -> None:
        self._rows.append(row)

    def remove(self, row: Row) -> None:
        """Take back a row that is not packed yet."""
        self._rows = [kept for kept in self._rows if kept is not row]

    def pack(self) -> None:
        """Pack the rows if there are many; none of them may be changed any more."""
        if len(self._rows) >= self.ROWS_OF_A_PART:
            self._parts.append(self._part())
            self._packed += len(self._rows)
            self._rows = []

    def frame(self) -> pd.DataFrame:
        """Return the table, with one column per field of its rows."""
        last = self._part()
        return pd.concat([*self._parts, last], ignore_index=True) if self._parts else last

    def _part(self) -> pd.DataFrame:
        columns = {
            name: pd.Series([getattr(row, name) for row in self._rows], dtype=kind)
            for name, kind in self._types.items()
        }
        return pd.DataFrame(columns)


def values(column: "pd.Series[Any]") -> list[Any]:
    """Return the values of a column as plain Python objects, None for a missing one."""
    # `tolist` alone would give NaN, NA or NaT for a missing value, depending on the type.
    return column.astype(object).where(column.notna(), None).tolist()


@dataclass(frozen=True, kw_only=True)
class Incident:
    """Something that interrupted a session or that the operator noted."""

    participant: str
    session: int
    what: str
    text: str = ""
    trial: int | None = None


@dataclass(frozen=True, kw_only=True)
class Exclusion:
    """A participant, a session or a trial that the report leaves out, by whom or what, and why."""

    participant: str
    by: str
    why: str
    session: int | None = None
    trial: int | None = None
