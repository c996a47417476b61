"""Limits of the rig that a study breaks, at the nominal resonance or at a measured one."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import permutations
from math import ceil, inf
from types import MappingProxyType

from protocol.address import SIMULATED
from protocol.errors import Path, Problem, listed
from protocol.plan.feasibility import design_problems
from protocol.plan.orders import scaled
from protocol.plan.plan import slide_plan, slide_study
from protocol.plan.trials import session_s
from protocol.study.factor import CONDITION, MOST_CONDITIONS, Factor, Group, combinations
from protocol.study.study import Condition, Item, Study
from protocol.study.study_question import StudyQuestion
from protocol.study.touch import SlidePass, Touch, current_ma, driven_s, slew_v_per_us, touch_s
from protocol.study.track import AXIS_KEY, Track, TrackTouch
from protocol.study_file.text_checks import (
    instruction_problem,
    page_problems,
    question_problems,
    surface_problems,
    text_problems,
    unanswerable,
)
from protocol.study_file.toml import unit_hint

# Consistency of a study's names, of its opening trials and of its practice.


def _name_problems(study: Study) -> Iterator[Problem]:
    """Yield every name that is blank, like another one, or that of what reports have anyway."""
    numbered: dict[str, Sequence[Factor | Group | Track]] = {
        "factor": study.factor,
        "group": study.group,
        "track": study.track,
    }
    named: dict[str, list[tuple[Path, str]]] = {
        "study": [(("study", "name"), study.study.name)],
        "condition": [(("condition", it.written, "name"), it.name) for it in study.condition],
        "beams": [(("beams", name), name) for name in study.beams],
    }
    for kind, items in numbered.items():
        named[kind] = [((kind, number, "name"), it.name) for number, it in enumerate(items)]
    for where, names in named.items():
        for path, name in names:
            if not any(character.isprintable() and character != " " for character in name):
                rule, hint = "a name must not be blank", "give it one that can be read in a table"
                yield Problem(where, rule, repr(name), hint, path)
        yield from _alike(where, names)
    own = [CONDITION, *(factor.name.strip().casefold() for factor in study.factor)]
    # Interactions stand in tables as "A by B".
    taken = {CONDITION, "session", "group", *(f"{a} by {b}" for a, b in permutations(own, 2))}
    for path, name in named["factor"]:
        if name.strip().casefold() in taken:
            rule = "a factor must not have the name of what reports have anyway"
            yield Problem("factor", rule, repr(name), "rename it", path)


def _alike(where: str, named: Sequence[tuple[Path, str]]) -> Iterator[Problem]:
    # By their places, because conditions that factors make stand at one path of the file.
    seen: dict[str, tuple[int, str]] = {}
    for number, (path, name) in enumerate(named):
        # People and spreadsheets take such names for one.
        remembered = " ".join(name.casefold().split())
        before, first = seen.setdefault(remembered, (number, name))
        if before != number:
            same = first == name
            rule = "names must differ" + ("" if same else " by more than case and spaces")
            value = repr(name) if same else f"{name!r} beside {first!r}"
            yield Problem(where, rule, value, "rename one", path)


def _factor_problems(study: Study) -> Iterator[Problem]:
    """Yield factors that set what another one sets, or a touch itself, and too many conditions."""
    for number, factor in enumerate(study.factor):
        if any(_both_set(study, factor, other) for other in study.factor[:number]):
            rule, hint = "must differ from those of the other factors", "cross them into one factor"
            where, path = f"factor {factor.name}, varies", ("factor", number, "varies")
            yield Problem(where, rule, repr(factor.varies), hint, path)
    if study.factor and study.condition and not study.condition[0].cell:
        many = combinations(study.factor) * len(study.condition)
        rule = f"must give at most {MOST_CONDITIONS} conditions"
        yield Problem.of_key("factor", rule, many, "leave a value or a factor out")
    # All that one condition of the file became have the same.
    for condition in {each.written: each for each in study.condition}.values():
        for number, key in condition.given_twice:
            place = ("condition", condition.written, "touches", number, key)
            named = condition.cell.get(CONDITION)
            where = f"condition{f' {named}' * bool(named)}, touch {number + 1}"
            hint = "leave it out here, or the factor"
            yield Problem(where, f"must not give {key}, which a factor sets", "both", hint, place)
        yield from _stated_and_varied(study, condition)


def _stated_and_varied(study: Study, condition: Condition) -> Iterator[Problem]:
    """Yield touches whose friction is stated, although something changes what it depends on."""
    driven = ((at, touch) for at, touch in enumerate(condition.touches) if touch.peak_voltage_v)
    for number, touch in driven if set(condition.levels) != {1.0} else ():
        if touch.friction is not None:
            path = ("condition", condition.written, "touches", number, "friction")
            rule = "must not be stated where levels multiply the amplitude"
            where = f"condition {condition.name}, touch {number + 1}, friction"
            hint = "leave it out, or write a [[condition]] for each level"
            yield Problem(where, rule, f"{touch.friction:g}", hint, path)
    for factor in study.factor:
        for number in factor.numbers(len(condition.touches)):
            if condition.cell and condition.touches[number].friction is not None:
                path = ("condition", condition.written, "touches", number, "friction")
                hint = "leave it out, or write a [[condition]] for each value"
                rule = f"must not be stated where the factor {factor.name} varies {factor.varies}"
                where = f"condition {condition.name}, touch {number + 1}, friction"
                yield Problem(where, rule, f"{condition.touches[number].friction:g}", hint, path)


def _both_set(study: Study, one: Factor, other: Factor) -> bool:
    """Return whether factors set the same: the later one would do so without a word."""
    if one.varies != other.varies:
        return False
    counts = {len(condition.touches) for condition in study.condition}
    shared = any(one.numbers(count) & other.numbers(count) for count in counts)
    return shared or one.touches == other.touches


def _group_problems(study: Study) -> Iterator[Problem]:
    """Yield a group that is alone, and what a participant's group cannot follow from."""
    many, size = len(study.group), sum(group.size for group in study.group)
    if many == 1 or (study.design.assign_groups != "by the operator" and not many):
        yield Problem.of_key("group", "must be 2 or more groups", many, "add a [[group]]")
    if many and study.design.participants != size:
        rule, hint = f"must be {size}, as many as in the groups together", "leave it out"
        yield Problem.of_key("design.participants", rule, study.design.participants, hint)
    desk = {question.name: question for question in study.questions("desk")}
    for number, group in enumerate(study.group):
        where, path = f"group {group.name}, when", ("group", number, "when")
        for rule, value, hint in _leads_nowhere(study, group, desk):
            yield Problem(where, rule, value, hint, path)
        for other in study.group[:number]:
            if shared := _led_by_both(group, other, desk):
                rule = f"must not be met by an answer that leads to {other.name}"
                yield Problem(where, rule, shared, path=path)


