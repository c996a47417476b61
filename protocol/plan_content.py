"""Proves that every trial of a plan asks for what its condition says; part of the plan's check."""

from collections import Counter
from collections.abc import Iterator
from math import isclose

from protocol.questions import ANSWERS
from protocol.study import Condition, Study
from protocol.touch import Touch
from protocol.trial import Plan, Trial

Broken = Iterator[tuple[str, str]]


def content_broken(study: Study, plan: Plan) -> Broken:
    """Yield (rule, value) for each trial that is not its condition's."""
    conditions = {condition.name: condition for condition in study.condition}
    for trial in plan.trials:
        if trial.condition is not None and trial.condition not in conditions:
            yield "a trial must name a condition of the study", repr(trial.condition)
        elif trial.condition is not None:
            condition = conditions[trial.condition]
            for rule in (*_asked(condition, trial), *_touched(condition, trial)):
                yield rule, f"trial {trial.index} ({trial.kind}, {condition.name})"
    yield from _opposites(study, plan)


def _asked(condition: Condition, trial: Trial) -> Iterator[str]:
    if trial.question != condition.question:
        yield "a trial must ask its condition's question"
    same, contrary = ANSWERS[condition.question][-1], set(ANSWERS[condition.question])
    if trial.kind == "catch":
        wanted = {same}
    elif trial.opposite:
        wanted = contrary - {same, condition.expected}
    else:
        wanted = {condition.expected}
    if trial.expected not in wanted:
        yield f"the expected answer must be one of {sorted(wanted)}"
    if trial.scored == (trial.kind == "catch"):
        yield "all but catch trials must be scored"


def _touched(condition: Condition, trial: Trial) -> Iterator[str]:
    if trial.kind == "catch" and any(touch.peak_voltage_v for touch in trial.touches):
        yield "a catch trial must stay at 0 V"
    if (trial.level == 0) != (trial.kind == "catch") or (
        trial.level and trial.level not in condition.levels
    ):
        yield f"the level must be one of {list(condition.levels)}, and 0 in a catch trial"
    wanted = [_course(touch, trial.level, backwards=trial.opposite) for touch in condition.touches]
    wanted = wanted[::-1] if trial.opposite else wanted
    got = [_course(touch, 1.0, backwards=False) for touch in trial.touches]
    if len(got) != len(wanted) or not all(map(_alike, got, wanted)):
        yield "the touches must be the condition's, at the trial's level"


def _course(touch: Touch, level: float, *, backwards: bool) -> tuple[list[float], list[object]]:
    """What changes during a touch, from beginning to end, and what stays."""
    changing = [touch.voltage_v * level, touch.end_voltage_v * level]
    changing += [touch.frequency, touch.end_frequency]
    if backwards:
        changing = [changing[1], changing[0], changing[3], changing[2]]
    staying = [touch.place, touch.direction, touch.coverage, touch.press, touch.beam]
    return changing, [*staying, touch.duration_s, touch.instruction]


def _alike(one: tuple[list[float], list[object]], other: tuple[list[float], list[object]]) -> bool:
    return one[1] == other[1] and all(
        isclose(a, b, rel_tol=1e-12) for a, b in zip(one[0], other[0], strict=True)
    )


def _opposites(study: Study, plan: Plan) -> Broken:
    turned = Counter(trial.condition for trial in plan.trials if trial.opposite)
    for condition in study.condition:
        possible = len(ANSWERS[condition.question]) == 3 and condition.expected != "same"
        there = [_course(touch, 1.0, backwards=False) for touch in condition.touches]
        back = [_course(touch, 1.0, backwards=True) for touch in reversed(condition.touches)]
        wanted = study.design.opposite_repeats if possible and there != back else 0
        if turned[condition.name] != wanted:
            yield (
                f"{condition.name} must come in the opposite order {wanted} times",
                str(turned[condition.name]),
            )
