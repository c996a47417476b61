"""Counterbalancing: Williams designs, and slots that are used again only after a dropout."""

from collections import Counter
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.plan.orders import williams_sequences
from protocol.plan.plan import SlotState, next_slot


@given(st.lists(st.booleans(), min_size=1, max_size=60))
def test_finishers_fill_the_first_slots_despite_dropouts(finishes: list[bool]) -> None:
    """After any sequence of dropouts, exactly the first slots are done and none is lost."""
    states: list[SlotState] = []
    for finished in finishes:
        slot = next_slot(states)
        states[slot : slot + 1] = ["done" if finished else "dropped"]
    done = [slot for slot, state in enumerate(states) if state == "done"]
    assert done == list(range(sum(finishes)))


def test_a_slot_in_use_is_not_assigned_again() -> None:
    assert next_slot([]) == 0
    assert next_slot(["running", "done", "free"]) == 2
    assert next_slot(["running", "dropped", "running"]) == 1


@pytest.mark.parametrize("n", range(2, 13))
def test_every_condition_comes_at_every_position_equally_often(n: int) -> None:
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


def test_a_design_without_conditions_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 1 condition, got 0"):
        williams_sequences(0)
