"""Feasibility: constraints that cannot be met are reported, and all others can be met."""

import pytest

from protocol.plan.feasibility import most_session_s
from protocol.plan.orders import grouping, most_swaps
from protocol.plan.plan import plan
from protocol.plan.trials import plan_swaps, session_s
from protocol.proof.trial_checks import plan_problems, plan_s
from protocol.study.study import Study
from protocol.study_file.limits import problems
from protocol.study_file.loading import parsed_study, template
from tests.protocol.studies import small, small_document


@pytest.mark.parametrize(
    ("study", "message"),
    [
        (small(1, repeats=3), r"max_alike_in_row: the only condition comes up to 3 .* got 2"),
        (
            small(3, repeats=2, catch_trials=4, catch_apart=2),
            "must be at most 3, so that .* apart .* in every order that may be drawn, got 4",
        ),
        (small(3, 3, repeats=8, max_beam_swaps=1), "may need 2 beam swaps, .*: session, got 1"),
        (
            small(2, 2, repeats=3, group_by_beam="session"),
            "a condition alone on its beams comes up to 3 times in a row",
        ),
        (
            small(2, 2, repeats=3, group_by_beam="block", max_alike_in_row=1),
            "comes up to 2 times in a row .grouped by beam: block., got 1",
        ),
        (small(3, 2, order="fixed", group_by_beam="block"), "'no' if order = 'fixed', got 'block'"),
        (small(10, 10, group_by_beam="block"), "at most 8 sets of beams can be grouped, got 10"),
    ],
)
def test_an_infeasible_constraint_is_reported(study: Study, message: str) -> None:
    found = "\n".join(map(str, problems(study)))
    with pytest.raises(AssertionError, match=message):
        raise AssertionError(found)


@pytest.mark.parametrize(("catches", "allowed"), [(4, True), (5, False)])
def test_catch_trials_are_counted_in_a_fixed_order(catches: int, allowed: bool) -> None:
    document = small_document(
        4, order="fixed", repeats=4, catch_trials=catches, catch_apart=3, max_alike_in_row=1
    )
    for condition in document["condition"][1:]:
        condition["touches"] *= 2
        condition["touches"][1] = {**condition["touches"][1], "beam": "b1"}
    document["beams"]["b1"] = 0.001
    study = Study.model_validate(document)
    found = problems(study)
    assert (not found) == allowed
    if allowed:
        assert not plan_problems(study, plan(study, 0))
    else:
        assert (
            "must be at most 4, so that catch trials stay catch_apart = 3 trials apart and follow "
            "a trial on one beam, got 5"
        ) in str(found[0])


def test_levels_must_divide_the_repeats() -> None:
    document = small_document(2, repeats=3)
    document["condition"][1]["levels"] = [0.5, 1.0]
    (found,) = problems(Study.model_validate(document))
    assert str(found).startswith("condition c1, levels: their number must divide")
    assert found.value == "2"


def test_opposites_need_a_change_of_touch() -> None:
    document = small_document(1, repeats=2, opposite_repeats=1)
    document["condition"][0]["touches"] = [{"place": "smooth", "voltage_v": 50}]
    (found,) = problems(Study.model_validate(document))
    assert str(found).startswith("design.opposite_repeats: must be 0 if no condition has an opp")


@pytest.mark.parametrize(
    ("fewest", "sessions", "refused"), [(6, 1, False), (7, 1, True), (12, 2, False)]
)
def test_min_trials_cannot_exceed_the_planned_trials(
    fewest: int, sessions: int, refused: bool
) -> None:
    document = small_document(3, repeats=2, sessions=sessions)
    document["exclusions"] = {"min_trials": fewest}
    found = problems(Study.model_validate(document))
    message = "exclusions.min_trials: must be at most 6, the number of trials of a participant"
    assert [str(problem).startswith(message) for problem in found] == [True] * refused


def test_a_session_that_is_too_long_is_refused() -> None:
    text = template("extended").replace("max_session_s = 5400", "max_session_s = 1500")
    with pytest.raises(ValueError, match="a session may take 1735 s, got 1500 s"):
        parsed_study(text)


@pytest.mark.parametrize("max_swaps", [None, 12, 8, 4, 3])
def test_plans_keep_max_beam_swaps(max_swaps: int | None) -> None:
    study = small(4, 3, repeats=2, max_beam_swaps=max_swaps)
    if problems(study):
        assert max_swaps is not None
        assert most_swaps(study, "session") > max_swaps
        return
    swaps = [plan_swaps(study, plan(study, slot)) for slot in range(20)]
    assert max(swaps) <= most_swaps(study, grouping(study))
    assert max_swaps is None or max(swaps) <= max_swaps


def test_grouping_needs_the_fewest_possible_swaps() -> None:
    study = small(6, 3, repeats=4, group_by_beam="session", max_alike_in_row=4)
    assert problems(study) == []
    assert {plan_swaps(study, plan(study, slot)) for slot in range(20)} == {2}
    by_block = small(6, 3, repeats=4, group_by_beam="block")
    assert {plan_swaps(by_block, plan(by_block, slot)) for slot in range(20)} == {8}


@pytest.mark.parametrize("channel", ["", "\n[force_channel]\nrate_hz = 1000\n"])
@pytest.mark.parametrize("name", ["paper", "extended"])
def test_durations_agree_with_the_independent_count(name: str, channel: str) -> None:
    study = parsed_study(template(name) + channel)
    for slot in range(10):
        drawn = plan(study, slot)
        assert session_s(study, drawn) == pytest.approx(plan_s(study, drawn))
        assert session_s(study, drawn) <= most_session_s(study)
        assert plan_problems(study, drawn) == []


def test_a_tare_before_each_recorded_touch_takes_its_time() -> None:
    plain, recorded = (
        parsed_study(template("paper") + channel)
        for channel in ("", "\n[force_channel]\nrate_hz = 1000\n")
    )
    touches = sum(len(trial.touches) for trial in plan(plain, 0).trials)
    more_s = session_s(recorded, plan(recorded, 0)) - session_s(plain, plan(plain, 0))
    assert more_s == pytest.approx(0.5 * touches)


def test_the_paper_session_takes_a_few_minutes() -> None:
    study = parsed_study(template("paper"))
    assert 4 * 60 < session_s(study, plan(study, 0)) < 8 * 60