def _led_by_both(one: Group, other: Group, desk: Mapping[str, StudyQuestion]) -> str:
    """Return an answer to a question that leads into both groups; empty if there is none."""
    if not one.when or not other.when or one.when.question != other.when.question:
        return ""
    if shared := set(one.when.answers) & set(other.when.answers):
        return repr(min(shared))
    question, rules = desk.get(one.when.question), (one.when, other.when)
    if any(it.at_least is None and it.at_most is None for it in rules):
        return ""
    low = max((it.at_least for it in rules if it.at_least is not None), default=None)
    high = min((it.at_most for it in rules if it.at_most is not None), default=None)
    if question is not None and question.is_number:
        first, last = question.steps_within(low, high)
    else:  # what the operator is asked beside the study's questions
        first, last = (-inf if low is None else low), (inf if high is None else high)
    ends = [f"{end:g}" for end in (low, high) if end is not None]
    return "" if first > last else " to ".join(ends) or "any number"


def _leads_nowhere(
    study: Study, group: Group, desk: Mapping[str, StudyQuestion]
) -> Iterator[tuple[str, str, str]]:
    """Yield why no answer leads into a group, though one should, or the other way round."""
    how = 'design.assign_groups = "by an answer"'
    by_answer, when = study.design.assign_groups == "by an answer", group.when
    if when is None:
        if by_answer:
            yield f"must be given where {how}", "nothing", ""
    elif not by_answer:
        yield f"must not be given unless {how}", repr(when.question), ""
    elif when.question in desk and desk[when.question].asked_if is not None:
        yield "must name a question that is always asked", repr(when.question), "leave asked_if out"
    elif when.question in desk and not desk[when.question].required:
        rule = "must name a question that cannot be skipped"
        yield rule, repr(when.question), "leave required = false out"
    elif when.question in desk:
        yield from unanswerable(when, desk[when.question])
    elif when.question not in study.session.operator_asks:
        known = ", ".join([*study.session.operator_asks, *desk]) or "nothing"
        yield "must name a question of the operator's desk", repr(when.question), f"known: {known}"


