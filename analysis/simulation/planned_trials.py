"""The plans of a study's slots as arrays, with each different trial once."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from analysis.estimates import IntArray
from device.people.answering import Kind, kind_of_change, meaning
from protocol.plan.plan import plan
from protocol.plan.trials import Plan, Trial
from protocol.study.study import Study
from protocol.study.study_question import ANSWERS
from protocol.study.touch import Mark, Touch, mark_of


@dataclass(frozen=True, kw_only=True)
class TrialKind:
    """What trials that are alike have in common; `expected` as in `answering.meaning`."""

    trial: Trial
    marks: tuple[Mark, ...]

    @property
    def expected(self) -> int | None:
        """The meaning of the expected answer."""
        question = self.trial.question
        return None if question is None else meaning(question, self.trial.expected)

    @property
    def change(self) -> Kind:
        """What the touches are about."""
        question = self.trial.question
        return "other" if question is None else kind_of_change(question, self.marks)

    @property
    def two_sided(self) -> bool:
        """Whether its question knows a contrary answer."""
        return self.trial.question is not None and len(ANSWERS[self.trial.question]) > 2


@dataclass(frozen=True, kw_only=True)
class PlannedTrials:
    """The trials of the slots of a study, drawn once each, for one number of the session."""

    study: Study
    session: int = 1
    kinds: list[TrialKind] = field(default_factory=list, init=False)
    _numbers: dict[object, int] = field(default_factory=dict, init=False)
    _plans: dict[int, Plan] = field(default_factory=dict, init=False)
    _rows: dict[int, IntArray] = field(default_factory=dict, init=False)

    def plan(self, slot: int) -> Plan:
        """Return the plan of a slot."""
        if slot not in self._plans:
            self._plans[slot] = plan(self.study, slot, self.session)
        return self._plans[slot]

    def kinds_of(self, slots: IntArray) -> IntArray:
        """Return which of `kinds` each trial is, shape (slots, trials)."""
        return np.stack([self._row(int(slot)) for slot in slots])

    def _row(self, slot: int) -> IntArray:
        if slot not in self._rows:
            row = [self._number(trial) for trial in self.plan(slot).trials]
            self._rows[slot] = np.array(row, dtype=np.int64)
        return self._rows[slot]

    def _number(self, trial: Trial) -> int:
        asked = (trial.kind, trial.condition, trial.question, trial.expected, trial.scored)
        known = (*asked, tuple(map(_key, trial.touches)))
        if known not in self._numbers:
            self._numbers[known] = len(self.kinds)
            marks = tuple(mark_of(touch, self.study.touch) for touch in trial.touches)
            self.kinds.append(TrialKind(trial=trial, marks=marks))
        return self._numbers[known]

    @cached_property
    def most_touches(self) -> int:
        """Most touches of a session."""
        return max(sum(len(trial.touches) for trial in self.plan(0).trials), 1)


def _key(touch: Touch) -> str:
    return touch.model_dump_json()
