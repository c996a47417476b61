"""Feasibility of a design: constraints that cannot be met in every order that may be drawn.

The checks count instead of trying orders: a constraint is refused if a single order could break it.
"""

from collections.abc import Iterator

from protocol.errors import Problem
from protocol.plan import orders
from protocol.plan.track_trials import track_trials
from protocol.plan.trials import beams_of, between_trials_s, touches_s, trial_s
from protocol.study.study import Study
from protocol.study.study_question import QUESTIONS
from protocol.study.touch import Touch


def design_problems(study: Study) -> list[Problem]:
    """Return every constraint that cannot be met; if the list is empty, every slot has a plan."""
    problems = [*_levels(study), *_opposites(study), *_groups(study)]
    problems += _catches(study) if study.condition else _no_conditions(study)
    problems += _min_trials(study)
    # Asked only now: their search grows as 2 to the power of the groups, which `_groups` limits.
    return problems or [*_swaps(study), *_runs(study), *_duration(study)]


def _levels(study: Study) -> Iterator[Problem]:
    for condition in study.condition:
        if study.design.repeats % len(condition.levels):
            where, path = f"condition {condition.name}, levels", ("condition", condition.written)
            rule = f"their number must divide design.repeats = {study.design.repeats}"
            value, hint = str(len(condition.levels)), "each level then comes equally often"
            yield Problem(where, rule, value, hint, (*path, "levels"))


def _opposites(study: Study) -> Iterator[Problem]:
    asked = study.design.opposite_repeats
    asked_both_ways = [question for question, entry in QUESTIONS.items() if entry.less]
    if asked and not any(map(orders.opposite_expected, study.condition)):
        rule, about = "must be 0 if no condition has an opposite", " or ".join(asked_both_ways)
        hint = f"an opposite needs a question about {about} and touches that differ"
        yield Problem.of_key("design.opposite_repeats", rule, asked, hint)


def _catches(study: Study) -> Iterator[Problem]:
    design, most = study.design, _most_catches(study)
    if design.catch_trials > most:
        sure = "" if design.order == "fixed" else ", in every order that may be drawn"
        apart = f"so that catch trials stay catch_apart = {design.catch_apart} trials apart"
        rule = f"must be at most {most}, {apart} and follow a trial on one beam{sure}"
        hint = "use fewer catch trials or a smaller catch_apart"
        yield Problem.of_key("design.catch_trials", rule, design.catch_trials, hint)


def _most_catches(study: Study) -> int:
    """Return the most catch trials that stay `catch_apart` trials apart in every possible order.

    A catch trial follows a trial on one beam. Unless the order is fixed, all such trials may come
    one after the other, which leaves the fewest places.
    """
    design = study.design
    on_one = [len(beams_of(each.touches, study.touch.beam)) == 1 for each in study.condition]
    if design.order != "fixed":
        places = design.repeats * sum(on_one)
        return (places - 1) // design.catch_apart + 1 if places else 0
    most, last = 0, -design.catch_apart
    for place, allowed in enumerate(on_one * design.repeats):
        if allowed and place - last >= design.catch_apart:
            most, last = most + 1, place
    return most


def _min_trials(study: Study) -> Iterator[Problem]:
    design, fewest = study.design, study.exclusions.min_trials
    planned = design.repeats * len(study.condition) * design.sessions
    if fewest is not None and fewest > planned:
        rule = f"must be at most {planned}, the number of trials of a participant"
        hint = "a larger number excludes every participant"
        yield Problem.of_key("exclusions.min_trials", rule, fewest, hint)


def _groups(study: Study) -> Iterator[Problem]:
    design, number = study.design, len(orders.beam_groups(study))
    if design.group_by_beam != "no" and design.order == "fixed" and number > 1:
        rule, hint = "must be 'no' if order = 'fixed'", "list the conditions in the order you want"
        yield Problem.of_key("design.group_by_beam", rule, repr(design.group_by_beam), hint)
    if number > orders.MAX_GROUPS and (
        design.group_by_beam != "no" or design.max_beam_swaps is not None
    ):
        rule = f"at most {orders.MAX_GROUPS} sets of beams can be grouped"
        yield Problem.of_key("design.group_by_beam", rule, number)


