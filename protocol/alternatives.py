"""Shorter and longer sessions of a study, planned as if its `design.repeats` were another."""

from collections.abc import Iterator
from dataclasses import dataclass

from protocol.design import MOST_REPEATS
from protocol.durations import session_s
from protocol.impossible import design_problems, most_catches
from protocol.plan import plan
from protocol.study import Condition, Study


@dataclass(frozen=True, kw_only=True)
class Alternative:
    """A session of so many repeats.

    `whole` says that the study allows it as it is; else its other wishes were relaxed to plan it.
    """

    repeats: int
    duration_s: float
    whole: bool


def alternatives(study: Study) -> Iterator[Alternative]:
    """Yield sessions of fewer, of as many and of more repeats than the study's, first slot.

    No more than a study file may ask for.
    """
    repeats = study.design.repeats
    others = {1, 2, max(1, repeats // 2), repeats, repeats + 1, 2 * repeats, 4 * repeats}
    for other in sorted(other for other in others if other <= MOST_REPEATS):
        asked = _with(study, repeats=other)
        whole = study.design.opposite_repeats < other and not design_problems(asked)
        planned = asked if whole else _relaxed(asked)
        yield Alternative(
            repeats=other, duration_s=session_s(planned, plan(planned, 0)), whole=whole
        )


def _with(study: Study, **design: object) -> Study:
    return study.model_copy(update={"design": study.design.model_copy(update=design)})


def _relaxed(study: Study) -> Study:
    """The study with its other wishes as nearly met as its repeats allow."""
    design = study.design
    conditions = tuple(_of_one_level(condition, design.repeats) for condition in study.condition)
    return _with(
        study.model_copy(update={"condition": conditions}),
        opposite_repeats=min(design.opposite_repeats, design.repeats - 1),
        catch_trials=min(design.catch_trials, most_catches(study)),
        max_alike_in_row=max(design.max_alike_in_row, design.repeats),
    )


def _of_one_level(condition: Condition, repeats: int) -> Condition:
    """The condition at its highest level alone where its levels do not divide the repeats."""
    if repeats % len(condition.levels) == 0:
        return condition
    return condition.model_copy(update={"levels": (max(condition.levels),)})
