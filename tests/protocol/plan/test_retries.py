"""Trials that come again: later in their block, without breaking what the plan promises."""

from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.plan.orders import Stream
from protocol.plan.plan import deferral, plan, running_order
from protocol.plan.trials import Plan
from protocol.proof.trial_checks import order_problems
from protocol.study.study import Study
from protocol.study_file.limits import problems
from tests.protocol.studies import Document, documents, small

MOST = 3


def answered(study: Study, planned: Plan, failures: set[tuple[int, int]]) -> list[int]:
    """Return the order of the answers if these attempts (trial, number from 0) fail."""
    deferrals: list[tuple[int, int]] = []
    done: list[int] = []
    mounted = study.touch.beam
    while left := [t for t in running_order(planned.trials, deferrals) if t.index not in done]:
        trial = left[0]
        attempt = sum(index == trial.index for index, _ in deferrals)
        mounted = trial.touches[-1].beam or study.touch.beam
        if trial.kind == "practice" or (trial.index, attempt) not in failures:
            done.append(trial.index)
            continue
        order = running_order(planned.trials, deferrals)
        stream = Stream(study.study.seed, "again", planned.slot, trial.index, attempt)
        deferrals.append(deferral(study, order, trial, mounted, stream))
    return done


@settings(max_examples=150, deadline=None)
@given(document=documents(), draw=st.data())
def test_every_order_keeps_the_rules_of_the_plan(document: Document, draw: st.DataObject) -> None:
    study = Study.model_validate(document)
    if problems(study):
        return
    planned = plan(study, slot=draw.draw(st.integers(0, 20)))
    attempts = [(trial.index, n) for trial in planned.trials for n in range(MOST)]
    failures = set(draw.draw(st.lists(st.sampled_from(attempts), max_size=20)))
    order = answered(study, planned, failures)
    assert sorted(order) == [trial.index for trial in planned.trials]
    assert order_problems(study, planned, order) == []


def test_a_trial_comes_later_in_its_block_at_every_place_alike() -> None:
    study = small(5)
    planned = plan(study, slot=0)
    last = planned.trials[-1].index
    places = [
        deferral(study, planned.trials, planned.trials[0], None, Stream(seed, "again"))[1]
        for seed in range(400)
    ]
    counts = [places.count(index) for index in range(1, last + 1)]
    assert sum(counts) == 400
    assert min(counts) > 60


def test_it_comes_at_once_if_another_place_needs_another_beam() -> None:
    study = small(3, beams=3)
    planned = plan(study, slot=0)
    first = planned.trials[0]
    mounted = first.touches[-1].beam
    assert deferral(study, planned.trials, first, mounted, Stream(1, "again")) == (0, 0)


def test_the_opening_comes_at_once() -> None:
    opening = {"kind": "baseline", "touches": [{"place": "smooth", "voltage_v": 0}]}
    study = small(3)
    study = Study.model_validate({**study.model_dump(by_alias=True), "opening": [opening] * 2})
    planned = plan(study, slot=0)
    assert deferral(study, planned.trials, planned.trials[0], None, Stream(1, "again")) == (0, 0)


def test_a_break_comes_once() -> None:
    study = small(2, repeats=2, break_every_blocks=1)
    planned = plan(study, slot=0)
    with_break = next(trial for trial in planned.trials if trial.break_s)
    for after in (with_break.index, with_break.index + 1):
        order = running_order(planned.trials, [(with_break.index, after)])
        assert not any(trial.break_s for trial in order)


@pytest.mark.parametrize(
    ("order", "rule"),
    [
        ([0, 1, 2, 3, 3], "once"),
        ([0, 1, 2, 9], "planned"),
        ([0, 2, 1, 3], "blocks"),
        ([2, 3, 0, 1], "blocks"),
    ],
)
def test_another_order_is_found_out(order: Sequence[int], rule: str) -> None:
    study = small(2, repeats=2)
    found = order_problems(study, plan(study, slot=0), order)
    assert any(rule in problem.rule for problem in found)


def test_runs_and_catch_trials_are_looked_at_in_the_order_of_the_answers() -> None:
    study = small(3, repeats=3, order="random", max_alike_in_row=1, catch_trials=2, catch_apart=2)
    planned = plan(study, slot=0)
    of_one = [t.index for t in planned.trials if t.condition == "c0" and t.kind == "trial"]
    rest = [trial.index for trial in planned.trials if trial.index not in of_one]
    found = [problem.rule for problem in order_problems(study, planned, of_one + rest)]
    assert any("in a row" in rule for rule in found)
    catches = [trial.index for trial in planned.trials if trial.kind == "catch"]
    rest = [trial.index for trial in planned.trials if trial.kind != "catch"]
    found = [problem.rule for problem in order_problems(study, planned, rest + catches)]
    assert any("separate catch trials" in rule for rule in found)


def test_a_whole_session_must_not_need_more_beam_swaps_than_its_plan() -> None:
    study = small(4, beams=2, group_by_beam="session", order="random")
    planned = plan(study, slot=0)
    first, second, third, fourth = (trial.index for trial in planned.trials)
    blocks, swaps = order_problems(study, planned, [first, fourth, second, third])
    assert (swaps.rule, swaps.value) == ("there must be at most 1 beam swaps", "2")
    # What is left of a session may need any number.
    (found,) = order_problems(study, planned, [first, fourth, second])
    assert found.rule == blocks.rule == "blocks must follow one another"


def test_a_catch_trial_never_becomes_the_first_of_a_session() -> None:
    """No trial comes before the first one: the last of the session is not its neighbour."""
    study = small(4, catch_trials=1)
    plans = (plan(study, slot) for slot in range(40))
    planned = next(each for each in plans if each.trials[1].kind == "catch")
    first, *others = planned.trials
    draws = (Stream(seed, "again") for seed in range(40))
    drawn = {deferral(study, planned.trials, first, None, draw) for draw in draws}
    assert drawn == {(first.index, first.index)}
    order = [*(trial.index for trial in others), first.index]
    rules = [problem.rule for problem in order_problems(study, planned, order)]
    assert rules == ["a catch trial must not open a block"]
