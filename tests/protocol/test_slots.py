"""Slots: a dropout's place in the design is given out again, a finished one never."""

from hypothesis import given
from hypothesis import strategies as st

from protocol.slots import SlotState, next_slot


@given(st.lists(st.booleans(), min_size=1, max_size=60))
def test_whoever_drops_out_those_who_finish_fill_the_first_slots(finishes: list[bool]) -> None:
    """One after the other: exactly the first slots are done, none is burnt."""
    states: list[SlotState] = []
    for finished in finishes:
        slot = next_slot(states)
        states[slot : slot + 1] = ["done" if finished else "dropped"]
    done = [slot for slot, state in enumerate(states) if state == "done"]
    assert done == list(range(sum(finishes)))


def test_a_slot_that_somebody_has_is_not_given_out() -> None:
    assert next_slot([]) == 0
    assert next_slot(["running", "done", "free"]) == 2
    assert next_slot(["running", "dropped", "running"]) == 1