def _opening_problems(study: Study) -> Iterator[Problem]:
    """Yield every baseline that is driven, and every signal that never is."""
    for number, opening in enumerate(study.opening):
        path = ("opening", number, "touches")
        driven = [(at, it) for at, it in enumerate(opening.touches) if it.peak_voltage_v > 0]
        if opening.kind == "signal" and not driven:
            rule = "a signal must be driven in at least one touch"
            hint = 'give its touches a voltage_v, or write kind = "baseline"'
            yield Problem("opening signal", rule, "0 V throughout", hint, path)
        for place, touch in driven if opening.kind == "baseline" else ():
            where, value = f"opening baseline, touch {place + 1}", f"{touch.peak_voltage_v:g} V"
            rule, hint = (
                "a baseline must be without a signal",
                'write voltage_v = 0, or kind = "signal"',
            )
            key = "voltage_v" if touch.voltage_v else "ramp_to_v"
            yield Problem(where, rule, value, hint, (*path, place, key))


def _key_problems(study: Study) -> Iterator[Problem]:
    """Yield keys that another key of the study, or a beam that a touch names, asks to be other."""
    rig, channel, wanted = study.rig, study.force_channel, study.as_instructed.practise_until
    told, touches = Problem.of_key, (it for _, _, item in _items(study) for it in item.touches)
    if wanted and not study.design.practice_trials:
        rule = f"must be above 0 where as_instructed.practise_until = {wanted}"
        hint = "give practice_trials, or leave practise_until out"
        yield told("design.practice_trials", rule, 0, hint)
    if study.touch.beam is None and any(touch.beam for touch in touches):
        hint = f"one of {listed(study.beams)}" if study.beams else "name the beams in [beams]"
        yield told("touch.beam", "must be given when a touch names a beam", "nothing", hint)
    # A generator is set in volts before the amplifier: without its gain nothing is driven.
    if rig.dialect != "board" and rig.amplifier_gain is None:
        rule = f"must be given where rig.dialect = {rig.dialect!r}"
        hint = "volts at the beam per volt of the generator"
        yield told("rig.amplifier_gain", rule, "nothing", hint)
    if channel.rate_hz is not None and rig.dialect != "board" and channel.gauge is None:
        rule = f"needs a board or a gauge, and rig.dialect = {rig.dialect!r} measures nothing"
        hint = "give the address of a gauge as force_channel.gauge"
        yield told("force_channel.rate_hz", rule, channel.rate_hz, hint)
    yield from _absolute_problems(study)
    # Both may be simulated: a simulated gauge has a line of its own.
    if channel.gauge != SIMULATED and channel.gauge == rig.device:
        rule = "must have a port of its own, other than rig.device"
        hint = "a board that measures forces itself needs no gauge"
        yield told("force_channel.gauge", rule, repr(channel.gauge), hint)
    if channel.rate_hz is not None and channel.gauge == SIMULATED and rig.device != SIMULATED:
        rule, value = "is simulated, and that is for a simulated device only", f"{rig.device!r}"
        hint = "the address of a gauge; run --device sim simulates both"
        yield told("force_channel.gauge", rule, f"rig.device = {value}", hint)


