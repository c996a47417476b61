"""The independent check of a plan's limits: each is allowed up to its value and no further."""

from collections.abc import Mapping
from math import pi
from typing import Any

import pytest

from protocol.plan.plan import plan
from protocol.plan.trials import Plan
from protocol.proof.trial_checks import limit_violations, plan_s
from protocol.study.study import Study
from tests.protocol.studies import small, small_document

RESONANCE_HZ = 25_000.0
SLEW = 2e-6 * pi * 30_000 * 120
"""Of 120 V at 1.2 times the resonance, V/us."""
GENEROUS = {
    "nominal_resonance_hz": RESONANCE_HZ,
    "max_frequency_hz": 100_000.0,
    "max_slew_v_per_us": 1_000.0,
    "max_drive_s": 600.0,
    "generator_max_vpp": 100.0,
    "amplifier_gain": 20.0,
    "capacitance_nf": 2.0,
    "max_current_ma": 10_000.0,
}
RISING = {"voltage_v": 80, "ramp_to_v": 120, "frequency": 0.8, "sweep_to": 1.2}
FALLING = {"voltage_v": 120, "ramp_to_v": 80, "frequency": 1.2, "sweep_to": 0.8}


def of_one_touch(touch: Mapping[str, float], **rig: float | None) -> tuple[Study, Plan]:
    """A study whose only touch takes 2 s, on a generous rig with these limits instead."""
    document = small_document(1)
    document["touch"] |= {"lead_in_s": 0}
    document["condition"][0]["touches"] = [{"place": "smooth", "duration_s": 2, **touch}]
    study = Study.model_validate(document)
    changed = study.rig.model_copy(update={**GENEROUS, **rig})
    study = study.model_copy(update={"rig": changed})
    return study, plan(study, 0)


def rules(study: Study, orders: Plan) -> set[str]:
    """The limits that are exceeded, without their values."""
    return {rule.partition(" must not")[0] for rule, _ in limit_violations(study, orders)}


@pytest.mark.parametrize(
    ("touch", "name", "value", "rule"),
    [
        (RISING, "max_voltage_v", 120, "amplitude, V,"),
        (FALLING, "max_voltage_v", 120, "amplitude, V,"),
        (RISING, "max_frequency_hz", 30_000, "frequency, Hz,"),
        (FALLING, "max_frequency_hz", 30_000, "frequency, Hz,"),
        (RISING, "max_slew_v_per_us", SLEW, "slew, V/us,"),
        (FALLING, "ramp_v_per_s", 20, "ramp, V/s,"),
        (RISING, "ramp_v_per_s", 20, "ramp, V/s,"),
        (RISING, "max_drive_s", 2 + 80 / 400, "drive, s,"),
        (FALLING, "max_drive_s", 2 + 120 / 400, "drive, s,"),
        (RISING, "generator_max_vpp", 2 * 120 / 20, "generator, V peak-to-peak,"),
        (RISING, "max_current_ma", 2 * SLEW, "current, mA,"),
    ],
)
def test_a_limit_is_allowed_and_nothing_beyond_it(
    touch: dict[str, float], name: str, value: float, rule: str
) -> None:
    for limit in (value, value * (1 - 5e-13)):  # rounding is no excess
        assert rules(*of_one_touch(touch, **{name: limit})) == set()
    assert rules(*of_one_touch(touch, **{name: value * (1 - 1e-11)})) == {rule}


def test_the_last_value_that_rounding_allows_is_allowed() -> None:
    limit = 120 / (1 + 1e-12)
    assert limit * (1 + 1e-12) == 120
    assert rules(*of_one_touch(RISING, max_voltage_v=limit)) == set()


def test_an_excess_is_told_with_its_value_and_trial() -> None:
    study, orders = of_one_touch(RISING, max_voltage_v=119.0)
    assert list(limit_violations(study, orders)) == [
        ("amplitude, V, must not exceed 119", "120 in trial 0")
    ]


@pytest.mark.parametrize(
    "unknown",
    [
        {"amplifier_gain": None, "generator_max_vpp": 0.1},
        {"capacitance_nf": None, "max_current_ma": 0.1},
        {"max_current_ma": None},
    ],
)
def test_what_is_not_known_is_not_limited(unknown: dict[str, float | None]) -> None:
    assert rules(*of_one_touch(RISING, **unknown)) == set()


def test_a_touch_at_0_v_is_not_driven_for_any_time() -> None:
    assert rules(*of_one_touch({"voltage_v": 0, "duration_s": 30}, max_drive_s=1e-6)) == set()


@pytest.mark.parametrize(("lead_in_s", "taken_s"), [(0.1, 0.2), (0.2, 0.2), (3.0, 3.0)])
def test_the_lead_in_is_driven_and_holds_the_soft_start(lead_in_s: float, taken_s: float) -> None:
    study, orders = of_one_touch({"voltage_v": 80})
    finger = study.touch.model_copy(update={"lead_in_s": lead_in_s})
    for limit_s, exceeded in ((taken_s + 2, set()), (taken_s + 1.99, {"drive, s,"})):
        rig = study.rig.model_copy(update={"max_drive_s": limit_s})
        limited = study.model_copy(update={"rig": rig, "touch": finger})
        assert rules(limited, orders) == exceeded


