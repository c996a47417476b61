"""Where a participant who arrives comes into the design: the group, and the slot in it."""

from collections.abc import Iterator, Sequence
from itertools import count
from math import gcd
from typing import Literal

from protocol.plan.orders import Stream
from protocol.study.study import Study

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


def arrivals(study: Study, kind: str) -> Iterator[tuple[str, int]]:
    """Yield group and slot of each participant of a `kind` of session, in the order of arrival.

    Groups are shuffled in blocks that hold each of them in proportion to its size, so that the
    seed and the place in the order of arrival decide, and all groups grow alike.
    """
    least = gcd(*(group.size for group in study.group))
    block = [group.name for group in study.group for _ in range(group.size // least)]
    slots = {name: count() for name in study.groups}
    for number in count():
        for name in Stream(study.study.seed, "arrival", kind, number).shuffled(block):
            yield name, next(slots[name])