def _absolute_problems(study: Study) -> Iterator[Problem]:
    """Yield conditions without a question beside others, and what only questions give."""
    rated = [condition for condition in study.condition if condition.question is None]
    if rated and not study.absolute:
        # Scores of what was felt and of its change cannot be compared with each other.
        where, path = f"condition {rated[0].name}", ("condition", rated[0].written, "question")
        rule, hint = "must be given, as in other conditions", "or leave it out in all of them"
        yield Problem(f"{where}, question", rule, "nothing", hint, path)
    rule = "must be left out where no condition has a question"
    if study.absolute and study.exclusions.max_false_alarms is not None:
        value, hint = study.exclusions.max_false_alarms, "a score of a catch trial is no alarm"
        yield Problem.of_key("exclusions.max_false_alarms", rule, f"{value:g}", hint)
    if study.absolute and "score_when" in study.rating.model_fields_set:
        when = study.rating.score_when
        yield Problem.of_key("rating.score_when", rule, repr(when), "each trial is scored")


def problems(study: Study, further: Iterable[Problem] = ()) -> list[Problem]:
    """Return everything in `study` that breaks a limit, cannot be met or names nothing there is.

    Whether the design can be met is asked only of a study with nothing else (`further`) wrong.
    """
    broken = [*limit_problems(study), *further]
    return broken or ([] if study.imported else design_problems(study))


_ULTRASONIC_HZ = 1_000


def _in_khz(study: Study) -> Iterator[Problem]:
    """Yield frequencies of the paper's beam that must be in kHz; other surfaces may be slow."""
    if study.surface.length_m is None:
        for key in ("nominal_resonance_hz", "max_frequency_hz"):
            hz, path = getattr(study.rig, key), ("rig", key)
            if hz < _ULTRASONIC_HZ:
                hint = unit_hint(path, hz, too_large=False)
                yield Problem.of_key(path, f"must be at least {_ULTRASONIC_HZ}", f"{hz:g}", hint)


def limit_problems(study: Study) -> list[Problem]:
    """Return everything in `study` that breaks a limit or names nothing there is."""
    if study.imported:  # nothing is driven, asked or read
        return [*_name_problems(study), *_group_problems(study)]
    # Whatever else is said would follow from the wrong unit.
    return list(_in_khz(study)) or _broken_limits(study)


def _broken_limits(study: Study) -> list[Problem]:
    broken = [
        *_name_problems(study),
        *_factor_problems(study),
        *_group_problems(study),
        *_missing_beam(study, "touch.beam", ("touch",), study.touch.beam),
    ]
    of_touches: dict[object, Problem] = {}
    for where, path, item in _items(study):
        # The largest level counts: all others drive less.
        level = max(item.levels) if isinstance(item, Condition) else 1.0
        for number, touch in enumerate(item.touches):
            place = (f"{where}, touch {number + 1}", (*path, "touches", number))
            for problem in _touch_problems(study, *place, touch, level):
                told = _of_factor(study, item, problem)
                # What many cells share is told once.
                of_touches.setdefault((told.path, told.rule, told.value), told)
    broken += of_touches.values()
    if not study.condition and not study.track:
        hint = "such as those of touchbeam new DIR --template paper, or --template threshold"
        # Of no key, so that it is not said of a study whose tracks cannot be read.
        broken.append(Problem("condition", "must be given, or a [[track]]", "neither", hint))
    if study.track:  # most studies have none, and should not wait for what checks them
        from protocol.study_file.tracks import track_problems

        broken += track_problems(study)
    for number, track in enumerate(study.track):
        # Those on the axis of contrast have their voltages only once a model is at hand.
        inner = () if track.axis == "contrast" else map(track.at, range(len(track.values)))
        broken += level_problems(study, number, inner)
    if "slide" in study.model_fields_set:  # a study that says nothing of it need not allow it
        broken += slide_problems(study)
    broken += [*_opening_problems(study), *_key_problems(study)]
    broken += surface_problems(study)
    return [*broken, *text_problems(study), *question_problems(study), *page_problems(study)]


