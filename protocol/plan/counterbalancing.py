"""Counterbalancing over a cohort: Williams designs, block orders and the next slot to fill."""

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

    There are `n` sequences for even `n` and `2 n` for odd `n`. Over all of them, every condition
    comes equally often at every position and directly after every other condition.

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
    """The number of blocks and conditions, and how they are ordered (see `Design`)."""

    order: Order
    conditions: int
    repeats: int
    max_run: int


def block_orders(wanted: Blocks, name: Name, slot: int) -> Orders:
    """Return the order of the conditions, numbered from 0, in each block of one participant.

    For `williams`, slots take the sequences of a Williams design in cycles: if the design has s
    sequences, slots k s to (k + 1) s - 1 use each of them once per block, with the conditions
    relabelled at random for every block. A cohort of whole cycles is therefore balanced, and the
    order of a single slot is uniform over all orders.

    Args:
        wanted: the blocks. No condition comes more than `max_run` times in a row, also across the
            end of a block; the caller must check this for a single condition.
        name: seed and names of the random stream.
        slot: slot of the participant, from 0.
    """
    if wanted.order == "fixed" or wanted.conditions == 1:
        return (tuple(range(wanted.conditions)),) * wanted.repeats
    if wanted.order == "williams":
        size = len(williams_sequences(wanted.conditions))
        cycle = _williams_cycle(wanted, name, slot // size)
        return tuple(block[slot % size] for block in cycle)
    stream = Stream(*name, "slot", slot)
    if wanted.order == "blocks":
        return _blocks(wanted, stream)
    size = wanted.conditions
    drawn = shuffle(size, wanted.repeats, wanted.max_run, stream)
    return tuple(tuple(drawn[start : start + size]) for start in range(0, len(drawn), size))


@lru_cache(maxsize=256)
def _williams_cycle(wanted: Blocks, name: Name, cycle: int) -> tuple[Orders, ...]:
    """Return the orders of one cycle of slots, one slot per sequence, block by block."""
    stream = Stream(*name, "cycle", cycle)
    blocks: list[Orders] = []
    while len(blocks) < wanted.repeats:
        labels = stream.shuffled(range(wanted.conditions))
        sequences = stream.shuffled(williams_sequences(wanted.conditions))
        drawn = tuple(tuple(labels[number] for number in sequence) for sequence in sequences)
        before = blocks[-1] if blocks and wanted.max_run == 1 else ()
        if all(order[-1] != after[0] for order, after in zip(before, drawn, strict=False)):
            blocks.append(drawn)
    return tuple(blocks)


def _blocks(wanted: Blocks, stream: Stream) -> Orders:
    blocks: list[tuple[int, ...]] = []
    while len(blocks) < wanted.repeats:
        drawn = tuple(stream.shuffled(range(wanted.conditions)))
        if not blocks or wanted.max_run > 1 or blocks[-1][-1] != drawn[0]:
            blocks.append(drawn)
    return tuple(blocks)


SlotState = Literal["free", "running", "done", "dropped"]


def next_slot(states: Sequence[SlotState]) -> int:
    """Return the slot, from 0, of the next participant: the first neither running nor done.

    The slot of a participant who dropped out is used again, so that the orders stay balanced over
    the participants who finish. An interrupted session that may be resumed is still `running`.

    >>> next_slot(["done", "dropped", "running"])
    1
    >>> next_slot(["done", "running"])
    2
    """
    free = (slot for slot, state in enumerate(states) if state not in {"running", "done"})
    return next(free, len(states))
