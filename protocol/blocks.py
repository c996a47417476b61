"""Blocks of a session: which conditions stand together, and in which order each block has them."""

from protocol.grouping import Group, beam_groups, drawn_order, grouping
from protocol.orders import Blocks, block_orders
from protocol.streams import Stream
from protocol.study import Study


def ordered_conditions(study: Study, slot: int, session: int) -> list[tuple[int, int]]:
    """Return (block from 1, number of the condition) for every scored trial, in order."""
    sections = _sections(study, slot, session)
    orders = {group.members: list(_orders(study, group, slot, session)) for _, group in sections}
    return [
        (block, group.members[place])
        for block, group in sections
        for place in orders[group.members].pop(0)
    ]


def _orders(study: Study, group: Group, slot: int, session: int) -> tuple[tuple[int, ...], ...]:
    wanted = Blocks(
        order=study.design.order,
        conditions=len(group.members),
        repeats=study.design.repeats,
        max_run=study.design.max_alike_in_row,
    )
    members = "/".join(map(str, group.members))
    return block_orders(wanted, (study.study.seed, "order", session, members), slot)


def _sections(study: Study, slot: int, session: int) -> list[tuple[int, Group]]:
    """(block, conditions that stand together in it) in order."""
    level, repeats = grouping(study), study.design.repeats
    everything = Group(members=tuple(range(len(study.condition))), beams=(None,))
    if level == "no":
        return [(block, everything) for block in range(1, repeats + 1)]
    stream = Stream(study.study.seed, "groups", session, slot)
    groups, mounted = beam_groups(study), study.touch.beam
    if level == "session":
        order = drawn_order(groups, mounted, repeats, stream)
        return list(enumerate((group for group in order for _ in range(repeats)), start=1))
    sections: list[tuple[int, Group]] = []
    for block in range(1, repeats + 1):
        order = drawn_order(groups, mounted, 1, stream)
        sections += [(block, group) for group in order]
        mounted = order[-1].last
    return sections