@pytest.mark.parametrize(("place", "taken_s"), [("smooth", 3.0), ("path", 0.0625 / 0.025)])
def test_a_touch_takes_its_place_unless_the_study_says_how_long(place: str, taken_s: float) -> None:
    document = small_document(1)
    document["touch"] |= {
        "lead_in_s": 0,
        "hold_s": 3,
        "path_m": [0.0125, 0.075],
        "sliding_speed_m_s": 0.025,
    }
    direction = {"direction": "right"} if place == "path" else {}
    document["condition"][0]["touches"] = [{"place": place, "voltage_v": 80, **direction}]
    study = Study.model_validate(document)
    for limit_s, exceeded in ((taken_s + 0.2, set()), (taken_s + 0.19, {"drive, s,"})):
        rig = study.rig.model_copy(update={"max_drive_s": limit_s})
        limited = study.model_copy(update={"rig": rig})
        assert rules(limited, plan(limited, 0)) == exceeded


def of_session_s(study: Study, max_session_s: float) -> Study:
    timing = study.timing.model_copy(update={"max_session_s": max_session_s})
    return study.model_copy(update={"timing": timing})


def test_a_session_may_take_its_time_and_no_longer() -> None:
    study = small(2, beams=2, repeats=2, practice_trials=1, catch_trials=1)
    orders = plan(study, 0)
    total_s = plan_s(study, orders)
    for allowed_s in (total_s, total_s * (1 - 5e-13), total_s / (1 + 1e-12)):
        assert rules(of_session_s(study, allowed_s), orders) == set()
    ((rule, value),) = limit_violations(of_session_s(study, total_s * (1 - 1e-11)), orders)
    assert rule == f"a session must not take more than {total_s:g} s"
    assert value == f"{total_s:.0f} s"


def test_the_parts_of_a_session_add_up() -> None:
    """Two touches on two beams, one of them scored, counted by hand."""
    document = small_document(1, beams=1)
    document["beams"]["b1"] = 0.001
    document["touch"] |= {"lead_in_s": 0.5}
    document["condition"][0]["touches"] = [
        {"place": "smooth", "voltage_v": 0, "duration_s": 2},
        {"place": "smooth", "voltage_v": 80, "duration_s": 4, "beam": "b1"},
    ]
    study = Study.model_validate(document)
    timing = study.timing.model_copy(
        update={
            "beam_swap_s": 1e6,
            "inter_trial_s": 1e5,
            "answer_s": 1e4,
            "score_s": 1e3,
            "between_touches_s": 100.0,
            "reading_s": 10.0,
        }
    )
    study = study.model_copy(update={"timing": timing})
    orders = plan(study, 0)
    assert len(orders.trials) == 1
    trial = orders.trials[0]
    assert trial.scored
    assert trial.break_s == 0
    assert plan_s(study, orders) == 1e6 + 1e5 + 1e4 + 1e3 + 100 + 2 * 10 + 2 + 4 + 2 * 0.5


@pytest.mark.parametrize(
    ("given", "session", "read", "asked"),
    [
        ({}, 1, 0, 0),
        ({"page": {}}, 1, 1, 0),
        ({"page": {"before": "practice"}}, 1, 1, 0),
        ({"page": {"before": "block"}}, 1, 3, 0),
        ({"page": {"before": "block", "block": 3}}, 1, 1, 0),
        ({"page": {"before": "block", "block": 4}}, 1, 0, 0),
        ({"question": {"when": "before"}}, 1, 0, 1),
        ({"question": {"when": "after"}}, 1, 0, 1),
        ({"question": {"when": "after"}}, 2, 0, 1),
        ({"question": {"when": "after", "sessions": "first"}}, 1, 0, 1),
        ({"question": {"when": "after", "sessions": "first"}}, 2, 0, 0),
        ({"question": {"when": "block"}}, 1, 0, 3),
        ({"question": {"when": "trial"}}, 1, 0, 9),
        ({"question": {"when": "trial", "conditions": ["c1"]}}, 1, 0, 3),
    ],
)
@pytest.mark.parametrize("openings", [0, 1])
def test_what_is_read_and_asked_takes_its_time(
    given: dict[str, Any], session: int, read: int, asked: int, openings: int
) -> None:
    """Three blocks of three trials, compared with a study that asks no more."""
    document = small_document(3, repeats=3, sessions=2)
    document["timing"] |= {"reading_s": 1, "answer_s": 100}
    baseline = {"kind": "baseline", "touches": [{"place": "smooth", "voltage_v": 0}]}
    document["opening"] = [baseline] * openings
    named = {"name": "q", "kind": "text"}
    of_kind = {"page": {"text": {"en": "?"}}, "question": {"text": {"en": "?"}, **named}}
    more = {kind: [part | of_kind[kind]] for kind, part in given.items()}
    plain, study = Study.model_validate(document), Study.model_validate(document | more)
    plain_s, study_s = (plan_s(each, plan(each, 0, session)) for each in (plain, study))
    assert study_s - plain_s == pytest.approx(read + 100 * asked)


def test_swaps_of_beams_are_counted_from_the_one_that_is_mounted_at_first() -> None:
    document = small_document(3, beams=2, order="fixed", repeats=1)
    study = Study.model_validate(document)
    orders = plan(study, 0)
    for allowed, exceeded in ((1, set()), (0, {"at most 0 beam swaps are allowed"})):
        design = study.design.model_copy(update={"max_beam_swaps": allowed})
        limited = study.model_copy(update={"design": design})
        assert rules(limited, orders) == exceeded