def level_problems(study: Study, number: int, touches: Iterable[Touch]) -> Iterator[Problem]:
    """Yield each limit of the rig that a track's standard or its `touches`, one a level, break."""
    track, path = study.track[number], ("track", number)
    key, told = AXIS_KEY[track.axis], set[tuple[str, Path]]()
    standard = () if track.standard is None else (("standard", track.standard),)
    # From the easiest level, which drives most, so that it is the one that is told.
    levels = (("comparison", touch) for touch in reversed([*touches]))
    for name, touch in (*standard, *levels):
        where = f"track {track.name}, {name}"
        start_s = touch.voltage_v / study.rig.ramp_v_per_s
        too_long = touch.voltage_v > study.touch.lead_in_s * study.rig.ramp_v_per_s
        if too_long and ("soft start", path) not in told:
            told.add(("soft start", path))
            rule = "its soft start must end within touch.lead_in_s, or its length would tell"
            hint = f"set touch.lead_in_s to {ceil(start_s)}"
            yield Problem(where, rule, f"{start_s:.3g} s", hint, (*path, name))
        for problem in _touch_problems(study, where, (*path, name), touch, 1):
            own = name == "comparison" and problem.path[-1] == key
            place = (*path, "levels") if own else problem.path
            if (problem.rule, place) not in told:
                told.add((problem.rule, place))
                said = f"track {track.name}, levels" if own else problem.where
                yield replace(problem, where=said, path=place)


def _items(study: Study) -> Iterator[tuple[str, Path, Item]]:
    for number, opening in enumerate(study.opening):
        yield f"opening {opening.kind}", ("opening", number), opening
    for condition in study.condition:
        yield f"condition {condition.name}", ("condition", condition.written), condition


def _of_factor(study: Study, item: Item, problem: Problem) -> Problem:
    """Return a problem of a touch, at the factor that sets the key if one does."""
    crossed = isinstance(item, Condition) and item.cell
    for number, factor in enumerate(study.factor if crossed else ()):
        if factor.varies == problem.path[-1]:
            where = f"factor {factor.name}"
            return replace(problem, where=where, path=("factor", number, "values"))
    return problem


_OF_A_SLIDE = {
    "frequency": ("frequencies", ""),
    "duration_s": ("speeds_m_s", "draw faster or shorten the paths; touch.lead_in_s counts"),
}
"""The keys of a touch in the section on sliding, with a hint where that of a touch is wrong."""


def slide_problems(study: Study) -> list[Problem]:
    """Return every limit of the rig that the sliding experiment of `study` breaks."""
    sliding, path = slide_study(study), ("slide",)
    planned = slide_plan(sliding)
    broken: dict[tuple[str, str], Problem] = {}
    # Equal problems are listed once, under the first pass that has them; one that is driven says
    # most.
    driven_first = sorted(planned.trials, key=lambda trial: -trial.touches[0].voltage_v)
    for trial in driven_first:
        made = f"slide, {trial.condition}"
        for problem in _touch_problems(sliding, made, path, trial.touches[0], 1.0):
            key, hint = _OF_A_SLIDE.get(str(problem.path[-1]), (problem.path[-1], ""))
            known = replace(problem, path=(*path, key), hint=hint or problem.hint)
            broken.setdefault((problem.rule, problem.value), known)
    # Sliding always records: a study that does not is told here that its rig cannot.
    recorded = () if study.force_channel.rate_hz else _key_problems(sliding)
    found = [problem for problem in recorded if problem.path[0] == "force_channel"]
    found += [*_missing_beam(study, "slide", path, study.slide.beam), *broken.values()]
    limit_s, lasts_s = sliding.timing.max_session_s, session_s(sliding, planned)
    if lasts_s > limit_s:
        rule = f"a session must not take more than timing.max_session_s = {limit_s:.15g} s"
        value, hint = _above(lasts_s, limit_s), "ask for fewer drives, repeats or references"
        found.append(Problem("slide", rule, f"{value} s", hint, ("slide", "repeats")))
    return found


