"""Blocks of a session: the order of their conditions, grouped where beam swaps must be few."""

from dataclasses import dataclass
from functools import lru_cache

from protocol.plan.counterbalancing import Blocks, block_orders
from protocol.plan.randomisation import Stream
from protocol.plan.trials import Beams, beams_of, swap_count
from protocol.plan.variants import opposite_expected
from protocol.study.design import Grouping
from protocol.study.study import Study

LEVELS: tuple[Grouping, ...] = ("no", "block", "session")
MAX_GROUPS = 8
"""Most sets of beams that are put in order: the search grows as 2 to the power of their number."""


@dataclass(frozen=True, kw_only=True)
class Group:
    """Conditions that need the same beams in the same order.

    `turns` says that some of their trials run in the opposite order and begin with the last beam.
    """

    members: tuple[int, ...]
    beams: Beams
    turns: bool = False

    def swaps(self, trials: int) -> int:
        """Return the most swaps in `trials` consecutive trials once the first beam is mounted."""
        within = swap_count(self.beams)
        between = self.beams[0] != self.beams[-1]
        return trials * within + (trials - 1) * between

    def entry(self, mounted: str | None) -> int:
        """Return the most swaps needed to begin the group with the beam `mounted`."""
        turned = self.turns and self.beams[-1] != mounted
        return int(self.beams[0] != mounted or turned)

    @property
    def last(self) -> str | None:
        """The beam mounted after the group; an empty name if that is not certain."""
        return "" if self.turns else self.beams[-1]


def beam_groups(study: Study) -> tuple[Group, ...]:
    """Return the conditions grouped by the beams they need, in the order of the file."""
    members: dict[Beams, list[int]] = {}
    for number, condition in enumerate(study.condition):
        members.setdefault(beams_of(condition.touches, study.touch.beam), []).append(number)

    def turns(numbers: list[int]) -> bool:
        opposite = any(opposite_expected(study.condition[number]) for number in numbers)
        return study.design.opposite_repeats > 0 and opposite

    return tuple(
        Group(members=tuple(numbers), beams=beams, turns=len(beams) > 1 and turns(numbers))
        for beams, numbers in members.items()
    )


def grouping(study: Study) -> Grouping:
    """Return how trials are grouped: as configured, or more if `max_beam_swaps` requires it."""
    asked = LEVELS.index(study.design.group_by_beam)
    allowed = study.design.max_beam_swaps if study.design.order != "fixed" else None
    for level in LEVELS[asked:]:
        if allowed is None or most_swaps(study, level) <= allowed:
            return level
    return LEVELS[-1]


def most_swaps(study: Study, level: Grouping) -> int:
    """Return the most beam swaps that a session may need in any order that can be drawn."""
    groups, repeats, mounted = beam_groups(study), study.design.repeats, study.touch.beam
    begin = opening_swaps(study)
    if level == "no":
        there_and_back = (
            len(group.members) * swap_count((mounted, *group.beams, mounted)) for group in groups
        )
        return begin + repeats * sum(there_and_back)
    if level == "session":
        return begin + best_order(groups, mounted, repeats)[0]
    ends = {group.last for group in groups}
    later = max(best_order(groups, end, 1)[0] for end in ends)
    return begin + best_order(groups, mounted, 1)[0] + (repeats - 1) * later


def opening_swaps(study: Study) -> int:
    """Return the most swaps before the first block, which begins with the study's own beam."""
    touches = [touch for opening in study.opening for touch in opening.touches]
    beams = beams_of(touches, study.touch.beam)
    practice = study.design.practice_trials * max(
        (
            swap_count((study.touch.beam, *group.beams, study.touch.beam))
            for group in _practised(study)
        ),
        default=0,
    )
    return swap_count((*beams, study.touch.beam)) + practice


def _practised(study: Study) -> list[Group]:
    groups = beam_groups(study)
    return [group for group in groups if group.beams == (study.touch.beam,)] or list(groups)


def practice_pool(study: Study) -> list[int]:
    """Return the conditions to practise: those on the study's own beam, or else all."""
    return sorted(number for group in _practised(study) for number in group.members)


@lru_cache(maxsize=1024)
def best_order(groups: tuple[Group, ...], mounted: str | None, repeats: int) -> tuple[int, int]:
    """Return the fewest swaps to run all `groups`, and the number of orders that achieve it."""
    if not groups:
        return 0, 1
    costs = [_cost(groups, number, mounted, repeats) for number in range(len(groups))]
    fewest = min(cost for cost, _ in costs)
    return fewest, sum(ways for cost, ways in costs if cost == fewest)


def _cost(
    groups: tuple[Group, ...], first: int, mounted: str | None, repeats: int
) -> tuple[int, int]:
    group = groups[first]
    rest, ways = best_order(groups[:first] + groups[first + 1 :], group.last, repeats)
    return group.entry(mounted) + group.swaps(repeats * len(group.members)) + rest, ways


def drawn_order(
    groups: tuple[Group, ...], mounted: str | None, repeats: int, stream: Stream
) -> list[Group]:
    """Return one of the orders with the fewest swaps, each equally likely."""
    drawn: list[Group] = []
    while groups:
        fewest, _ = best_order(groups, mounted, repeats)
        costs = [_cost(groups, number, mounted, repeats) for number in range(len(groups))]
        first = stream.weighted([ways if cost == fewest else 0 for cost, ways in costs])
        drawn.append(groups[first])
        mounted = groups[first].last
        groups = groups[:first] + groups[first + 1 :]
    return drawn


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
    """Return (block, group of conditions run together in it), in order."""
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
