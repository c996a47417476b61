"""Orders of a session: of its conditions in blocks, grouped where beam swaps must be few."""

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from itertools import accumulate, chain, pairwise
from math import comb
from typing import TypeVar

from protocol.plan.trials import Beams, beams_of, swap_count
from protocol.study.rules import Design, Grouping
from protocol.study.study import Condition, Study
from protocol.study.study_question import QUESTIONS
from protocol.study.touch import Touch

# Named random streams, one for each purpose, and constrained shuffles.
#
# Python guarantees the same sequence on every platform and version for `random.random` only, not
# for its shuffles. Here SHA-256 defines every draw, so that a seed gives the same plan
# everywhere.

T = TypeVar("T")
StreamName = tuple[int, *tuple[object, ...]]
"""A seed, and the words that name one of its streams."""


class Stream:
    """An endless sequence of independent uniform draws, given by a seed and a name."""

    def __init__(self, seed: int, *name: object) -> None:
        self._name = "/".join(map(str, (seed, *name))).encode()
        self._pool = 0
        self._bits = 0
        self._blocks = 0

    def below(self, limit: int) -> int:
        """Return a whole number, uniform in [0, limit).

        Bits are drawn until they form a number below `limit`, so that all values are equally
        likely (a remainder would favour small ones).
        """
        if limit < 1:
            raise ValueError(f"limit must be at least 1, got {limit}")
        wanted = (limit - 1).bit_length()
        while (drawn := self._drawn(wanted)) >= limit:
            pass
        return drawn

    def _drawn(self, bits: int) -> int:
        while self._bits < bits:
            # docs/mathematics/orders.md describes this stream, so that anybody can draw the orders
            # without touchbeam: no byte of it may change.
            block = sha256(self._name + b"#%d" % self._blocks).digest()
            self._pool |= int.from_bytes(block, "little") << self._bits
            self._bits += 256
            self._blocks += 1
        drawn = self._pool & ((1 << bits) - 1)
        self._pool >>= bits
        self._bits -= bits
        return drawn

    def shuffled(self, items: Iterable[T]) -> list[T]:
        """Return the items in a uniformly random order (Fisher-Yates)."""
        left = list(items)
        for last in range(len(left) - 1, 0, -1):
            chosen = self.below(last + 1)
            left[last], left[chosen] = left[chosen], left[last]
        return left

    def one_of(self, items: Sequence[T]) -> T:
        """Return one of the items, each equally likely."""
        return items[self.below(len(items))]

    def weighted(self, weights: Sequence[int]) -> int:
        """Return an index, drawn in proportion to the whole numbers `weights`."""
        return bisect_right(list(accumulate(weights)), self.below(sum(weights)))


def shuffle(kinds: int, repeats: int, max_run: int, stream: Stream) -> list[int]:
    """Return `kinds` items, each `repeats` times, in random order with short runs.

    Every order in which no item comes more than `max_run` times in a row is equally likely. If
    there is none, a ValueError says so.
    """
    if kinds == 1 and repeats > max_run:
        raise ValueError(f"one item {repeats} times cannot have runs of at most {max_run}")
    # No run can be too long: every shuffle will do, and none has to be rejected.
    if max_run >= repeats:
        return stream.shuffled(item for item in range(kinds) for _ in range(repeats))
    if max_run == 1:
        return _without_neighbours_alike(kinds, repeats, stream)
    while (drawn := _attempt(kinds, repeats, max_run, stream)) is None:
        pass
    return drawn


def _attempt(kinds: int, repeats: int, max_run: int, stream: Stream) -> list[int] | None:
    """Return a shuffle, or None at the first run that is too long: rejection keeps it uniform."""
    left = [item for item in range(kinds) for _ in range(repeats)]
    drawn: list[int] = []
    run = 0
    while left:
        chosen = stream.below(len(left))
        item, left[chosen] = left[chosen], left[-1]
        left.pop()
        run = run + 1 if drawn and drawn[-1] == item else 1
        if run > max_run:
            return None
        drawn.append(item)
    return drawn


