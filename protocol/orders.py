"""The order of the conditions in each block of a session, fair over the whole cohort."""

from dataclasses import dataclass
from functools import lru_cache

from protocol.design import Order
from protocol.shuffles import shuffle
from protocol.streams import Name, Stream
from protocol.williams import williams_sequences

Orders = tuple[tuple[int, ...], ...]


@dataclass(frozen=True, kw_only=True)
class Blocks:
    """How `repeats` blocks of so many conditions are ordered (see `Design`)."""

    order: Order
    conditions: int
    repeats: int
    max_run: int


def block_orders(wanted: Blocks, name: Name, slot: int) -> Orders:
    """Return the order of the conditions, numbered from 0, in each block of one participant.

    `williams`: slots are dealt the sequences of a Williams design. Every run of as many slots as
    there are sequences, from a multiple of that number on, holds in each block every sequence of a
    design whose conditions were freshly relabelled at random: such a cohort is balanced, and what
    a single slot gets is uniform over all orders.

    Args:
        wanted: the blocks. No condition stands more often in a row than `max_run`, also where
            blocks meet; of one condition alone the caller has to see that itself.
        name: seed and names of the random stream.
        slot: of the participant, from 0.
    """
    if wanted.order == "fixed" or wanted.conditions == 1:
        return (tuple(range(wanted.conditions)),) * wanted.repeats
    if wanted.order == "williams":
        size = len(_design(wanted.conditions))
        cycle = _williams_cycle(wanted, name, slot // size)
        return tuple(block[slot % size] for block in cycle)
    stream = Stream(*name, "slot", slot)
    return _shuffled(wanted, stream) if wanted.order == "random" else _blocks(wanted, stream)


@lru_cache(maxsize=64)
def _design(conditions: int) -> Orders:
    return williams_sequences(conditions)


@lru_cache(maxsize=256)
def _williams_cycle(wanted: Blocks, name: Name, cycle: int) -> tuple[Orders, ...]:
    """The orders of as many slots as the design has sequences, block by block."""
    stream = Stream(*name, "cycle", cycle)
    blocks: list[Orders] = []
    while len(blocks) < wanted.repeats:
        drawn = _relabelled(wanted.conditions, stream)
        if not blocks or wanted.max_run > 1 or not _meet_alike(blocks[-1], drawn):
            blocks.append(drawn)
    return tuple(blocks)


def _relabelled(conditions: int, stream: Stream) -> Orders:
    labels = stream.shuffled(range(conditions))
    sequences = stream.shuffled(_design(conditions))
    return tuple(tuple(labels[number] for number in sequence) for sequence in sequences)


def _meet_alike(before: Orders, after: Orders) -> bool:
    return any(first[-1] == second[0] for first, second in zip(before, after, strict=True))


def _shuffled(wanted: Blocks, stream: Stream) -> Orders:
    size = wanted.conditions
    drawn = shuffle(size, wanted.repeats, wanted.max_run, stream)
    return tuple(tuple(drawn[start : start + size]) for start in range(0, len(drawn), size))


def _blocks(wanted: Blocks, stream: Stream) -> Orders:
    blocks: list[tuple[int, ...]] = []
    while len(blocks) < wanted.repeats:
        drawn = tuple(stream.shuffled(range(wanted.conditions)))
        if not blocks or wanted.max_run > 1 or blocks[-1][-1] != drawn[0]:
            blocks.append(drawn)
    return tuple(blocks)
