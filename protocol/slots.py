"""Slots of the design: given out at the start of a session, settled at its completion."""

from collections.abc import Iterable, Sequence
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


def slot_states(history: Iterable[tuple[int, SlotState]]) -> list[SlotState]:
    """Return the state of every slot after what happened to them, in order of time.

    Args:
        history: (slot, state) whenever a slot was given out, completed or given up.

    Raises:
        ValueError: a slot was given out while somebody had it, or changed after completion.

    >>> slot_states([(0, "running"), (1, "running"), (0, "dropped"), (1, "done"), (0, "running")])
    ['running', 'done']
    """
    states: dict[int, SlotState] = {}
    for slot, state in history:
        before = states.get(slot, "free")
        if before == "done" or (before == "running" and state == "running"):
            raise ValueError(f"slot {slot} must not become {state!r} after it was {before!r}")
        states[slot] = state
    return [states.get(slot, "free") for slot in range(max(states, default=-1) + 1)]
