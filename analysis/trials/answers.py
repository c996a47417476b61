"""Answers to a study's own questions, summed up by condition or block."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean, median, stdev
from typing import Any, NamedTuple

import pandas as pd

from analysis.estimates import Json
from analysis.loading.records import values
from protocol.study.study import Study
from protocol.study.study_question import KINDS, StudyQuestion

CATCH = "catch trials"


@dataclass(frozen=True, kw_only=True)
class AnswerGroup:
    """The answers to a question under a condition, after a block, or of all participants.

    `given` are those that were not skipped.
    """

    name: str
    given: tuple[Any, ...]
    skipped: int

    def numbers(self) -> Json:
        """Return mean, standard deviation, median and range of numbers; none of no answers."""
        if not self.given:
            return {}
        # One value has no standard deviation.
        spread = {"sd": stdev(self.given)} if len(self.given) > 1 else {}
        return {
            "mean": fmean(self.given),
            **spread,
            "median": median(self.given),
            "lowest": min(self.given),
            "highest": max(self.given),
        }

    def counts(self, question: StudyQuestion) -> dict[str, int]:
        """Return how often each label was chosen."""
        several = question.kind == "several"
        chosen = Counter(value for each in self.given for value in (each if several else (each,)))
        # A label that nobody chose is shown with 0.
        return {value: chosen[value] for value in question.values}


@dataclass(frozen=True, kw_only=True)
class Answers:
    """All answers to one of the study's own questions.

    `groups` are conditions in the order of the study and catch trials, or blocks; a question that
    is asked once has one group. Practice is left out. `said` has participant, session, group and
    answer of each text.
    """

    question: StudyQuestion
    groups: tuple[AnswerGroup, ...]
    said: tuple[tuple[str, int, str, str], ...] = ()

    def as_json(self) -> Json:
        about = self.question
        return {
            "name": about.name,
            "kind": about.kind,
            "when": about.when,
            "text": dict(about.text),
            "groups": [
                {
                    "name": group.name,
                    "answers": len(group.given),
                    "skipped": group.skipped,
                    **(group.numbers() if about.is_number else {}),
                    **({"counts": group.counts(about)} if about.values else {}),
                }
                for group in self.groups
            ],
            **({"said": [list(each) for each in self.said]} if about.kind == "text" else {}),
        }


class _Row(NamedTuple):
    """An answer and what it is about."""

    participant: str
    session: int
    name: str
    when: str
    block: int | None
    trial_kind: str | None
    condition: str | None
    answer: Any

    @property
    def group(self) -> str | None:
        """The group that the answer belongs to; None for practice."""
        if self.when == "trial":
            scored = self.condition if self.trial_kind == "trial" else None
            return CATCH if self.trial_kind == "catch" else scored
        return f"block {self.block}" if self.when == "block" else "all"


def answers_by_question(study: Study, answers: pd.DataFrame) -> list[Answers]:
    """Return the summed-up answers to each of the study's own questions that was asked."""
    columns = (values(answers[name]) for name in _Row._fields)
    # Blocks stand in their order; the first session need not have had all of them.
    rows = sorted(map(_Row, *columns), key=lambda row: row.block or 0)
    found = (
        _answers(study, question, [row for row in rows if _is_of(question, row)])
        for question in study.question
    )
    return [each for each in found if each.groups]


def _is_of(question: StudyQuestion, row: _Row) -> bool:
    """Return whether `row` answers `question` as the study has it now: it may have been amended."""
    fits = row.answer is None or isinstance(row.answer, KINDS[question.kind].answers)
    return row.name == question.name and fits


def _answers(study: Study, question: StudyQuestion, rows: Sequence[_Row]) -> Answers:
    given: dict[str, list[Any]] = {name: [] for name in (*study.conditions, CATCH)}
    said = []
    for row in rows:
        if row.group is None:
            continue
        given.setdefault(row.group, []).append(row.answer)
        if question.kind == "text" and row.answer is not None:
            said.append((row.participant, row.session, row.group, str(row.answer)))
    return Answers(
        question=question,
        groups=tuple(
            AnswerGroup(
                name=name,
                given=tuple(answer for answer in answers if answer is not None),
                skipped=answers.count(None),
            )
            for name, answers in given.items()
            if answers
        ),
        said=tuple(said),
    )
