"""Checks of a plan and its trials against the study, independent of the code that drew it.

Each check states one requirement of the study file anew, without regard to how a plan is drawn.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, groupby, pairwise
from math import isclose, pi

from protocol.errors import Problem
from protocol.plan.trials import Plan, Trial, plan_swaps
from protocol.proof.track_checks import Violations, level_touches, track_violations
from protocol.study.rig_settings import TARE_S
from protocol.study.study import Condition, Study
from protocol.study.study_question import QUESTIONS
from protocol.study.touch import Touch

# A study may ask for exactly its limit, and this code multiplies in another order than the planner.
_ROUNDING = 1 + 1e-12


def limit_violations(study: Study, plan: Plan) -> Violations:
    """Yield (rule, value) for every limit that the plan exceeds."""
    planned = ((f"trial {each.index}", touch) for each in plan.trials for touch in each.touches)
    for place, touch in (*planned, *level_touches(study)):
        for rule, value, limit in _measures(study, touch):
            if value > limit * _ROUNDING:
                yield f"{rule} must not exceed {limit:.12g}", f"{value:.12g} in {place}"
    yield from _beams(study, plan)
    duration_s, limit_s = plan_s(study, plan), study.timing.max_session_s
    if duration_s > limit_s * _ROUNDING:
        yield f"a session must not take more than {limit_s:g} s", f"{duration_s:.0f} s"


def _measures(study: Study, touch: Touch) -> Iterator[tuple[str, float, float]]:
    """Yield (quantity, value, limit) for each limited quantity of a touch."""
    rig = study.rig
    # Not `peak_voltage_v`, which the planner uses: a mistake in it must not hide here, too.
    volts = max(touch.voltage_v, touch.end_voltage_v)
    ends = (touch.frequency, touch.frequency_hz), (touch.sweep_to or 0.0, touch.sweep_to_hz)
    hertz = max(hz or relative * rig.nominal_resonance_hz for relative, hz in ends)
    seconds = _touch_s(study, touch)
    before_s = max(study.touch.lead_in_s, touch.voltage_v / rig.ramp_v_per_s)
    yield "amplitude, V,", volts, rig.max_voltage_v
    yield "frequency, Hz,", hertz, rig.max_frequency_hz
    yield "slew, V/us,", 2e-6 * pi * hertz * volts, rig.max_slew_v_per_us
    yield "ramp, V/s,", abs(touch.end_voltage_v - touch.voltage_v) / seconds, rig.ramp_v_per_s
    # The lead-in counts, because the first drive is on during it.
    yield "drive, s,", before_s + seconds if volts else 0.0, rig.max_drive_s
    if rig.amplifier_gain is not None:
        yield "generator, V peak-to-peak,", 2 * volts / rig.amplifier_gain, rig.generator_max_vpp
    if rig.capacitance_nf is not None and rig.max_current_ma is not None:
        milliamperes = 2e-6 * pi * hertz * volts * rig.capacitance_nf
        yield "current, mA,", milliamperes, rig.max_current_ma


def _touch_s(study: Study, touch: Touch) -> float:
    left_m, right_m = study.touch.path_m
    slide_s = (right_m - left_m) / (touch.sliding_speed_m_s or study.touch.sliding_speed_m_s)
    return touch.duration_s or (slide_s if touch.place == "path" else study.touch.hold_s)


def _mounted(study: Study, plan: Plan) -> list[str | None]:
    needed = [touch.beam or study.touch.beam for trial in plan.trials for touch in trial.touches]
    return [study.touch.beam, *needed]


def _beams(study: Study, plan: Plan) -> Violations:
    mounted = _mounted(study, plan)
    for beam in sorted({beam for beam in mounted if beam is not None} - set(study.beams)):
        yield "a beam must be one of the study's", repr(beam)
    swaps = sum(before != after for before, after in pairwise(mounted))
    if study.design.max_beam_swaps is not None and swaps > study.design.max_beam_swaps:
        yield f"at most {study.design.max_beam_swaps} beam swaps are allowed", str(swaps)


def plan_s(study: Study, plan: Plan) -> float:
    """Return the duration of the plan, s, computed here independently of `protocol.plan`."""
    timing, rig = study.timing, study.rig
    # The rig has the study's own beam at first, so that another one at the beginning is a swap.
    mounted = _mounted(study, plan)
    total_s = timing.beam_swap_s * sum(a != b for a, b in pairwise(mounted))
    blocks = len({trial.block for trial in plan.trials} - {0})
    # Questions after trials are counted with the trials below.
    times = {"before": 1, "after": 1, "block": blocks}
    total_s += timing.reading_s if study.design.practice_trials else 0.0
    for page in study.page:
        every_block = blocks if page.block is None else page.block <= blocks
        total_s += timing.reading_s * (every_block if page.before == "block" else 1)
    for question in study.question:
        if question.sessions == "every" or plan.session == 1:
            total_s += timing.answer_s * times.get(question.when, 0)
    for trial in plan.trials:
        after = [question for question in study.question if question.when == "trial"]
        asked = [q for q in after if not q.conditions or trial.condition in q.conditions]
        total_s += timing.answer_s * len(asked) * (trial.condition is not None)
        total_s += trial.break_s + timing.inter_trial_s
        total_s += timing.answer_s * (trial.question is not None or trial.kind == "track")
        rated = trial.kind == "catch" and trial.question is None
        total_s += timing.score_s * (trial.scored or rated)
        named = trial.track.name if trial.track else None
        total_s += 1.0 * any(track.feedback for track in study.track if track.name == named)
        total_s += timing.between_touches_s * (len(trial.touches) - 1)
        total_s += TARE_S * len(trial.touches) * (study.force_channel.rate_hz is not None)
        for touch in trial.touches:
            before_s = max(study.touch.lead_in_s, touch.voltage_v / rig.ramp_v_per_s)
            total_s += timing.reading_s + before_s + _touch_s(study, touch)
    return total_s


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
    wanted: set[str | None]
    if condition.question is None:
        wanted = {None}
    elif trial.kind == "catch":
        wanted = {QUESTIONS[condition.question].same}
    elif trial.opposite:
        asked = QUESTIONS[condition.question]
        wanted = {answer for answer in asked.answers if answer != asked.same}
        wanted -= {condition.expected}
    else:
        wanted = {condition.expected}
    if trial.expected not in wanted:
        yield f"the expected answer must be one of {sorted(map(str, wanted))}"
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
    hertz = (touch.frequency_hz, touch.sweep_to_hz)
    staying = [touch.place, touch.direction, touch.coverage, touch.press, touch.beam]
    staying += [touch.duration_s, touch.sliding_speed_m_s, touch.instruction]
    turned = backwards and touch.sweep_to is not None
    return changing, [*staying, hertz[:: -1 if turned else 1]]


def _alike(one: tuple[list[float], list[object]], other: tuple[list[float], list[object]]) -> bool:
    # Levels are multiplied in, which may round the last bit.
    return one[1] == other[1] and all(
        isclose(a, b, rel_tol=1e-12) for a, b in zip(one[0], other[0], strict=True)
    )


def _opposites(study: Study, plan: Plan) -> Violations:
    turned = Counter(trial.condition for trial in plan.trials if trial.opposite)
    for condition in study.condition:
        asked = QUESTIONS[condition.question] if condition.question else None
        possible = asked and asked.less is not None and condition.expected != asked.same
        there = [_course(touch, 1.0, backwards=False) for touch in condition.touches]
        back = [_course(touch, 1.0, backwards=True) for touch in reversed(condition.touches)]
        wanted = study.design.opposite_repeats if possible and there != back else 0
        if (came := turned[condition.name]) != wanted:
            yield f"{condition.name} must come in the opposite order {wanted} times", str(came)


def plan_problems(study: Study, plan: Plan) -> list[Problem]:
    """Return every requirement of `study` that `plan` violates; an empty list proves the plan."""
    checks = (
        limit_violations,  # what a finger feels comes first
        _numbering,
        _opening,
        _practice,
        _repeats,
        _blocks,
        _order,
        _breaks,
        _groups,
        content_violations,
        track_violations,
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
    if blocks != sorted(blocks) or sorted(set(blocks)) != list(
        range(1, max(blocks, default=0) + 1)
    ):
        yield "blocks must be numbered from 1 and follow one another", str(blocks)
    for number, trials in groupby(_kinds(plan, "trial"), key=lambda trial: trial.block):
        names = [trial.condition for trial in trials]
        if len(set(names)) != len(names) and study.design.order != "random":
            yield "a condition must not come twice in a block", f"block {number}: {names}"
    if study.design.order == "fixed" and plan.sequence != study.conditions * study.design.repeats:
        yield "a fixed order must be that of the study file", str(plan.sequence)


def _order(study: Study, plan: Plan) -> Violations:
    yield from order_violations(study, plan.trials)
    catches = _kinds(plan, "catch")
    if len(catches) != study.design.catch_trials:
        yield f"there must be {study.design.catch_trials} catch trials", str(len(catches))


def order_violations(study: Study, trials: Sequence[Trial]) -> Violations:
    """Yield (rule, value) where conditions or catch trials follow each other too closely."""
    longest, apart = study.design.max_alike_in_row, study.design.catch_apart
    for name, run in groupby(trial.condition for trial in trials if trial.kind == "trial"):
        if (length := len(list(run))) > longest:
            yield f"a condition must not come more than {longest} x in a row", f"{length} of {name}"
    catches = [place for place, trial in enumerate(trials) if trial.kind == "catch"]
    for place, later in pairwise(catches):
        if later - place - 1 < apart:
            rule = f"at least {apart} other trials must separate catch trials"
            yield rule, f"trials {trials[place].index} and {trials[later].index}"
    for place in catches:
        before, trial = trials[place - 1] if place else None, trials[place]
        if before is None or before.kind == "practice" or before.block != trial.block:
            yield "a catch trial must not open a block", f"trial {trial.index}"
        if before and _beam_set(study, before.touches) != _beam_set(study, trial.touches):
            yield "a catch trial must need only the mounted beam", f"trial {trial.index}"


def _breaks(study: Study, plan: Plan) -> Violations:
    every, wanted_s = study.design.break_every_blocks, study.design.break_s
    block_before = 1
    for trial in plan.trials:
        due = trial.block > block_before and every > 0 and (trial.block - 1) % every == 0
        if trial.break_s != (wanted_s if due else 0.0):
            rule = f"breaks must come every {every} blocks and nowhere else"
            yield rule, f"{trial.break_s:g} s before trial {trial.index}"
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
        seen = [beams for beams, _ in groupby(sets.get(trial.condition or "") for trial in stretch)]
        if len(seen) != len(set(seen)):
            yield f"trials on the same beams must be grouped within each {asked}", str(seen)


def _beam_set(study: Study, touches: Sequence[Touch]) -> tuple[str | None, ...]:
    beams = [touch.beam or study.touch.beam for touch in touches]
    return tuple(beam for beam, _ in groupby(beams))


def cohort_problems(study: Study, plans: Sequence[Plan], first: int = 0) -> list[Problem]:
    """Return every requirement that the plans of slots 0, 1, 2 and so on of each group violate.

    The slot that they begin with may also be the `first` of another `cycle`.
    """
    if not plans:
        return [_problem("there must be at least one plan", "none")]
    if len(groups := by_group(plans)) > 1:
        found = (cohort_problems(study, own, first) for own in groups.values())
        return list(chain.from_iterable(found))
    problems = [problem for plan in plans for problem in plan_problems(study, plan)]
    slots = [plan.slot for plan in plans]
    if slots != list(range(first, first + len(plans))):
        problems.append(_problem(f"slots must be numbered from {first}", slots))
    # A cohort of another size cannot be balanced: its carry-over is reported and no fault.
    if balance_guaranteed(study, len(plans)):
        pairs, names = _pairs(plans, within_blocks=True), study.conditions
        counts = {(a, b): pairs[a, b] for a in names for b in names if a != b}
        if len(set(counts.values())) > 1:
            rule = "every condition must follow every other equally often"
            problems.append(_problem(rule, counts))
    return problems


def by_group(plans: Iterable[Plan]) -> dict[str | None, list[Plan]]:
    """Return the plans of each group; all of them under None in a study without groups."""
    groups: dict[str | None, list[Plan]] = {}
    for plan in plans:
        groups.setdefault(plan.group, []).append(plan)
    return groups


def _problem(rule: str, value: object) -> Problem:
    return Problem(where="cohort", rule=rule, value=str(value))


Pairs = Counter[tuple[str | None, str | None]]


def _pairs(plans: Iterable[Plan], *, within_blocks: bool) -> Pairs:
    """Count how often one condition directly follows another, within or across blocks."""
    pairs: Pairs = Counter()
    for plan in plans:
        main = [trial for trial in plan.trials if trial.kind == "trial"]
        pairs.update(
            (before.condition, after.condition)
            for before, after in pairwise(main)
            if (before.block == after.block) == within_blocks
        )
    return pairs


Counts = tuple[tuple[int, ...], ...]


@dataclass(frozen=True, kw_only=True)
class CarryOver:
    """First-order carry-over: `counts[a][b]` is how often condition b directly follows a.

    Scored trials of the same block are counted; catch trials between them are ignored.
    `across_blocks` counts the pairs on both sides of a block's end, which no design balances.
    `guaranteed` says whether the design balances every cohort of this size, or of such groups.
    """

    counts: Counts
    across_blocks: Counts
    guaranteed: bool

    @property
    def balanced(self) -> bool:
        """Whether every condition follows every other one, and equally often."""
        return self.imbalance == 0 and 0 not in self._pairs

    @property
    def imbalance(self) -> int:
        """Largest difference between the counts of two pairs of different conditions."""
        return max(self._pairs, default=0) - min(self._pairs, default=0)

    @property
    def _pairs(self) -> list[int]:
        size = range(len(self.counts))
        return [self.counts[a][b] for a in size for b in size if a != b]


def carry_over(study: Study, plans: Sequence[Plan]) -> CarryOver:
    """Return the carry-over of `plans`, conditions in the order of the file."""
    within, across = (
        tuple(
            tuple(pairs[before, after] for after in study.conditions) for before in study.conditions
        )
        for pairs in (_pairs(plans, within_blocks=True), _pairs(plans, within_blocks=False))
    )
    guaranteed = all(balance_guaranteed(study, len(own)) for own in by_group(plans).values())
    return CarryOver(counts=within, across_blocks=across, guaranteed=guaranteed)


def balance_guaranteed(study: Study, participants: int) -> bool:
    """Return whether the design balances carry-over exactly for a cohort of this size.

    It does in Williams order, without grouping and without a limit on beam swaps, if the cohort is
    a multiple of n (n conditions, n even) or 2n (n odd).
    """
    design = study.design
    free = design.group_by_beam == "no" and design.max_beam_swaps is None
    return design.order == "williams" and free and participants % sequences(study) == 0


def cycle(study: Study, slot: int) -> range:
    """Return the slots over which the design balances carry-over together with `slot`.

    That is `slot` alone where it balances nothing.
    """
    size = sequences(study)
    first = slot // size * size
    return range(first, first + size) if balance_guaranteed(study, size) else range(slot, slot + 1)


def sequences(study: Study) -> int:
    """Return how many sequences a Williams design of the study's conditions has."""
    conditions = max(len(study.condition), 1)
    return conditions if conditions % 2 == 0 or conditions == 1 else 2 * conditions


