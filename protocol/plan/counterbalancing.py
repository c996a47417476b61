"""Counterbalancing over a cohort: Williams designs, orders of blocks, and the next slot to fill."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

from protocol.plan.randomisation import Name, Stream, shuffle
from protocol.study.design import Order

Orders = tuple[tuple[int, ...], ...]


@lru_cache(maxsize=64)
def williams_sequences(n: int) -> Orders:
    """Return the sequences of a Williams design for `n` conditions, numbered from 0.

    There are `n` sequences for even `n` and `2 n` for odd `n`; over all of them every condition
    stands at every position, and directly after every other one, equally often.

    Source: E. J. Williams, Experimental designs balanced for the estimation of residual effects
    of treatments, Australian Journal of Scientific Research A 2 (1949) 149-168.

    >>> williams_sequences(4)
    ((0, 1, 3, 2), (1, 2, 0, 3), (2, 3, 1, 0), (3, 0, 2, 1))

    Raises:
        ValueError: `n` is below 1.
    """
    if n < 1:
        raise ValueError(f"a design needs at least 1 condition, got {n}")
    # 0, 1, n-1, 2, n-2, …: the differences of neighbours are all distinct.
    first = [(step + 1) // 2 if step % 2 else (n - step // 2) % n for step in range(n)]
    square = tuple(tuple((start + row) % n for start in first) for row in range(n))
    if n % 2 == 0 or n == 1:
        return square
    return square + tuple(sequence[::-1] for sequence in square)


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
        size = len(williams_sequences(wanted.conditions))
        cycle = _williams_cycle(wanted, name, slot // size)
        return tuple(block[slot % size] for block in cycle)
    stream = Stream(*name, "slot", slot)
    return _shuffled(wanted, stream) if wanted.order == "random" else _blocks(wanted, stream)


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
    sequences = stream.shuffled(williams_sequences(conditions))
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


SlotState = Literal["free", "running", "done", "dropped"]

_TAKEN = ("running", "done")


def next_slot(states: Sequence[SlotState]) -> int:
    """Return the slot of the next participant: the first that nobody has or has finished.

    A slot whose participant dropped out is given out again, so that the orders stay balanced over
    those who finish. An interrupted session that may be resumed is still `running`.

    Args:
        states: of slots 0, 1, 2 and so on.

    >>> next_slot(["done", "dropped", "running"])
    1
    >>> next_slot(["done", "running"])
    2
    """
    for slot, state in enumerate(states):
        if state not in _TAKEN:
            return slot
    return len(states)
