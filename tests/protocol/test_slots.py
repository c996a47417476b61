"""Slots: a dropout's place in the design is given out again, a finished one never."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.slots import SlotState, next_slot, slot_states


@given(st.lists(st.booleans(), min_size=1, max_size=60))
def test_whoever_drops_out_those_who_finish_fill_the_first_slots(finishes: list[bool]) -> None:
    """One after the other: exactly the first slots are done, none is burnt."""
    history: list[tuple[int, SlotState]] = []
    for finished in finishes:
        slot = next_slot(slot_states(history))
        history += [(slot, "running"), (slot, "done" if finished else "dropped")]
    states = slot_states(history)
    done = [slot for slot, state in enumerate(states) if state == "done"]
    assert done == list(range(sum(finishes)))


def test_a_slot_that_somebody_has_is_not_given_out() -> None:
    assert next_slot([]) == 0
    assert next_slot(["running", "done", "free"]) == 2


@pytest.mark.parametrize(
    ("history", "message"),
    [
        ([(0, "running"), (0, "running")], "slot 0 must not become 'running' .* 'running'"),
        ([(2, "running"), (2, "done"), (2, "dropped")], "slot 2 must not become 'dropped'"),
    ],
)
def test_a_slot_is_given_out_once(history: list[tuple[int, SlotState]], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        slot_states(history)
