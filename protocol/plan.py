"""The plan of one session: the study's trials in the order that the participant's slot gives."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from protocol.blocks import ordered_conditions
from protocol.extras import catch_places, level_draws, opposite_draws, practised
from protocol.streams import Name
from protocol.study import Condition, Opening, Study
from protocol.trial import Plan, Trial
from protocol.variants import at_level, catch_expected, opposite, opposite_expected

__all__ = ["Plan", "Trial", "plan"]


@dataclass(frozen=True, kw_only=True)
class Session:
    """Whose plan is drawn: the names of its random streams."""

    study: Study
    slot: int
    number: int

    def name(self, purpose: str) -> Name:
        """Seed and name of the stream for `purpose`."""
        return (self.study.study.seed, purpose, self.number, self.slot)


def plan(study: Study, slot: int, session: int = 1) -> Plan:
    """Return the plan for the participant in `slot`, counted from 0 over the cohort.

    The study's seed decides everything: orders (see `protocol.orders`), levels, opposite, catch
    and practice trials each draw from a random stream of their own.

    Args:
        study: a checked study.
        slot: the participant's place in the design.
        session: of the participant, from 1.

    Raises:
        ValueError: the design's constraints cannot be met (`protocol.limits` says so beforehand).
    """
    of = Session(study=study, slot=slot, number=session)
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


def _practice(of: Session) -> Iterator[Trial]:
    for number in practised(of.study, of.name("practice")):
        condition = of.study.condition[number]
        yield replace(_trial(condition, condition.levels[-1], turned=False), kind="practice")


def _main(of: Session, order: list[tuple[int, int]]) -> Iterator[Trial]:
    """The scored trials block by block, with catch trials after some of them."""
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
        expected=catch_expected(condition),
        scored=False,
        touches=at_level(condition.touches, 0.0),
        level=0.0,
    )