def _without_neighbours_alike(kinds: int, repeats: int, stream: Stream) -> list[int]:
    """Insert the kinds one by one, by exact counts; rejection would almost never succeed here.

    A gap between two equal neighbours is bad. Each kind is split into `parts` runs, of which
    `mending` go into bad gaps and the others elsewhere; a run of m items leaves m - 1 bad gaps.
    """
    drawn = [0] * repeats
    for kind in range(1, kinds):
        bad = [at for at in range(1, len(drawn)) if drawn[at] == drawn[at - 1]]
        choices = list(_choices(len(bad), kind, repeats))
        # A choice counts as often as there are ways to complete it, or the orders would not be
        # equally likely.
        weights = [
            ways * _completions(kinds, repeats, kind + 1, len(bad) - mending + repeats - parts)
            for parts, mending, ways in choices
        ]
        parts, mending, _ = choices[stream.weighted(weights)]
        good = [at for at in range(len(drawn) + 1) if at not in bad]
        gaps = stream.shuffled(bad)[:mending] + stream.shuffled(good)[: parts - mending]
        # All lists of `parts` positive lengths with the sum `repeats` are equally likely.
        cuts = sorted(stream.shuffled(range(1, repeats))[: parts - 1])
        lengths = [end - begin for begin, end in pairwise([0, *cuts, repeats])]
        runs = dict(zip(sorted(gaps), lengths, strict=True))
        woven = ([kind] * runs.get(at, 0) + drawn[at : at + 1] for at in range(len(drawn) + 1))
        drawn = list(chain.from_iterable(woven))
    return drawn


def _choices(bad: int, kind: int, repeats: int) -> Iterator[tuple[int, int, int]]:
    """Yield (parts, mending, ways) of inserting the next kind among `kind` earlier ones."""
    good = kind * repeats + 1 - bad
    for parts in range(1, repeats + 1):
        for mending in range(min(parts, bad) + 1):
            ways = comb(repeats - 1, parts - 1) * comb(bad, mending) * comb(good, parts - mending)
            yield parts, mending, ways


@lru_cache(maxsize=65_536)
def _completions(kinds: int, repeats: int, kind: int, bad: int) -> int:
    """Return the number of ways to insert the kinds from `kind` on so that no bad gap is left."""
    if kind == kinds:
        return int(bad == 0)
    return sum(
        ways * _completions(kinds, repeats, kind + 1, bad - mending + repeats - parts)
        for parts, mending, ways in _choices(bad, kind, repeats)
        if ways
    )


def spaced_places(allowed: list[int], number: int, apart: int, stream: Stream) -> list[int]:
    """Return `number` of the ascending places `allowed`, each at least `apart` after the last.

    Every such choice is equally likely; if there is none, a ValueError says so.
    """
    # ways[i][k]: the number of choices of k places among allowed[i:]
    after = [bisect_left(allowed, place + apart) for place in allowed]
    ways = [[1] + [0] * number for _ in range(len(allowed) + 1)]
    for i in reversed(range(len(allowed))):
        for wanted in range(1, number + 1):
            ways[i][wanted] = ways[i + 1][wanted] + ways[after[i]][wanted - 1]
    if not ways[0][number]:
        raise ValueError(f"cannot choose {number} places at least {apart} apart, got {allowed}")
    chosen: list[int] = []
    at = 0
    for wanted in range(number, 0, -1):
        # Taken in proportion to the choices that contain the place, so that each choice is equally
        # likely.
        while stream.below(ways[at][wanted]) >= ways[after[at]][wanted - 1]:
            at += 1
        chosen.append(allowed[at])
        at = after[at]
    return chosen


# Counterbalancing over a cohort: Williams designs and block orders.

Orders = tuple[tuple[int, ...], ...]


