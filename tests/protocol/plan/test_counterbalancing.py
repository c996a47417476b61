"""Slots: a dropout's place in the design is given out again, a finished one never."""

from collections import Counter
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.plan.counterbalancing import SlotState, next_slot, williams_sequences


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


@pytest.mark.parametrize("n", range(2, 13))
def test_every_condition_stands_at_every_position_equally_often(n: int) -> None:
    sequences = williams_sequences(n)
    for position in range(n):
        counts = Counter(sequence[position] for sequence in sequences)
        assert counts == dict.fromkeys(range(n), len(sequences) // n)


@pytest.mark.parametrize("n", range(2, 13))
def test_every_condition_follows_every_other_one_equally_often(n: int) -> None:
    sequences = williams_sequences(n)
    pairs = Counter(pair for sequence in sequences for pair in pairwise(sequence))
    wanted = {(a, b): len(sequences) // n for a in range(n) for b in range(n) if a != b}
    assert pairs == wanted


def test_five_conditions_need_ten_sequences() -> None:
    assert len(set(williams_sequences(5))) == 10


def test_no_condition_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 1 condition, got 0"):
        williams_sequences(0)