def _touch_problems(
    study: Study, where: str, path: Path, touch: Touch, level: float
) -> Iterator[Problem]:
    """Yield what a touch asks for, its amplitudes times `level`, that it must not."""
    # A drive that is given both ways would obey one of them without a word.
    for key in ("frequency", "sweep_to"):
        if {key, f"{key}_hz"} <= touch.model_fields_set and not isinstance(touch, SlidePass):
            rule = f"must not be given beside {key}_hz"
            hint = f"{key} is relative to the resonance, {key}_hz is fixed: leave one out"
            yield Problem(where, rule, "both", hint, (*path, key))
    touch = touch.at(study.rig.nominal_resonance_hz)
    for rule, value, hint, key in (*_finger(study, touch), *_driven(study, touch, level)):
        yield Problem(where, rule, value, hint, (*path, key))
    yield from _missing_beam(study, where, path, touch.beam)
    if textless := instruction_problem(study, where, path, touch):
        yield textless


_Broken = tuple[str, str, str, str]
"""Rule, value, hint, and the key to mend."""
MAX_FORCE_N = 20.0
"""A finger that carries 2 kg: more than anybody is to press on a beam that is driven."""


def _finger(study: Study, touch: Touch) -> Iterator[_Broken]:
    force_n = touch.press * study.touch.force_n
    if force_n > MAX_FORCE_N:
        rule = f"press x touch.force_n must not exceed {MAX_FORCE_N:g} N"
        yield rule, f"{_above(force_n, MAX_FORCE_N)} N", unit_hint(("press",)), "press"
    if touch.sliding_speed_m_s is not None:
        value = f"{touch.sliding_speed_m_s:g} m/s"
        if touch.place != "path":
            rule, hint = 'is for place = "path"', "leave it out: this finger rests"
            yield rule, value, hint, "sliding_speed_m_s"
        elif touch.duration_s is not None:
            hint = "each follows from the other and the path: leave one out"
            yield "must not be given beside duration_s", value, hint, "sliding_speed_m_s"

    if touch.friction is not None and study.surface.kind != "given":
        hint = "leave it out: the friction of this surface is predicted or measured"
        yield 'is for [surface] kind = "given"', f"{touch.friction:g}", hint, "friction"
    elif touch.friction is not None and isinstance(touch, TrackTouch):
        hint = "leave it out: one number cannot say what friction each level has"
        yield "is for a touch of a condition", f"{touch.friction:g}", hint, "friction"
    elif touch.friction is not None and touch.programme != "hold":
        hint = "leave it out: one number cannot say how friction changes"
        yield "is for a touch with one drive", f"{touch.friction:g}", hint, "friction"


_LOWER = "lower the amplitude or the frequency"
_LIMITS = {
    "max_voltage_v": (
        *("the amplitude must not exceed", "V", 6),
        "amplitudes are peak, not peak-to-peak: {0} V peak-to-peak is {1:g} V",
    ),
    "max_frequency_hz": (
        *("the drive must not exceed", "Hz", 6),
        "frequency is relative to the resonance: 1.0 drives the beam there",
    ),
    "max_slew_v_per_us": ("2 pi f V must not exceed", "V/us", 4, _LOWER),
    "generator_max_vpp": (
        *("2 x amplitude / amplifier_gain must not exceed", "V peak-to-peak", 6),
        "the generator gives half of its peak-to-peak value as amplitude",
    ),
    "max_current_ma": ("2 pi f C V must not exceed", "mA", 4, _LOWER),
    "ramp_v_per_s": (
        *("a ramp must not be steeper than", "V/s", 4),
        "let the touch last longer: duration_s",
    ),
    "max_drive_s": (
        *("a touch must not be driven longer than", "s", 4),
        "shorten duration_s or touch.lead_in_s, which counts",
    ),
}
"""Rule, unit, digits and hint by the key of the rig; a hint may name the value, and half of it."""


def _driven(study: Study, touch: Touch, level: float) -> Iterator[_Broken]:
    """Yield each limit of the rig that a touch breaks, whose amplitudes are multiplied."""
    for name, value, key in _quantities(study, touch, level):
        limit: float | None = getattr(study.rig, name)
        if limit is not None and value > limit:
            rule, unit, digits, hint = _LIMITS[name]
            shown = _above(value, limit, digits)
            told = f"{rule} rig.{name} = {limit:.15g} {unit}"
            yield told, f"{shown} {unit.split()[0]}", hint.format(shown, value / 2), key


