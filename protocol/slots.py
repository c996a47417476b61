"""Slots of the design: given out at the start of a session, settled at its completion."""

from collections.abc import Sequence
from typing import Literal

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
