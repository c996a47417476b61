"""A study's tables for Python: trials, touches, traces, sessions and plans as data frames.

Their columns are those of exported data, but for moments, which are moments here, not texts, and
for the columns per touch, which stand in a table of touches.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import pandas as pd

from analysis.export.columns import COLUMNS, PARTICIPANT_COLUMNS, Column, question_columns
from analysis.export.trial_table import participant_table, session_table, trials_with_answers
from analysis.loading.sessions import Sessions
from protocol.journal.records import PlannedTrial, TraceSample
from protocol.plan.trials import Trial
from protocol.study.study_question import StudyQuestion
from protocol.study.touch import Touch

_BY_NAME = {column.name: column for column in COLUMNS}
_SESSION = [
    *("participant", "session", "session_kind", "session_completed", "exclusion_reason"),
    *("inclusion_reason", "device", "skin_state", "room_temperature", "humidity", "cleaning"),
    *("language", "answer_order", "slot", "seed", "touchbeam_version"),
]
_PLANNED_TOUCH = {
    "place": "place",
    "direction": "direction",
    "coverage": "coverage",
    "press": "press",
    "planned_voltage_v": "voltage_v",
    "planned_end_voltage_v": "end_voltage_v",
    "planned_frequency": "frequency",
    "planned_end_frequency": "end_frequency",
}
"""The attribute of a planned touch behind each column."""
_TRIAL = ["participant", "session", "session_kind", "trial_index"]
"""The columns that identify a trial."""
_TOUCH = [*_TRIAL, "touch"]
"""The columns that identify a touch."""
_PER_TOUCH = [column.name for column in COLUMNS if column.per_touch]
_OF_TOUCHES = (
    Column("touch", "Number of the touch in its trial, from 0."),
    Column("t_s", "When the sample was taken, by the device's clock.", unit="s"),
    Column("force_n", "Force of the finger.", unit="N"),
    Column("position_m", "Position of the finger along the beam.", unit="m"),
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Frames:
    """The tables of `sessions`, some of those `found`; `questions` are the study's own."""

    found: Sessions
    kept: pd.DataFrame
    questions: tuple[StudyQuestion, ...]

    @cached_property
    def sessions(self) -> pd.DataFrame:
        """A row per session."""
        named = {"session_exclusion": "exclusion_reason", "session_inclusion": "inclusion_reason"}
        table = self._sessions.rename(columns=named)
        return table[_SESSION].infer_objects().reset_index(drop=True)

    @cached_property
    def _sessions(self) -> pd.DataFrame:
        return session_table(self.kept)

    @cached_property
    def participants(self) -> pd.DataFrame:
        """A row per participant, with the answers that were given once."""
        return participant_table(self.kept, self._trials, self.questions).infer_objects()

    @cached_property
    def trials(self) -> pd.DataFrame:
        """A row per trial that was begun, of its last attempt."""
        return self._trials.reset_index(drop=True)

    @cached_property
    def _trials(self) -> pd.DataFrame:
        table = trials_with_answers(self.found, self._sessions, self.questions)
        columns = (*COLUMNS, *question_columns(self.questions))
        return table[[each.name for each in columns if not each.per_touch]].infer_objects()

    @cached_property
    def touches(self) -> pd.DataFrame:
        """A row per touch of the trials' last attempts."""
        return self._touches.reset_index(drop=True)

    @cached_property
    def _touches(self) -> pd.DataFrame:
        names = self._trials[_TRIAL].rename_axis(None)
        touches = self.found.touches.merge(names, left_on="attempt_id", right_index=True)
        numbered = touches.assign(touch=touches.groupby("attempt_id").cumcount())
        return numbered[[*_TOUCH, *_PER_TOUCH]]

    @cached_property
    def traces(self) -> pd.DataFrame:
        """A row per sample of the finger during these touches."""
        names = self._touches[_TOUCH]
        samples = self.found.traces.merge(names, left_on="touch_id", right_index=True)
        return samples[[*_TOUCH, *TraceSample._fields]].reset_index(drop=True)

    def described(self, scale: str) -> pd.DataFrame:
        """Return meaning, unit and levels of each table's columns; `scale` is that of scores."""
        score = _BY_NAME["score"]
        score = replace(score, description=score.description.format(scale=scale))
        known = _BY_NAME | {"score": score}
        own = {column.name: column for column in question_columns(self.questions)}
        sampled = {column.name: column for column in _OF_TOUCHES}
        people = {column.name: column for column in PARTICIPANT_COLUMNS}
        tables: Sequence[tuple[str, Iterable[Any], Mapping[str, Column]]] = (
            ("participants", self.participants, known | own | people),
            ("sessions", _SESSION, known),
            ("trials", self._trials, known | own),
            ("touches", self._touches, sampled | known),
            ("traces", [*_TOUCH, *TraceSample._fields], known | sampled),
        )
        rows = [
            (table, name, column.description, column.unit, _listed(column.levels))
            for table, names, columns in tables
            for name in names
            if (column := columns[name])
        ]
        headings = ["table", "column", "meaning", "unit", "levels"]
        return pd.DataFrame(rows, columns=headings).set_index(["table", "column"])


def _listed(levels: Mapping[str, str]) -> str | None:
    return "; ".join(f"{level}: {meaning}" for level, meaning in levels.items()) or None


def plan_frame(planned: Iterable[Trial | PlannedTrial]) -> pd.DataFrame:
    """Return planned trials, a row each; a column per touch holds a tuple of values."""
    return pd.DataFrame([_plan_row(trial) for trial in planned])


def _plan_row(trial: Trial | PlannedTrial) -> dict[str, Any]:
    touches = [
        each if isinstance(each, Touch) else Touch.model_validate(each) for each in trial.touches
    ]
    return {
        "trial_index": trial.index,
        "block": trial.block,
        "trial_kind": trial.kind,
        "condition": trial.condition,
        "level": trial.level,
        "opposite": trial.opposite,
        "question": trial.question,
        "expected": trial.expected,
        "touches": len(touches),
        **{
            column: tuple(getattr(touch, name) for touch in touches)
            for column, name in _PLANNED_TOUCH.items()
        },
    }
