"""Checks of the plan of a sliding experiment, independent of the code that drew it."""

from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from math import isclose

from protocol.errors import Problem
from protocol.plan.trials import Plan, Trial
from protocol.proof.track_checks import Violations
from protocol.proof.trial_checks import limit_violations
from protocol.study.study import Study
from protocol.study.touch import SlidePass

PassKind = tuple[float, tuple[float, float], float, str]
"""Drive (relative, or in Hz), ends of the way, m, its duration, s, and direction of a pass."""


def slide_plan_problems(study: Study, plan: Plan) -> list[Problem]:
    """Return every requirement of `study.slide` that `plan` violates; an empty list proves it."""
    checks = (limit_violations, _passes, _driven, _references)
    return [
        Problem(where="plan of the sliding experiment", rule=rule, value=value)
        for check in checks
        for rule, value in check(study, plan)
    ]


def _passes(study: Study, plan: Plan) -> Violations:
    indexes = [trial.index for trial in plan.trials]
    if indexes != list(range(len(indexes))):
        yield "passes must be numbered from 0", str(indexes)
    for trial in plan.trials:
        asks = trial.question or trial.expected or trial.scored
        if trial.kind != "pass" or asks or len(trial.touches) != 1:
            yield "a pass must be one touch, about which nobody is asked", f"trial {trial.index}"
        elif not _as_asked(study, trial):
            yield "a pass must be made as [slide] says", f"trial {trial.index}"


def _as_asked(study: Study, trial: Trial) -> bool:
    """Return whether what all passes have in common is as the study has it."""
    (made,) = trial.touches
    rest = (trial.level, trial.opposite, trial.break_s, made.place, made.press, made.beam)
    return (
        isinstance(made, SlidePass)
        and made.programme == "hold"
        and made.voltage_v in {0.0, study.slide.voltage_v}
        and rest == (1.0, False, 0.0, "path", 1.0, None)
        # What is checked against the limits is the drive itself.
        and (
            made.frequency_hz is None
            or isclose(made.frequency * study.rig.nominal_resonance_hz, made.frequency_hz)
        )
    )


def _kind(trial: Trial) -> PassKind:
    made = trial.touches[0]
    drive, way = made.frequency_hz or made.frequency, made.own_path_m or (0.0, 0.0)
    return drive, way, made.duration_s or 0.0, made.direction


def _is_driven(trial: Trial) -> bool:
    return any(touch.peak_voltage_v for touch in trial.touches)


def _wanted(study: Study, drives: Sequence[float]) -> set[PassKind]:
    slide = study.slide
    return {
        (drive, (left_m, right_m), round((right_m - left_m) / speed_m_s, 9), direction)
        for drive in drives
        for left_m, right_m in slide.paths_m
        for speed_m_s in slide.speeds_m_s
        for direction in slide.directions
    }


def _driven(study: Study, plan: Plan) -> Violations:
    slide, driven = study.slide, [trial for trial in plan.trials if _is_driven(trial)]
    wanted = _wanted(study, (*slide.frequencies, *slide.frequencies_hz))
    for repeat in range(1, slide.repeats + 1):
        made = Counter(_kind(trial) for trial in driven if trial.block == repeat)
        if made != Counter(wanted):
            yield f"every driven pass must come once in repeat {repeat}", f"{made.total()} passes"
    if len({trial.condition for trial in driven}) != len(set(map(_kind, driven))):
        yield "a name must tell a pass from every other one", str({t.condition for t in driven})
    blocks = [trial.block for trial in plan.trials]
    if blocks != sorted(blocks) or not set(blocks) <= set(range(1, slide.repeats + 1)):
        yield "repeats must be numbered from 1 and follow one another", str(blocks)


def _references(study: Study, plan: Plan) -> Violations:
    """Check that the rounds without a drive are whole, and spread from first to last."""
    at = [place for place, trial in enumerate(plan.trials) if not _is_driven(trial)]
    ways = {kind[1:] for kind in _wanted(study, (1.0,))}
    rounds = [at[first : first + len(ways)] for first in range(0, len(at), len(ways))]
    if len(rounds) != study.slide.references:
        yield f"there must be {study.slide.references} rounds of references", str(len(rounds))
    for places in rounds:
        if {_kind(plan.trials[place])[1:] for place in places} != ways:
            yield "a round of references must have every way once", f"trials {places}"
        if places != list(range(places[0], places[0] + len(places))):
            yield "a round of references must not be interrupted", f"trials {places}"
    gaps = [later[0] - before[0] for before, later in pairwise(rounds)]
    ends = at and (at[0] != 0 or (len(rounds) > 1 and at[-1] != len(plan.trials) - 1))
    # Rounds are spread over a whole number of passes: gaps may differ by one of them.
    if ends or max(gaps, default=0) - min(gaps, default=0) > 1:
        yield "references must be spread evenly from first to last", f"trials {at}"
