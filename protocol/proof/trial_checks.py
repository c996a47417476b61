"""Checks of a plan and its trials against the study, independent of the code that drew it.

Each check states one requirement of the study file anew, without regard to how a plan is drawn.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import groupby, pairwise
from math import isclose

from protocol.errors import Problem
from protocol.plan.trials import Plan, Trial
from protocol.proof.limit_checks import limit_violations
from protocol.study.questions import ANSWERS
from protocol.study.study import Condition, Study
from protocol.study.touch import Touch

Violations = Iterator[tuple[str, str]]


def content_violations(study: Study, plan: Plan) -> Violations:
    """Yield (rule, value) for each trial that does not match its condition."""
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
    """Return what changes during a touch, from beginning to end, and what stays constant."""
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


def _opposites(study: Study, plan: Plan) -> Violations:
    turned = Counter(trial.condition for trial in plan.trials if trial.opposite)
    for condition in study.condition:
        *changes, same = ANSWERS[condition.question]
        possible = len(changes) == 2 and condition.expected != same
        there = [_course(touch, 1.0, backwards=False) for touch in condition.touches]
        back = [_course(touch, 1.0, backwards=True) for touch in reversed(condition.touches)]
        wanted = study.design.opposite_repeats if possible and there != back else 0
        if turned[condition.name] != wanted:
            yield (
                f"{condition.name} must come in the opposite order {wanted} times",
                str(turned[condition.name]),
            )


def plan_problems(study: Study, plan: Plan) -> list[Problem]:
    """Return every requirement of `study` that `plan` violates; an empty list proves the plan."""
    checks = (
        limit_violations,  # what a finger feels comes first
        _numbering,
        _opening,
        _practice,
        _repeats,
        _blocks,
        _runs,
        _catches,
        _breaks,
        _groups,
        content_violations,
    )
    return [
        Problem(where=f"plan of slot {plan.slot}", rule=rule, value=value)
        for check in checks
        for rule, value in check(study, plan)
    ]


def _kinds(plan: Plan, *kinds: str) -> list[Trial]:
    return [trial for trial in plan.trials if trial.kind in kinds]


def _numbering(study: Study, plan: Plan) -> Violations:
    indexes = [trial.index for trial in plan.trials]
    if indexes != list(range(len(indexes))):
        yield "trials must be numbered from 0", str(indexes)
    names = tuple(trial.condition for trial in _kinds(plan, "trial"))
    if names != plan.sequence:
        yield "the sequence must name the scored trials in order", str(plan.sequence)
    if not 1 <= plan.session <= study.design.sessions:
        yield f"the session must lie in [1, {study.design.sessions}]", str(plan.session)


def _opening(study: Study, plan: Plan) -> Violations:
    wanted = [(item.kind, item.touches, item.question, item.expected) for item in study.opening]
    first = plan.trials[: len(wanted)]
    if [(t.kind, t.touches, t.question, t.expected) for t in first] != wanted:
        yield "a session must begin with the study's opening", str([t.kind for t in first])
    for trial in first:
        if trial.scored or trial.opposite or trial.level != 1:
            yield "an opening must match the study file and not be scored", f"trial {trial.index}"
    if len(_kinds(plan, "baseline", "signal")) != len(wanted):
        yield "the opening must come once", str(len(_kinds(plan, "baseline", "signal")))


def _practice(study: Study, plan: Plan) -> Violations:
    begin = len(study.opening)
    end = begin + study.design.practice_trials
    practised = [trial.index for trial in _kinds(plan, "practice")]
    if practised != list(range(begin, end)):
        yield f"practice must be trials {begin} to {end - 1}", str(practised)
    if any(trial.block != 0 for trial in plan.trials[:end]):
        yield "opening and practice must be block 0", str([t.block for t in plan.trials[:end]])


def _repeats(study: Study, plan: Plan) -> Violations:
    wanted = dict.fromkeys(study.conditions, study.design.repeats)
    got = Counter(trial.condition for trial in _kinds(plan, "trial"))
    if got != wanted:
        yield f"every condition must come {study.design.repeats} times", str(dict(got))
    for condition in study.condition:
        levels = Counter(t.level for t in _kinds(plan, "trial") if t.condition == condition.name)
        each = study.design.repeats // len(condition.levels)
        expected = Counter(dict.fromkeys(condition.levels, 0))
        for level in condition.levels:
            expected[level] += each
        if levels != expected:
            yield f"{condition.name} must come at each level {each} times", str(dict(levels))


def _blocks(study: Study, plan: Plan) -> Violations:
    blocks = [trial.block for trial in _kinds(plan, "trial", "catch")]
    if blocks != sorted(blocks) or sorted(set(blocks)) != list(range(1, max(blocks) + 1)):
        yield "blocks must be numbered from 1 and follow one another", str(blocks)
    for number, trials in groupby(_kinds(plan, "trial"), key=lambda trial: trial.block):
        names = [trial.condition for trial in trials]
        if len(set(names)) != len(names) and study.design.order != "random":
            yield "a condition must not come twice in a block", f"block {number}: {names}"
    if study.design.order == "fixed" and plan.sequence != study.conditions * study.design.repeats:
        yield "a fixed order must be that of the study file", str(plan.sequence)


def _runs(study: Study, plan: Plan) -> Violations:
    yield from order_violations(study, plan.trials)


def order_violations(study: Study, trials: Sequence[Trial]) -> Violations:
    """Yield (rule, value) where conditions or catch trials follow each other too closely."""
    longest, apart = study.design.max_alike_in_row, study.design.catch_apart
    for name, run in groupby(trial.condition for trial in trials if trial.kind == "trial"):
        if (length := len(list(run))) > longest:
            yield f"a condition must not come more than {longest} x in a row", f"{length} of {name}"
    catches = [place for place, trial in enumerate(trials) if trial.kind == "catch"]
    for place, later in pairwise(catches):
        if later - place - 1 < apart:
            yield (
                f"at least {apart} other trials must separate catch trials",
                f"trials {trials[place].index} and {trials[later].index}",
            )
    for place in catches:
        before, trial = trials[place - 1], trials[place]
        if before.kind == "practice" or before.block != trial.block:
            yield "a catch trial must not open a block", f"trial {trial.index}"
        if _beam_set(study, before.touches) != _beam_set(study, trial.touches):
            yield "a catch trial must need only the mounted beam", f"trial {trial.index}"


def _catches(study: Study, plan: Plan) -> Violations:
    catches = _kinds(plan, "catch")
    if len(catches) != study.design.catch_trials:
        yield f"there must be {study.design.catch_trials} catch trials", str(len(catches))


def _breaks(study: Study, plan: Plan) -> Violations:
    every, wanted_s = study.design.break_every_blocks, study.design.break_s
    block_before = 1
    for trial in plan.trials:
        opens = trial.block > block_before
        due = opens and every > 0 and (trial.block - 1) % every == 0
        if trial.break_s != (wanted_s if due else 0.0):
            yield (
                f"breaks must come every {every} blocks and nowhere else",
                f"{trial.break_s:g} s before trial {trial.index}",
            )
        block_before = max(block_before, trial.block)


def _groups(study: Study, plan: Plan) -> Violations:
    """Check that trials on the same set of beams are grouped as the design requires."""
    asked = study.design.group_by_beam
    main = _kinds(plan, "trial")
    sets = {c.name: _beam_set(study, c.touches) for c in study.condition}
    stretches = [main] if asked == "session" else []
    if asked == "block":
        stretches = [list(some) for _, some in groupby(main, key=lambda trial: trial.block)]
    for stretch in stretches:
        seen = [beams for beams, _ in groupby(sets[trial.condition or ""] for trial in stretch)]
        if len(seen) != len(set(seen)):
            yield f"trials on the same beams must be grouped within each {asked}", str(seen)


def _beam_set(study: Study, touches: Sequence[Touch]) -> tuple[str | None, ...]:
    beams = [touch.beam or study.touch.beam for touch in touches]
    return tuple(beam for beam, _ in groupby(beams))
