"""Plans: what is asked, and in which order over the cohort."""

from collections import Counter
from itertools import pairwise

import pytest

from protocol.plan import plan
from protocol.study_file import parsed_study, template

STUDY = parsed_study(template("paper"))


def test_a_plan_opens_with_baseline_and_signal() -> None:
    trials = plan(STUDY, slot=0).trials
    assert [trial.kind for trial in trials] == ["baseline", "signal"] + ["trial"] * 5
    assert [trial.index for trial in trials] == list(range(7))
    assert [trial.scored for trial in trials] == [False] * 2 + [True] * 5


@pytest.mark.parametrize("first_slot", [0, 10, 50])
def test_ten_slots_balance_first_order_carry_over(first_slot: int) -> None:
    orders = [plan(STUDY, slot).sequence for slot in range(first_slot, first_slot + 10)]
    pairs = Counter(pair for order in orders for pair in pairwise(order))
    assert set(pairs.values()) == {2}
    assert len(pairs) == 20


def test_the_same_slot_has_the_same_plan() -> None:
    assert plan(STUDY, slot=3) == plan(STUDY, slot=3)


def test_another_seed_gives_another_allocation() -> None:
    other = parsed_study(template("paper").replace("seed = 1", "seed = 2"))
    assert [plan(STUDY, s).sequence for s in range(10)] != [
        plan(other, s).sequence for s in range(10)
    ]


def test_a_fixed_order_is_the_order_of_the_file() -> None:
    fixed = parsed_study(template("paper").replace('order = "williams"', 'order = "fixed"'))
    assert plan(fixed, slot=7).sequence == fixed.conditions