# Checks of the order in which trials were run, where some came again: the plan's rules anew.


def order_problems(study: Study, plan: Plan, order: Sequence[int]) -> list[Problem]:
    """Return every rule that the trials of a plan break in the `order` of their answers."""
    by_index = {trial.index: trial for trial in plan.trials}
    broken: list[tuple[str, str]] = []
    if twice := [index for index, times in Counter(order).items() if times > 1]:
        broken.append(("every trial must be answered once", f"twice: {twice}"))
    if unknown := [index for index in order if index not in by_index]:
        broken.append(("every trial must be planned", f"not planned: {unknown}"))
    run = [by_index[index] for index in order if index in by_index]
    blocks = [trial.block for trial in run]
    if blocks != sorted(blocks):
        broken.append(("blocks must follow one another", str(blocks)))
    first = [trial.index for trial in run if trial.block == 0]
    if first != sorted(first):
        broken.append(("opening and practice must come as planned", str(first)))
    as_run = replace(plan, trials=tuple(run))
    # Only a whole session: what is left of one may need any number of swaps.
    if len(run) == len(plan.trials) and plan_swaps(study, as_run) > plan_swaps(study, plan):
        rule = f"there must be at most {plan_swaps(study, plan)} beam swaps"
        broken.append((rule, str(plan_swaps(study, as_run))))
    broken += order_violations(study, run)
    return [Problem(where=f"order of slot {plan.slot}", rule=r, value=v) for r, v in broken]