def _swaps(study: Study) -> Iterator[Problem]:
    design = study.design
    if design.max_beam_swaps is None:
        return
    level = orders.grouping(study)
    needed = orders.most_swaps(study, level)
    if needed > design.max_beam_swaps:
        rule = f"a session may need {needed} beam swaps, grouped by beam: {level}"
        hint = "allow more swaps, use fewer repeats, or use fewer beams in a trial"
        yield Problem.of_key("design.max_beam_swaps", rule, design.max_beam_swaps, hint)


def _runs(study: Study) -> Iterator[Problem]:
    design = study.design
    if not study.condition:
        return
    level = orders.grouping(study)
    sizes = [len(study.condition)]
    if level != "no":
        sizes = [len(group.members) for group in orders.beam_groups(study)]
    if min(sizes) > 1 or design.repeats == 1:
        return
    # Alone in its group, a condition ends one block and may begin the next.
    at_most = 2 if level == "block" and len(sizes) > 1 else design.repeats
    if at_most > design.max_alike_in_row:
        alone = "the only condition" if level == "no" else "a condition alone on its beams"
        rule = f"{alone} comes up to {at_most} times in a row (grouped by beam: {level})"
        hint = "raise max_alike_in_row, group by beam less, or use fewer repeats"
        yield Problem.of_key("design.max_alike_in_row", rule, design.max_alike_in_row, hint)


def _duration(study: Study) -> Iterator[Problem]:
    longest_s, limit_s = most_session_s(study), study.timing.max_session_s
    if longest_s > limit_s:
        rule = f"a session may take {longest_s:.0f} s"
        hint = "allow more time, use fewer repeats, or split the study into more sessions"
        yield Problem.of_key("timing.max_session_s", rule, f"{limit_s:g} s", hint)


def most_session_s(study: Study) -> float:
    """Return an upper bound, s, on the duration of every plan of the study."""
    design = study.design
    trials_s = [
        _touched_s(study, orders.at_level(condition.touches, max(condition.levels)))
        + study.timing.answer_s * (condition.question is not None)
        + study.timing.score_s
        + study.timing.answer_s * len(study.questions_after(condition.name))
        for condition in study.condition
    ]
    opening_s = sum(
        _touched_s(study, opening.touches) + study.timing.answer_s for opening in study.opening
    )
    # An upper bound for every slot: each extra trial is taken for the longest one.
    extra_s = (design.practice_trials + design.catch_trials) * max(trials_s, default=0.0)
    # Every order of tracks takes as long.
    tracks = track_trials(study, 1, (study.study.seed,))
    tracks_s = sum(trial_s(study, trial) - trial.break_s for trial in tracks)
    # Grouped over the session, each group has blocks of its own.
    many = design.repeats * (
        len(orders.beam_groups(study)) if orders.grouping(study) == "session" else 1
    )
    many = many * bool(study.condition) + -(-len(tracks) // design.track_block)
    breaks = (many - 1) // design.break_every_blocks if design.break_every_blocks else 0
    swaps_s = orders.most_swaps(study, orders.grouping(study)) * study.timing.beam_swap_s
    once_s = breaks * design.break_s + swaps_s + between_trials_s(study, 1, many)
    return opening_s + extra_s + design.repeats * sum(trials_s) + tracks_s + once_s


def _no_conditions(study: Study) -> Iterator[Problem]:
    for key in ("practice_trials", "catch_trials"):
        if wanted := getattr(study.design, key):
            hint = "a track has `catch` trials of its own" if key == "catch_trials" else ""
            yield Problem.of_key(f"design.{key}", "needs a [[condition]]", wanted, hint)


def _touched_s(study: Study, touches: tuple[Touch, ...]) -> float:
    return study.timing.inter_trial_s + touches_s(study, touches)