def _quantities(study: Study, touch: Touch, level: float) -> Iterator[tuple[str, float, str]]:
    """Yield the limit, the value and the key to mend of each quantity that the rig limits."""
    rig, peak_v = study.rig, touch.peak_voltage_v * level
    frequency_hz = touch.peak_frequency * rig.nominal_resonance_hz
    # The key that holds the larger value is the one to mend.
    higher = "sweep_to" if touch.end_frequency > touch.frequency else "frequency"
    fixed = "" if getattr(touch, f"{higher}_hz") is None else "_hz"
    larger = "ramp_to_v" if touch.end_voltage_v > touch.voltage_v else "voltage_v"
    yield "max_voltage_v", peak_v, larger
    yield "max_frequency_hz", frequency_hz, higher + fixed
    yield "max_slew_v_per_us", slew_v_per_us(peak_v, frequency_hz), "voltage_v"
    if rig.amplifier_gain:
        yield "generator_max_vpp", 2 * peak_v / rig.amplifier_gain, "voltage_v"
    if rig.capacitance_nf:
        yield "max_current_ma", current_ma(peak_v, frequency_hz, rig.capacitance_nf), "voltage_v"
    change_v = abs(touch.end_voltage_v - touch.voltage_v) * level
    yield "ramp_v_per_s", change_v / touch_s(touch, study.touch), "ramp_to_v"
    yield "max_drive_s", driven_s(scaled(touch, level), study.touch, rig), "duration_s"


def _above(value: float, limit: float, digits: int = 6) -> str:
    """`value`, which is above `limit`, with as many digits as show it."""
    # A value just above its limit must not be shown as the limit.
    shown = (f"{value:.{many}g}" for many in range(digits, 17))
    return next((text for text in shown if float(text) > limit), repr(value))


def _missing_beam(study: Study, where: str, path: Path, beam: str | None) -> Iterator[Problem]:
    if beam is not None and beam not in study.beams:
        none = "name it in [beams] with the spacing of its ciliary bodies in m, or leave it out"
        rule, known = "the beam must be one of [beams]", listed(study.beams)
        hint = f"known: {known}" if known else none
        yield Problem(where, rule, repr(beam), hint, (*path, "beam"))


def problems_at(
    study: Study,
    resonance_hz: float,
    *,
    sliding: bool = False,
    volts: Mapping[str, Sequence[float]] = MappingProxyType({}),
) -> list[Problem]:
    """Return what `study` may not ask of a rig whose beam has its resonance there, in Hz.

    What counts is what its participants touch, or with `sliding` its sliding experiment. `volts`
    are those of the levels of tracks on the axis of contrast, by track.
    """
    rig = study.rig.model_copy(update={"nominal_resonance_hz": resonance_hz})
    there = study.model_copy(update={"rig": rig})
    if sliding:
        return slide_problems(there)
    # A session does not slide: a block that may not be drawn at this resonance does not keep people
    # from touching.
    found = [problem for problem in limit_problems(there) if problem.path[:1] != ("slide",)]
    for number, track in enumerate(study.track):
        levels = enumerate(volts.get(track.name, ()))
        found += level_problems(there, number, (track.at(level, v) for level, v in levels))
    return found


def max_resonance_hz(study: Study, touches: Iterable[Touch]) -> float:
    """Return the highest resonance at which `touches` keep all limits of the rig, Hz."""
    return min((_highest_hz(study, touch) for touch in touches), default=inf)


def _highest_hz(study: Study, touch: Touch) -> float:
    """Drive, slew and current are all proportional to the resonance, but for a drive in Hz."""
    ends = (touch.frequency, touch.frequency_hz), (touch.sweep_to or 0.0, touch.sweep_to_hz)
    relative = max((frequency for frequency, hz in ends if hz is None), default=0.0)
    if not relative:
        return inf
    rig = study.rig
    slew = slew_v_per_us(touch.peak_voltage_v, relative)
    limits = [rig.max_frequency_hz / relative]
    if slew > 0:
        limits.append(rig.max_slew_v_per_us / slew)
        # Without a capacitance no current is known, so that its limit cannot be reached.
        if rig.max_current_ma is not None and rig.capacitance_nf:
            limits.append(rig.max_current_ma / (slew * rig.capacitance_nf))
    return min(limits)
