"""Sessions of other lengths: how many repeats a study could have, and how long they take."""

from collections.abc import Iterator
from dataclasses import dataclass

from protocol.plan.feasibility import design_problems, most_catches
from protocol.plan.plan import plan
from protocol.plan.trials import session_s
from protocol.study.design import MOST_REPEATS
from protocol.study.study import Study


@dataclass(frozen=True, kw_only=True)
class SessionLength:
    """A session of `repeats` repeats and its duration.

    `whole` says that the study allows it unchanged; otherwise other constraints of the design
    were relaxed to plan it.
    """

    repeats: int
    duration_s: float
    whole: bool


def session_lengths(study: Study) -> Iterator[SessionLength]:
    """Yield sessions of the first slot with fewer, as many and more repeats than the study's.

    The number of repeats never exceeds what a study file may set.
    """
    repeats = study.design.repeats
    others = {1, 2, max(1, repeats // 2), repeats, repeats + 1, 2 * repeats, 4 * repeats}
    for other in sorted(other for other in others if other <= MOST_REPEATS):
        asked = _with(study, repeats=other)
        whole = study.design.opposite_repeats < other and not design_problems(asked)
        planned = asked if whole else _relaxed(asked)
        yield SessionLength(
            repeats=other, duration_s=session_s(planned, plan(planned, 0)), whole=whole
        )


def _with(study: Study, **design: object) -> Study:
    return study.model_copy(update={"design": study.design.model_copy(update=design)})


def _relaxed(study: Study) -> Study:
    """Return the study with its other constraints relaxed as far as its repeats require."""
    design = study.design
    conditions = tuple(
        condition.model_copy(update={"levels": (max(condition.levels),)})
        if design.repeats % len(condition.levels)
        else condition
        for condition in study.condition
    )
    return _with(
        study.model_copy(update={"condition": conditions}),
        opposite_repeats=min(design.opposite_repeats, design.repeats - 1),
        catch_trials=min(design.catch_trials, most_catches(study)),
        max_alike_in_row=max(design.max_alike_in_row, design.repeats),
    )
