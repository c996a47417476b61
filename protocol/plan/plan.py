"""The plan of a session: opening, practice, and scored trials in the slot's order with catches."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from protocol.plan.blocks import ordered_conditions, practice_pool
from protocol.plan.randomisation import Name, Stream, spaced_places
from protocol.plan.trials import Plan, Trial, beams_of
from protocol.study.questions import no_change
from protocol.study.study import Condition, Opening, Study
from protocol.study.variants import at_level, opposite, opposite_expected


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
    repeats = study.design.repeats
    drawn = []
    for number, condition in enumerate(study.condition):
        turned = study.design.opposite_repeats if opposite_expected(condition) else 0
        marks = [True] * turned + [False] * (repeats - turned)
        drawn.append(Stream(*name, number).shuffled(marks))
    return drawn


def practised(study: Study, name: Name) -> list[int]:
    """Return the conditions to practise: the whole pool in random order, again and again."""
    pool, wanted = practice_pool(study), study.design.practice_trials
    stream = Stream(*name)
    drawn: list[int] = []
    while len(drawn) < wanted:
        drawn += stream.shuffled(pool)
    return drawn[:wanted]


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


@dataclass(frozen=True, kw_only=True)
class SessionStreams:
    """The names of the random streams of one session."""

    study: Study
    slot: int
    number: int

    def name(self, purpose: str) -> Name:
        """Return the seed and name of the stream for `purpose`."""
        return (self.study.study.seed, purpose, self.number, self.slot)


def plan(study: Study, slot: int, session: int = 1) -> Plan:
    """Return the plan for the participant in `slot`, counted from 0 over the cohort.

    The study's seed determines the plan: orders (see `protocol.plan.counterbalancing`), levels,
    opposite, catch and practice trials are each drawn from a random stream of their own.

    Args:
        study: a checked study.
        slot: the participant's place in the design.
        session: number of the participant's session, from 1.

    Raises:
        ValueError: the design's constraints cannot be met (`protocol.study_file.limits` reports
            this beforehand).
    """
    of = SessionStreams(study=study, slot=slot, number=session)
    order = ordered_conditions(study, slot, session)
    names = study.conditions
    trials = [*map(_opening_trial, study.opening), *_practice(of), *_main(of, order)]
    return Plan(
        slot=slot,
        session=session,
        sequence=tuple(names[number] for _, number in order),
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


def _practice(of: SessionStreams) -> Iterator[Trial]:
    for number in practised(of.study, of.name("practice")):
        condition = of.study.condition[number]
        yield replace(_trial(condition, condition.levels[-1], turned=False), kind="practice")


def _main(of: SessionStreams, order: list[tuple[int, int]]) -> Iterator[Trial]:
    """Yield the scored trials block by block, with catch trials after some of them."""
    levels = level_draws(of.study, of.name("levels"))
    turned = opposite_draws(of.study, of.name("opposite"))
    catches = catch_places(of.study, [number for _, number in order], of.name("catch"))
    block_before = 1
    for place, (block, number) in enumerate(order, start=1):
        yield _trial(
            of.study.condition[number],
            levels[number].pop(),
            turned=turned[number].pop(),
            block=block,
            break_s=_break_s(of.study, block) if block != block_before else 0.0,
        )
        if place in catches:
            yield _catch_trial(of.study.condition[catches[place]], block)
        block_before = block


def _break_s(study: Study, block: int) -> float:
    every = study.design.break_every_blocks
    return study.design.break_s if every and (block - 1) % every == 0 else 0.0


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


def _catch_trial(condition: Condition, block: int) -> Trial:
    return Trial(
        index=0,
        block=block,
        kind="catch",
        condition=condition.name,
        question=condition.question,
        expected=no_change(condition.question),
        scored=False,
        touches=at_level(condition.touches, 0.0),
        level=0.0,
    )
