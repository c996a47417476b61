"""Plans: their trials, and their orders over the cohort."""

from collections import Counter
from itertools import pairwise

import pytest
from hypothesis import given, settings
from scipy.stats import chisquare

from protocol.plan.plan import plan
from protocol.plan.trials import session_s
from protocol.proof.trial_checks import balance_guaranteed, carry_over, cohort_problems, cycle
from protocol.study.study import Study
from protocol.study_file.limits import problems
from protocol.study_file.loading import parsed_study, template
from tests.protocol.studies import Document, documents, rated, small

STUDY = parsed_study(template("paper"))
EXTENDED = parsed_study(template("extended"))


def reseeded(study: Study, seed: int) -> Study:
    return study.model_copy(update={"study": study.study.model_copy(update={"seed": seed})})


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


def test_a_slot_always_has_the_same_plan() -> None:
    assert plan(EXTENDED, slot=3) == plan(EXTENDED, slot=3)


def test_a_seed_gives_the_same_plan_on_every_platform() -> None:
    """Regression: our own orders; a change here changes every study that has already begun."""
    assert plan(STUDY, 0).sequence == GOLDEN_PAPER
    catches = [trial.index for trial in plan(EXTENDED, 0).trials if trial.kind == "catch"]
    assert catches == [9, 16, 21, 28]


GOLDEN_PAPER = ("structure", "voltage", "direction", "frequency", "pressure")


def test_another_seed_or_session_gives_another_allocation() -> None:
    other = reseeded(STUDY, 2)
    orders = [plan(STUDY, slot).sequence for slot in range(10)]
    assert orders != [plan(other, slot).sequence for slot in range(10)]
    assert orders != [plan(STUDY, slot, session=2).sequence for slot in range(10)]


def test_a_fixed_order_is_the_order_of_the_file() -> None:
    fixed = parsed_study(template("paper").replace('order = "williams"', 'order = "fixed"'))
    assert plan(fixed, slot=7).sequence == fixed.conditions


@pytest.mark.parametrize("change", ["catch_trials", "practice_trials", "opposite_repeats"])
def test_each_purpose_has_its_own_random_stream(change: str) -> None:
    """Changing how one thing is drawn leaves the orders and levels of the scored trials alone."""
    changed = EXTENDED.model_copy(update={"design": EXTENDED.design.model_copy(update={change: 2})})
    for slot in range(5):
        before, after = (
            [t for t in plan(study, slot).trials if t.kind == "trial"]
            for study in (EXTENDED, changed)
        )
        assert [(t.condition, t.level) for t in before] == [(t.condition, t.level) for t in after]


@pytest.mark.parametrize("repeats", range(1, 9))
@pytest.mark.parametrize("conditions", range(2, 13))
def test_carry_over_is_balanced_where_guaranteed_and_counted_elsewhere(
    conditions: int, repeats: int
) -> None:
    study = small(conditions, repeats=repeats)
    plans = [plan(study, slot) for slot in range(40)]
    whole = conditions if conditions % 2 == 0 else 2 * conditions
    for participants in range(1, 41):
        assert balance_guaranteed(study, participants) == (participants % whole == 0)
    for participants in {1, 2, 9, 40, *range(whole, 41, whole)}:
        report = carry_over(study, plans[:participants])
        assert report.balanced or not report.guaranteed
        assert sum(map(sum, report.counts)) == participants * repeats * (conditions - 1)
        assert report.balanced == (report.imbalance == 0)
    assert cohort_problems(study, plans) == []


def test_a_slots_order_is_uniform_over_seeds() -> None:
    orders = Counter(plan(reseeded(small(4), seed), slot=7).sequence for seed in range(10_000))
    assert len(orders) == 24
    assert chisquare(list(orders.values())).pvalue > 1e-3


def test_levels_and_opposites_are_uniform() -> None:
    seen: Counter[tuple[float, bool]] = Counter()
    for slot in range(2_000):
        trials = [t for t in plan(EXTENDED, slot).trials if t.condition == "pressure"]
        first = next(trial for trial in trials if trial.kind == "trial")
        seen[first.level, first.opposite] += 1
    wanted = [2_000 / 4 * (1 / 4 if opposite else 3 / 4) for _, opposite in seen]
    assert len(seen) == 8
    assert chisquare(list(seen.values()), wanted).pvalue > 1e-3


@settings(max_examples=200, deadline=None)
@given(documents())
def test_plans_of_an_accepted_study_keep_its_limits_and_constraints(
    document: Document,
) -> None:
    study = Study.model_validate(document)
    if problems(study):
        return
    assert cohort_problems(study, [plan(study, slot) for slot in range(3)]) == []
    slots = cycle(study, 14)
    assert cohort_problems(study, [plan(study, slot) for slot in slots], slots.start) == []


def test_conditions_without_a_question_have_trials_that_are_rated_also_at_0_v() -> None:
    study = rated(3, repeats=2, catch_trials=2, practice_trials=1)
    trials = plan(study, 0).trials
    assert {trial.kind for trial in trials} == {"practice", "trial", "catch"}
    assert all(trial.rated and trial.question is trial.expected is None for trial in trials)
    assert [trial.scored for trial in trials] == [trial.kind != "catch" for trial in trials]
    asked = small(3, repeats=2, catch_trials=2, practice_trials=1)
    assert not any(trial.rated for trial in plan(asked, 0).trials)
    # One question less in each trial, and a score in each catch trial, too.
    timing = study.timing
    fewer_s = len(trials) * timing.answer_s - 2 * timing.score_s
    assert session_s(study, plan(study, 0)) == pytest.approx(
        session_s(asked, plan(asked, 0)) - fewer_s
    )
