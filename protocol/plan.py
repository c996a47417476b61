"""The plan of one session: the study's trials in the order that the participant's slot gives."""

import random
from dataclasses import dataclass

from protocol.questions import Question
from protocol.study import Condition, Opening, Study, Touch
from protocol.williams import williams_sequences


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One trial: touches, then a question unless `question` is None, then a score if `scored`.

    `kind` is baseline, signal, practice, trial or catch; `index` counts from 0 within a session.
    """

    index: int
    block: int
    kind: str
    condition: str | None
    question: Question | None
    expected: str | None
    scored: bool
    touches: tuple[Touch, ...]


@dataclass(frozen=True, kw_only=True)
class Plan:
    """The trials of one session, and which of the design's sequences gave their order."""

    slot: int
    sequence: tuple[str, ...]
    trials: tuple[Trial, ...]


def plan(study: Study, slot: int) -> Plan:
    """Return the plan for the participant in `slot`, counted from 0 over the cohort.

    The study's seed decides which Williams sequence each slot has; any run of as many slots as
    there are sequences, from a multiple of that number on, holds every sequence once.
    """
    order = _order(study, slot)
    opening = [_opening_trial(index, item) for index, item in enumerate(study.opening)]
    scored = [
        _scored_trial(len(opening) + position, study.condition[number])
        for position, number in enumerate(order)
    ]
    return Plan(
        slot=slot,
        sequence=tuple(study.conditions[number] for number in order),
        trials=tuple(opening + scored),
    )


def _order(study: Study, slot: int) -> tuple[int, ...]:
    if study.design.order == "fixed":
        return tuple(range(len(study.condition)))
    sequences = list(williams_sequences(len(study.condition)))
    random.Random(f"order/{study.study.seed}").shuffle(sequences)
    return sequences[slot % len(sequences)]


def _opening_trial(index: int, item: Opening) -> Trial:
    return Trial(
        index=index,
        block=0,
        kind=item.kind,
        condition=None,
        question=item.question,
        expected=item.expected,
        scored=False,
        touches=item.touches,
    )


def _scored_trial(index: int, condition: Condition) -> Trial:
    return Trial(
        index=index,
        block=1,
        kind="trial",
        condition=condition.name,
        question=condition.question,
        expected=condition.expected,
        scored=True,
        touches=condition.touches,
    )