@lru_cache(maxsize=64)
def williams_sequences(n: int) -> Orders:
    """Return the sequences of a Williams design for `n` conditions, numbered from 0.

    There are `n` sequences for even `n` and `2 n` for odd `n`. Over all of them, every condition
    comes equally often at every position and directly after every other condition.

    Source: E. J. Williams, Experimental designs balanced for the estimation of residual effects
    of treatments, Australian Journal of Scientific Research A 2 (1949) 149-168.

    >>> williams_sequences(4)
    ((0, 1, 3, 2), (1, 2, 0, 3), (2, 3, 1, 0), (3, 0, 2, 1))
    """
    if n < 1:
        raise ValueError(f"a design needs at least 1 condition, got {n}")
    # 0, 1, n-1, 2, n-2, …: the differences of neighbours are all distinct.
    first = [(step + 1) // 2 if step % 2 else (n - step // 2) % n for step in range(n)]
    square = tuple(tuple((start + row) % n for start in first) for row in range(n))
    if n % 2 == 0 or n == 1:
        return square
    # For odd n one square cannot balance the pairs; its mirror image has those that it lacks.
    return square + tuple(sequence[::-1] for sequence in square)


def block_orders(design: Design, conditions: int, name: StreamName, slot: int) -> Orders:
    """Return the order of the conditions, numbered from 0, in each block of one participant.

    For `williams`, slots take the sequences of a Williams design in cycles
    (docs/mathematics/orders.md). A cohort of whole cycles is therefore balanced, and the order of
    a single slot is uniform over all orders.

    No condition comes more than `max_alike_in_row` times in a row, also across the end of a block;
    the caller must check this for a single condition.
    """
    # Nothing is drawn, so that no stream is used.
    if design.order == "fixed" or conditions == 1:
        return (tuple(range(conditions)),) * design.repeats
    if design.order == "williams":
        size = len(williams_sequences(conditions))
        cycle = _williams_cycle(design, conditions, name, slot // size)
        return tuple(block[slot % size] for block in cycle)
    stream = Stream(*name, "slot", slot)
    if design.order == "blocks":
        blocks: list[tuple[int, ...]] = []
        while len(blocks) < design.repeats:
            block = tuple(stream.shuffled(range(conditions)))
            if not blocks or design.max_alike_in_row > 1 or blocks[-1][-1] != block[0]:
                blocks.append(block)
        return tuple(blocks)
    drawn = shuffle(conditions, design.repeats, design.max_alike_in_row, stream)
    starts = range(0, len(drawn), conditions)
    return tuple(tuple(drawn[start : start + conditions]) for start in starts)


@lru_cache(maxsize=256)
def _williams_cycle(
    design: Design, conditions: int, name: StreamName, cycle: int
) -> tuple[Orders, ...]:
    """Return the orders of one cycle of slots, one slot per sequence, block by block."""
    # One stream for the whole cycle: its slots must know of each other to be balanced together.
    stream = Stream(*name, "cycle", cycle)
    blocks: list[Orders] = []
    while len(blocks) < design.repeats:
        labels = stream.shuffled(range(conditions))
        sequences = stream.shuffled(williams_sequences(conditions))
        drawn = tuple(tuple(labels[number] for number in sequence) for sequence in sequences)
        # A condition stands once in a block, so that only ends of blocks can break the rule on
        # runs.
        before = blocks[-1] if blocks and design.max_alike_in_row == 1 else ()
        # The whole cycle is drawn anew, because a repair of one sequence would break the balance.
        if all(order[-1] != after[0] for order, after in zip(before, drawn, strict=False)):
            blocks.append(drawn)
    return tuple(blocks)


# Variants of a condition: its touches at another level, at 0 V, or in the opposite order.


def scaled(touch: Touch, level: float) -> Touch:
    """Return `touch` with its amplitudes multiplied by `level`.

    The friction that it states is that of its own amplitude: of another one it is not known.
    """
    ramp_to_v = None if touch.ramp_to_v is None else touch.ramp_to_v * level
    update = {"voltage_v": touch.voltage_v * level, "ramp_to_v": ramp_to_v}
    if touch.friction is not None and not _rests(touch):
        update["friction"] = None
    return touch.model_copy(update=update)


def _rests(touch: Touch) -> bool:
    return not touch.voltage_v and not touch.ramp_to_v


@lru_cache(maxsize=4096)
def at_level(touches: tuple[Touch, ...], level: float) -> tuple[Touch, ...]:
    """Return the touches with every amplitude multiplied by `level`; at 0 it is a catch trial."""
    if level == 1:
        return touches
    made = tuple(scaled(touch, level) for touch in touches)
    stated = [touch.friction for touch in touches if _rests(touch) and touch.friction is not None]
    if level == 0 and stated:  # all touches are at rest
        made = tuple(touch.model_copy(update={"friction": stated[0]}) for touch in made)
    return made


@lru_cache(maxsize=4096)
def opposite(touches: tuple[Touch, ...]) -> tuple[Touch, ...]:
    """Return the touches in the opposite order, each ramp and sweep run backwards."""
    return tuple(_backwards(touch) for touch in reversed(touches))


def _backwards(touch: Touch) -> Touch:
    update: dict[str, float | None] = {}
    if touch.ramp_to_v is not None:
        update |= {"voltage_v": touch.ramp_to_v, "ramp_to_v": touch.voltage_v}
    if touch.sweep_to is not None:
        update |= {"frequency": touch.sweep_to, "sweep_to": touch.frequency}
        update |= {"frequency_hz": touch.sweep_to_hz, "sweep_to_hz": touch.frequency_hz}
    return touch.model_copy(update=update)


@lru_cache(maxsize=1024)
def opposite_expected(condition: Condition) -> str | None:
    """Return the answer expected of the opposite trial, or `None` if the condition has none."""
    if condition.question is None or condition.expected is None:
        return None
    there, back = map(_courses, (condition.touches, opposite(condition.touches)))
    # Touches that are the same backwards feel the same: nothing contrary can be expected.
    return None if there == back else QUESTIONS[condition.question].contrary(condition.expected)


def _courses(touches: tuple[Touch, ...]) -> list[Touch]:
    """The touches with their ends written out: a ramp from 100 V to 100 V is a hold."""
    return [
        touch.model_copy(update={"ramp_to_v": touch.end_voltage_v, "sweep_to": touch.end_frequency})
        for touch in touches
    ]


_GROUPINGS: tuple[Grouping, ...] = ("no", "block", "session")
MAX_GROUPS = 8
"""Most sets of beams that are put in order: the search grows as 2 to the power of their number."""


@dataclass(frozen=True, kw_only=True)
class BeamGroup:
    """Conditions that need the same beams in the same order.

    `turns` says that some of their trials run in the opposite order and begin with the last beam.
    """

    members: tuple[int, ...]
    beams: Beams
    turns: bool = False

    def swaps(self, trials: int) -> int:
        """Return the most swaps in `trials` consecutive trials once the first beam is mounted."""
        between = self.beams[0] != self.beams[-1]
        return trials * swap_count(self.beams) + (trials - 1) * between

    def entry(self, mounted: str | None) -> int:
        """Return the most swaps needed to begin the group with the beam `mounted`."""
        return int(self.beams[0] != mounted or (self.turns and self.beams[-1] != mounted))

    @property
    def last(self) -> str | None:
        """The beam mounted after the group; an empty name if that is not certain."""
        return "" if self.turns else self.beams[-1]


def beam_groups(study: Study) -> tuple[BeamGroup, ...]:
    """Return the conditions grouped by the beams they need, in the order of the file."""
    members: dict[Beams, list[int]] = {}
    for number, condition in enumerate(study.condition):
        members.setdefault(beams_of(condition.touches, study.touch.beam), []).append(number)

    def turns(numbers: list[int]) -> bool:
        opposite = any(opposite_expected(study.condition[number]) for number in numbers)
        return study.design.opposite_repeats > 0 and opposite

    return tuple(
        BeamGroup(members=tuple(numbers), beams=beams, turns=len(beams) > 1 and turns(numbers))
        for beams, numbers in members.items()
    )


def grouping(study: Study) -> Grouping:
    """Return how trials are grouped: as configured, or more if `max_beam_swaps` requires it."""
    asked = _GROUPINGS.index(study.design.group_by_beam)
    # A fixed order is the author's: it is refused if it needs too many swaps, and never regrouped.
    allowed = study.design.max_beam_swaps if study.design.order != "fixed" else None
    for level in _GROUPINGS[asked:]:
        if allowed is None or most_swaps(study, level) <= allowed:
            return level
    return _GROUPINGS[-1]


def most_swaps(study: Study, level: Grouping) -> int:
    """Return the most beam swaps that a session may need in any order that can be drawn."""
    groups, repeats, mounted = beam_groups(study), study.design.repeats, study.touch.beam
    begin = _swaps_apart(study)
    if not groups:
        return begin
    if level == "no":
        # Ungrouped, the worst order has each trial between two on the study's own beam.
        there_and_back = (
            len(group.members) * swap_count((mounted, *group.beams, mounted)) for group in groups
        )
        return begin + repeats * sum(there_and_back)
    if level == "session":
        return begin + best_order(groups, mounted, repeats)[0]
    ends = {group.last for group in groups}
    # A block may begin with whatever beam the one before left: the worst of these counts.
    later = max(best_order(groups, end, 1)[0] for end in ends)
    return begin + best_order(groups, mounted, 1)[0] + (repeats - 1) * later


def _swaps_apart(study: Study) -> int:
    """Return the most swaps for openings and practice, after which the own beam is on, and tracks.

    Each track is touched on one beam.
    """
    own = study.touch.beam
    opening = beams_of([touch for it in study.opening for touch in it.touches], own)
    practised = [swap_count((own, *group.beams, own)) for group in _practised(study)]
    practice = study.design.practice_trials * max(practised, default=0)
    tracks = [track.comparison.beam or own for track in study.track]
    return swap_count((*opening, own)) + practice + len(tracks) * (set(tracks) != {own})


def _practised(study: Study) -> list[BeamGroup]:
    groups = beam_groups(study)
    # Practice needs no swap where some condition is on the beam that is mounted already.
    return [group for group in groups if group.beams == (study.touch.beam,)] or list(groups)


def practice_pool(study: Study) -> list[int]:
    """Return the conditions to practise: those on the study's own beam, or else all."""
    return sorted(number for group in _practised(study) for number in group.members)


@lru_cache(maxsize=1024)
def best_order(groups: tuple[BeamGroup, ...], mounted: str | None, repeats: int) -> tuple[int, int]:
    """Return the fewest swaps to run all `groups`, and the number of orders that achieve it."""
    if not groups:
        return 0, 1
    costs = [_cost(groups, number, mounted, repeats) for number in range(len(groups))]
    fewest = min(cost for cost, _ in costs)
    return fewest, sum(ways for cost, ways in costs if cost == fewest)


def _cost(
    groups: tuple[BeamGroup, ...], first: int, mounted: str | None, repeats: int
) -> tuple[int, int]:
    group = groups[first]
    rest, ways = best_order(groups[:first] + groups[first + 1 :], group.last, repeats)
    return group.entry(mounted) + group.swaps(repeats * len(group.members)) + rest, ways


def drawn_order(
    groups: tuple[BeamGroup, ...], mounted: str | None, repeats: int, stream: Stream
) -> list[BeamGroup]:
    """Return one of the orders with the fewest swaps, each equally likely."""
    drawn: list[BeamGroup] = []
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
    orders: dict[tuple[int, ...], list[tuple[int, ...]]] = {}
    for members in {group.members for _, group in sections}:
        # The members are part of the name, so that each group has a stream of its own.
        name = (study.study.seed, "order", session, "/".join(map(str, members)))
        orders[members] = [*block_orders(study.design, len(members), name, slot)]
    return [
        (block, group.members[place])
        for block, group in sections
        for place in orders[group.members].pop(0)
    ]


def _sections(study: Study, slot: int, session: int) -> list[tuple[int, BeamGroup]]:
    """Return (block, group of conditions run together in it), in order."""
    level, repeats = grouping(study), study.design.repeats
    everything = BeamGroup(members=tuple(range(len(study.condition))), beams=(None,))
    if level == "no":
        return [(block, everything) for block in range(1, repeats + 1)]
    stream = Stream(study.study.seed, "groups", session, slot)
    groups, mounted = beam_groups(study), study.touch.beam
    if level == "session":
        order = drawn_order(groups, mounted, repeats, stream)
        return list(enumerate((group for group in order for _ in range(repeats)), start=1))
    sections: list[tuple[int, BeamGroup]] = []
    for block in range(1, repeats + 1):
        order = drawn_order(groups, mounted, 1, stream)
        sections += [(block, group) for group in order]
        mounted = order[-1].last
    return sections
