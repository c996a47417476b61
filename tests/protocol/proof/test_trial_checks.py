"""The independent check of plans: every change to a plan is detected and named."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import pytest

from protocol.plan.plan import plan
from protocol.plan.trials import Plan, Trial, session_s
from protocol.proof.trial_checks import cohort_problems, plan_problems, plan_s
from protocol.study_file.loading import parsed_study, template
from tests.protocol.studies import rated, small

STUDY = parsed_study(template("extended"))
PLAN = plan(STUDY, 0)
Change = Callable[[Trial], Trial]


def changed(where: Callable[[Trial], bool], change: Change) -> Plan:
    """The plan with one trial changed: the first for which `where` holds."""
    index = next(trial.index for trial in PLAN.trials if where(trial))
    trials = list(PLAN.trials)
    trials[index] = change(trials[index])
    return replace(PLAN, trials=tuple(trials))


def reordered(order: list[int]) -> Plan:
    trials = tuple(replace(PLAN.trials[old], index=new) for new, old in enumerate(order))
    names = tuple(trial.condition or "" for trial in trials if trial.kind == "trial")
    return replace(PLAN, trials=trials, sequence=names)


def louder(trial: Trial) -> Trial:
    touch = trial.touches[0].model_copy(update={"voltage_v": 201.0})
    return replace(trial, touches=(touch, *trial.touches[1:]))


def elsewhere(trial: Trial) -> Trial:
    touch = trial.touches[0].model_copy(update={"beam": "nowhere"})
    return replace(trial, touches=(touch, *trial.touches[1:]))


def faster(trial: Trial) -> Trial:
    touch = trial.touches[0].model_copy(update={"frequency": 1.7})
    return replace(trial, touches=(touch, *trial.touches[1:]))


def longer(trial: Trial) -> Trial:
    touch = trial.touches[0].model_copy(update={"voltage_v": 1.0, "duration_s": 31.0})
    return replace(trial, touches=(touch, *trial.touches[1:]))


CASES: list[tuple[Callable[[Trial], bool], Change, str]] = [
    (lambda t: t.kind == "trial", louder, "amplitude, V, must not exceed 200, got 201"),
    (lambda t: t.kind == "trial", faster, "frequency, Hz, must not exceed 40000, got 41175.7"),
    (lambda t: t.kind == "trial", longer, "drive, s, must not exceed 30, got 34"),
    (lambda t: t.kind == "trial", elsewhere, "a beam must be one of the study's, got 'nowhere'"),
    (lambda t: t.kind == "catch", louder, "a catch trial must stay at 0 V"),
    (lambda t: t.kind == "trial", lambda t: replace(t, level=0.3), "the level must be one of"),
    (lambda t: t.opposite, lambda t: replace(t, opposite=False), "in the opposite order 1 times"),
    (lambda t: t.opposite, lambda t: replace(t, touches=t.touches[::-1]), "touches must be the"),
    (lambda t: t.kind == "trial", lambda t: replace(t, expected="same"), "expected answer must"),
    (lambda t: t.kind == "trial", lambda t: replace(t, question=None), "its condition's question"),
    (lambda t: t.kind == "trial", lambda t: replace(t, scored=False), "must be scored"),
    (lambda t: t.kind == "trial", lambda t: replace(t, condition="x"), "name a condition .* 'x'"),
    (lambda t: t.kind == "trial", lambda t: replace(t, block=9), "blocks must be numbered"),
    (lambda t: t.kind == "trial", lambda t: replace(t, index=0), "trials must be numbered"),
    (lambda t: t.kind == "catch", lambda t: replace(t, kind="trial"), "must come 4 times"),
    (lambda t: t.kind == "catch", lambda t: replace(t, kind="practice"), "practice must be trials"),
    (lambda t: t.break_s > 0, lambda t: replace(t, break_s=0.0), "breaks must come every 2 blocks"),
    (lambda t: t.kind == "signal", lambda t: replace(t, touches=()), "begin with the study's open"),
    (
        lambda t: t.kind == "signal",
        lambda t: replace(t, scored=True),
        "match the study file and not be scored",
    ),
    (lambda t: t.kind == "signal", lambda t: replace(t, level=0.5), "match the study file and not"),
    (lambda t: t.kind == "catch", elsewhere, "must need only the mounted beam, got trial"),
]


@pytest.mark.parametrize(("where", "change", "message"), CASES)
def test_a_changed_trial_is_detected(
    where: Callable[[Trial], bool], change: Change, message: str
) -> None:
    assert plan_problems(STUDY, PLAN) == []
    found = "\n".join(map(str, plan_problems(STUDY, changed(where, change))))
    with pytest.raises(AssertionError, match=message):
        raise AssertionError(found)


def test_every_exchange_of_two_trials_is_detected() -> None:
    """Trials of a block may be exchanged unless this violates a requirement on their order."""
    length = len(PLAN.trials)
    for first in range(length):
        for second in range(first + 1, length):
            order = list(range(length))
            order[first], order[second] = second, first
            one, other = PLAN.trials[first], PLAN.trials[second]
            found = plan_problems(STUDY, reordered(order))
            assert found or (one.block == other.block and {one.kind, other.kind} <= FREE), order


FREE = {"trial", "catch", "practice"}


def test_a_missing_trial_is_detected() -> None:
    for missing in range(len(PLAN.trials)):
        order = [index for index in range(len(PLAN.trials)) if index != missing]
        assert plan_problems(STUDY, reordered(order))


def test_an_unbalanced_cohort_is_detected() -> None:
    plans = [plan(STUDY, slot) for slot in range(10)]
    assert cohort_problems(STUDY, plans) == []
    twice = [*plans[:9], replace(plans[0], slot=9)]
    found = cohort_problems(STUDY, twice)
    assert [problem.rule for problem in found] == [
        "every condition must follow every other equally often"
    ]


def test_equal_neighbours_are_detected() -> None:
    study = small(2, repeats=2, max_alike_in_row=1)
    good = plan(study, 0)
    order = [0, 1, 3, 2]
    trials = tuple(
        replace(good.trials[old], index=new, block=good.trials[new].block)
        for new, old in enumerate(order)
    )
    bad = replace(good, trials=trials, sequence=tuple(trial.condition or "" for trial in trials))
    assert any(a == b for a, b in pairwise(bad.sequence))
    rules = [problem.rule for problem in plan_problems(study, bad)]
    assert rules == ["a condition must not come more than 1 x in a row"]


def test_another_order_than_the_fixed_one_is_detected() -> None:
    fixed, free = (small(3, order=order) for order in ("fixed", "random"))
    plans = [plan(free, slot) for slot in range(6)]
    found = {problem.rule for one in plans for problem in plan_problems(fixed, one)}
    assert found == {"a fixed order must be that of the study file"}
    assert plan_problems(fixed, plan(fixed, slot=0)) == []


def test_scattered_beams_are_detected() -> None:
    free, grouped = (
        small(3, beams=2, repeats=2, **design)
        for design in ({}, {"group_by_beam": "session", "max_beam_swaps": 2})
    )
    plans = [plan(free, slot) for slot in range(6)]
    rules = {problem.rule for one in plans for problem in plan_problems(grouped, one)}
    assert "trials on the same beams must be grouped within each session" in rules
    assert "at most 2 beam swaps are allowed" in rules


def test_a_scored_trial_of_no_condition_is_a_problem_where_trials_are_grouped() -> None:
    design = STUDY.design.model_copy(update={"group_by_beam": "block"})
    broken = changed(lambda t: t.kind == "baseline", lambda t: replace(t, kind="trial"))
    found = plan_problems(STUDY.model_copy(update={"design": design}), broken)
    assert any("every condition must come" in str(problem) for problem in found)


def test_a_plan_without_trials_is_a_problem() -> None:
    assert plan_problems(STUDY, replace(PLAN, trials=()))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: replace(t, question="roughness"), "must ask its condition's question"),
        (lambda t: replace(t, expected="same"), r"the expected answer must be one of \['None'\]"),
        (lambda t: replace(t, scored=not t.scored), "all but catch trials must be scored"),
        (lambda t: replace(t, opposite=True), "must come in the opposite order 0 times"),
    ],
)
@pytest.mark.parametrize("kind", ["trial", "catch"])
def test_a_changed_trial_that_is_rated_is_detected(kind: str, change: Change, message: str) -> None:
    study = rated(3, repeats=2, catch_trials=2)
    good = plan(study, 0)
    assert plan_problems(study, good) == []
    assert plan_s(study, good) == pytest.approx(session_s(study, good))
    at = next(trial.index for trial in good.trials if trial.kind == kind)
    trials = (change(trial) if trial.index == at else trial for trial in good.trials)
    wrong = replace(good, trials=tuple(trials))
    with pytest.raises(AssertionError, match=message):
        raise AssertionError("\n".join(map(str, plan_problems(study, wrong))))
