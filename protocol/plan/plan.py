"""The plan of a session: opening, practice, and scored trials in the slot's order with catches."""

from collections.abc import Callable, Iterator
from dataclasses import replace

from protocol.plan.blocks import ordered_conditions, practice_pool
from protocol.plan.randomisation import Name, Stream, spaced_places
from protocol.plan.trials import Plan, Trial, beams_of
from protocol.plan.variants import at_level, opposite, opposite_expected
from protocol.study.questions import no_change
from protocol.study.study import Condition, Opening, Study


def level_draws(study: Study, name: Name) -> list[list[float]]:
    """Return for each condition one level per repeat, in random order and all equally often."""
    return [
        Stream(*name, number).shuffled(
            condition.levels * (study.design.repeats // len(condition.levels))
        )
        for number, condition in enumerate(study.condition)
    ]


def opposite_draws(study: Study, name: Name) -> list[list[bool]]:
    """Return for each condition which of its repeats run in the opposite order."""
    repeats, asked = study.design.repeats, study.design.opposite_repeats
    turned = [asked if opposite_expected(condition) else 0 for condition in study.condition]
    return [
        Stream(*name, number).shuffled([True] * some + [False] * (repeats - some))
        for number, some in enumerate(turned)
    ]


def catch_places(study: Study, order: list[int], name: Name) -> dict[int, int]:
    """Return the condition of each catch trial by the number of scored trials before it.

    A catch trial follows a trial that needs only one beam and takes a condition on that beam, so
    that it needs no beam swap. It never opens a block.
    """
    if not study.design.catch_trials:
        return {}
    beams = [beams_of(condition.touches, study.touch.beam) for condition in study.condition]
    allowed = [place for place, number in enumerate(order, start=1) if len(beams[number]) == 1]
    stream = Stream(*name)
    places = spaced_places(allowed, study.design.catch_trials, study.design.catch_apart, stream)
    return {
        place: stream.one_of(
            [number for number, needed in enumerate(beams) if needed == beams[order[place - 1]]]
        )
        for place in places
    }


def plan(study: Study, slot: int, session: int = 1) -> Plan:
    """Return the plan for a `slot`, counted from 0 over the cohort, and a `session`, from 1.

    The study's seed determines the plan: orders (see `protocol.plan.counterbalancing`), levels,
    opposite, catch and practice trials are each drawn from a random stream of their own.

    Raises:
        ValueError: the design's constraints cannot be met (`protocol.study_file.limits` reports
            this beforehand).
    """

    def stream_name(purpose: str) -> Name:
        return (study.study.seed, purpose, session, slot)

    order = ordered_conditions(study, slot, session)
    practice = _practice(study, stream_name("practice"))
    trials = [*map(_opening_trial, study.opening), *practice, *_main(study, order, stream_name)]
    return Plan(
        slot=slot,
        session=session,
        sequence=tuple(study.conditions[number] for _, number in order),
        trials=tuple(replace(trial, index=index) for index, trial in enumerate(trials)),
    )


def _opening_trial(item: Opening) -> Trial:
    return Trial(
        index=0,
        block=0,
        kind=item.kind,
        condition=None,
        question=item.question,
        expected=item.expected,
        scored=False,
        touches=item.touches,
    )


def _practice(study: Study, name: Name) -> Iterator[Trial]:
    """Yield trials of the conditions to practise: all in random order, again and again."""
    pool, wanted, stream = practice_pool(study), study.design.practice_trials, Stream(*name)
    drawn: list[int] = []
    while len(drawn) < wanted:
        drawn += stream.shuffled(pool)
    for number in drawn[:wanted]:
        condition = study.condition[number]
        yield replace(_trial(condition, condition.levels[-1], turned=False), kind="practice")


def _main(
    study: Study, order: list[tuple[int, int]], stream_name: Callable[[str], Name]
) -> Iterator[Trial]:
    """Yield the scored trials block by block, with catch trials after some of them."""
    levels = level_draws(study, stream_name("levels"))
    turned = opposite_draws(study, stream_name("opposite"))
    catches = catch_places(study, [number for _, number in order], stream_name("catch"))
    every, block_before = study.design.break_every_blocks, 1
    for place, (block, number) in enumerate(order, start=1):
        pauses = every > 0 and block != block_before and (block - 1) % every == 0
        yield _trial(
            study.condition[number],
            levels[number].pop(),
            turned=turned[number].pop(),
            block=block,
            break_s=study.design.break_s if pauses else 0.0,
        )
        if place in catches:
            condition = study.condition[catches[place]]
            still = _trial(condition, 0.0, turned=False, block=block)
            same = no_change(condition.question)
            yield replace(still, kind="catch", expected=same, scored=False)
        block_before = block


def _trial(
    condition: Condition, level: float, *, turned: bool, block: int = 0, break_s: float = 0.0
) -> Trial:
    touches = at_level(condition.touches, level)
    return Trial(
        index=0,
        block=block,
        kind="trial",
        condition=condition.name,
        question=condition.question,
        expected=opposite_expected(condition) if turned else condition.expected,
        scored=True,
        touches=opposite(touches) if turned else touches,
        level=level,
        opposite=turned,
        break_s=break_s,
    )
