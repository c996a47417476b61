"""What a study may ask of its rig: each limit up to its value and no further."""

from math import inf, nextafter, pi
from typing import Any

import pytest

from protocol.errors import Problem
from protocol.plan.plan import slide_plan, slide_study
from protocol.plan.trials import session_s
from protocol.study.rig_settings import Rig
from protocol.study.study import Study
from protocol.study.touch import Slide
from protocol.study_file.limits import (
    limit_problems,
    max_resonance_hz,
    problems,
    problems_at,
    slide_problems,
)
from tests.protocol.studies import Document, small, small_document

RESONANCE_HZ = 25_000.0
SLEW = 2 * pi * 30_000 * 120 * 1e-6
"""Of 120 V at 1.2 times the resonance, V/us."""
GENEROUS = {
    "nominal_resonance_hz": RESONANCE_HZ,
    "max_frequency_hz": 100_000.0,
    "max_slew_v_per_us": 1_000.0,
    "max_drive_s": 600.0,
    "ramp_v_per_s": 400.0,
    "generator_max_vpp": 100.0,
    "amplifier_gain": 20.0,
    "capacitance_nf": 2.0,
    "max_current_ma": 10_000.0,
}
# At the highest level, 1.25, these go from 80 V to 120 V and back.
RISING = {"voltage_v": 64, "ramp_to_v": 96, "frequency": 0.8, "sweep_to": 1.2}
FALLING = {"voltage_v": 96, "ramp_to_v": 64, "frequency": 1.2, "sweep_to": 0.8}


def document_of(touch: Document) -> Document:
    """A study whose second touch is this one, for 2 s."""
    document = small_document(1)
    document["touch"]["lead_in_s"] = 0
    quiet = {"place": "smooth", "voltage_v": 0}
    document["condition"][0] |= {
        "touches": [quiet, {"place": "smooth", "duration_s": 2, **touch}],
        "levels": [1.25, 0.5],
    }
    document["design"] = {"repeats": 2}
    return document


def study_of(touch: Document, **rig: float | None) -> Study:
    """The same on a generous rig, with these limits instead."""
    study = Study.model_validate(document_of(touch))
    return study.model_copy(update={"rig": study.rig.model_copy(update={**GENEROUS, **rig})})


@pytest.mark.parametrize(
    ("touch", "name", "value", "rule", "key"),
    [
        (RISING, "max_voltage_v", 120, "the amplitude", "ramp_to_v"),
        (FALLING, "max_voltage_v", 120, "the amplitude", "voltage_v"),
        ({"voltage_v": 96}, "max_voltage_v", 120, "the amplitude", "voltage_v"),
        (RISING, "max_frequency_hz", 30_000, "the drive", "sweep_to"),
        (FALLING, "max_frequency_hz", 30_000, "the drive", "frequency"),
        (
            {"voltage_v": 96, "frequency": 1.2}, "max_frequency_hz", 30_000, "the drive",
            "frequency",
        ),
        (RISING, "max_slew_v_per_us", SLEW, "2 pi f V", "voltage_v"),
        (RISING, "ramp_v_per_s", 20, "a ramp", "ramp_to_v"),
        (FALLING, "ramp_v_per_s", 20, "a ramp", "ramp_to_v"),
        (RISING, "max_drive_s", 2 + 80 / 400, "a touch", "duration_s"),
        (FALLING, "max_drive_s", 2 + 120 / 400, "a touch", "duration_s"),
        (RISING, "generator_max_vpp", 12, "2 x amplitude / amplifier_gain", "voltage_v"),
        (RISING, "max_current_ma", SLEW * 2, "2 pi f C V", "voltage_v"),
    ],
)  # fmt: skip
def test_a_limit_is_allowed_and_nothing_beyond_it(
    touch: Document, name: str, value: float, rule: str, key: str
) -> None:
    assert limit_problems(study_of(touch, **{name: value})) == []
    (found,) = limit_problems(study_of(touch, **{name: nextafter(value, 0)}))
    assert found.rule.startswith(f"{rule} must not ")
    assert found.where == "condition c0, touch 2"
    assert found.path == ("condition", 0, "touches", 1, key)


def the_only(found: list[Problem]) -> Problem:
    (problem,) = found
    return problem


@pytest.mark.parametrize(
    ("rig", "value", "hint"),
    [
        ({"max_voltage_v": 100}, "120 V", "120 V peak-to-peak is 60 V"),
        ({"max_frequency_hz": 29_000}, "30000 Hz", "relative to the resonance"),
        ({"max_slew_v_per_us": 20}, "22.62 V/us", "lower the amplitude"),
        ({"ramp_v_per_s": 19}, "20 V/s", "let the touch last longer"),
        ({"max_drive_s": 2}, "2.2 s", "shorten"),
        ({"generator_max_vpp": 11}, "12 V", "half of its peak-to-peak"),
        ({"max_current_ma": 40}, "45.24 mA", "lower the amplitude"),
    ],
)
def test_an_excess_is_told_with_its_value(rig: dict[str, float], value: str, hint: str) -> None:
    found = the_only(limit_problems(study_of(RISING, **rig)))
    assert found.value == value
    assert hint in found.hint


@pytest.mark.parametrize(
    "unknown",
    [
        {"amplifier_gain": None, "generator_max_vpp": 0.1},
        {"capacitance_nf": None, "max_current_ma": 0.1},
        {"max_current_ma": None},
    ],
)
def test_what_is_not_known_is_not_limited(unknown: dict[str, float | None]) -> None:
    assert limit_problems(study_of(RISING, **unknown)) == []


def test_a_finger_may_press_with_20_n_and_no_more() -> None:
    document = document_of({"voltage_v": 0, "press": 2.0})
    document["touch"]["force_n"] = 10
    assert limit_problems(Study.model_validate(document)) == []
    document["condition"][0]["touches"][1]["press"] = nextafter(2.0, 3)
    found = the_only(limit_problems(Study.model_validate(document)))
    assert found.rule == "press x touch.force_n must not exceed 20 N"
    assert found.value == "20.000000000000004 N"
    assert found.path[-1] == "press"


def test_a_touch_at_0_v_may_last() -> None:
    assert limit_problems(study_of({"voltage_v": 0, "duration_s": 60}, max_drive_s=1)) == []


def test_an_opening_is_checked_as_it_stands() -> None:
    document = document_of({"voltage_v": 0})
    document["opening"] = [
        {"kind": "baseline", "touches": [{"place": "smooth", "voltage_v": 0}]},
        {"kind": "signal", "touches": [{"place": "smooth", "voltage_v": 160}]},
    ]
    document["rig"] = {"max_voltage_v": 160}
    assert limit_problems(Study.model_validate(document)) == []
    document["rig"] = {"max_voltage_v": 159}
    found = the_only(limit_problems(Study.model_validate(document)))
    assert found.where == "opening signal, touch 1"
    assert found.path == ("opening", 1, "touches", 0, "voltage_v")


def beams_of(first: str | None, touched: str | None, known: list[str]) -> list[Problem]:
    document = document_of({"voltage_v": 0, "beam": touched} if touched else {"voltage_v": 0})
    document["touch"] = {"beam": first} if first else {}
    document["beams"] = dict.fromkeys(known, 0.001)
    return limit_problems(Study.model_validate(document))


def test_a_beam_is_one_of_the_studys() -> None:
    assert beams_of("b0", "b1", ["b0", "b1"]) == []
    assert beams_of("b0", None, ["b0"]) == []
    assert beams_of(None, None, []) == []
    found = the_only(beams_of("b0", "b2", ["b0", "b1"]))
    assert (found.where, found.value) == ("condition c0, touch 2", "'b2'")
    assert found.hint == "known: b0, b1"
    assert found.path == ("condition", 0, "touches", 1, "beam")
    found = the_only(beams_of("b0", None, []))
    assert found.where == "touch.beam"
    assert found.hint.startswith("name it in [beams] with the spacing of")
    assert found.path == ("touch", "beam")


def test_a_study_that_swaps_beams_says_which_is_mounted_at_first() -> None:
    found = the_only(beams_of(None, "b1", ["b0", "b1"]))
    assert found.rule == "must be given when a touch names a beam"
    assert (found.hint, found.path) == ("one of b0, b1", ("touch", "beam"))


@pytest.mark.parametrize(
    ("dialect", "gain", "is_asked_for"),
    [("board", None, False), ("rigol", 20.0, False), ("rigol", None, True), ("board", 20.0, False)],
)
def test_a_generator_needs_its_gain(dialect: str, gain: float | None, is_asked_for: bool) -> None:
    study = study_of({"voltage_v": 0}, amplifier_gain=gain)
    rig = study.rig.model_copy(update={"dialect": dialect})
    found = limit_problems(study.model_copy(update={"rig": rig}))
    assert [problem.where for problem in found] == ["rig.amplifier_gain"] * is_asked_for


def test_the_design_is_looked_at_once_nothing_else_is_wrong() -> None:
    infeasible = small(1, repeats=3)
    (design,) = problems(infeasible)
    assert design.where == "design.max_alike_in_row"
    other = Problem(where="x", rule="y", value="z")
    assert problems(infeasible, [other]) == [other]
    rig = infeasible.rig.model_copy(update={"max_voltage_v": 1})
    (limit,) = problems(infeasible.model_copy(update={"rig": rig}))
    assert limit.rule.startswith("the amplitude must not exceed")
    assert problems(small(2)) == []


def test_a_measured_resonance_takes_the_place_of_the_nominal_one() -> None:
    study = study_of(RISING, max_frequency_hz=30_000)
    assert problems_at(study, RESONANCE_HZ) == []
    found = the_only(problems_at(study, 1.01 * RESONANCE_HZ))
    assert found.value == "30300 Hz"


TOUCH: Document = {"voltage_v": 80, "ramp_to_v": 120, "frequency": 0.8, "sweep_to": 1.2}
PER_HZ = 2 * pi * 1.2 * 120 * 1e-6
"""The slew per hertz of the resonance."""


@pytest.mark.parametrize(
    ("touch", "rig", "expected_hz"),
    [
        (TOUCH, {"max_frequency_hz": 36_000}, 30_000),
        (TOUCH, {"max_slew_v_per_us": 20}, 20 / PER_HZ),
        (TOUCH, {"max_current_ma": 40}, 40 / (2 * PER_HZ)),
        (TOUCH, {"max_current_ma": None, "max_slew_v_per_us": 20}, 20 / PER_HZ),
        (TOUCH, {"max_current_ma": 40, "capacitance_nf": None}, 100_000 / 1.2),
        ({"voltage_v": 0}, {"max_frequency_hz": 36_000, "max_slew_v_per_us": 0.1}, 36_000),
    ],
)
def test_the_highest_resonance_keeps_all_limits(
    touch: Document, rig: dict[str, Any], expected_hz: float
) -> None:
    study = study_of(touch, **rig)
    slow = study_of({"voltage_v": 0}).condition[0].touches[1]
    touches = [slow, study.condition[0].touches[1]]
    assert max_resonance_hz(study, touches) == pytest.approx(expected_hz)
    assert max_resonance_hz(study, touches[::-1]) == pytest.approx(expected_hz)


def test_no_touch_keeps_any_resonance() -> None:
    assert max_resonance_hz(small(), []) == inf


def test_the_defaults_of_a_rig_are_within_its_own_limits() -> None:
    assert limit_problems(small()) == []
    assert Rig().max_voltage_v == 200


def sliding(**slide: object) -> Study:
    """A study on a generous rig, with this sliding experiment."""
    return study_of({"voltage_v": 0}).model_copy(
        update={"slide": Slide.model_validate({"frequencies": (1.1,), "voltage_v": 90.0, **slide})}
    )


@pytest.mark.parametrize(
    ("name", "value", "rule", "key"),
    [
        ("max_voltage_v", 90, "the amplitude", "voltage_v"),
        ("max_frequency_hz", 27_500, "the drive", "frequencies"),
        ("max_slew_v_per_us", 2 * pi * 27_500 * 90 * 1e-6, "2 pi f V", "voltage_v"),
        ("max_current_ma", 2 * pi * 27_500 * 90 * 2e-6, "2 pi f C V", "voltage_v"),
        ("max_drive_s", 14.2 + 90 / 400, "a touch must not be driven longer", "speeds_m_s"),
    ],
)
def test_a_sliding_experiment_keeps_the_limits_of_touches(
    name: str, value: float, rule: str, key: str
) -> None:
    def found(limit: float) -> list[Problem]:
        study = sliding()
        rig = study.rig.model_copy(update={name: limit})
        return slide_problems(study.model_copy(update={"rig": rig}))

    assert found(value * (1 + 1e-9)) == []
    (problem,) = found(value * (1 - 1e-9))
    assert problem.rule.startswith(rule)
    assert problem.path == ("slide", key)
    assert problem.where == "slide, 1.1 x resonance"


def test_a_fixed_drive_keeps_its_slew_on_every_beam() -> None:
    study = sliding(frequencies=(), frequencies_hz=(27_500.0,))
    slew = 2 * pi * 27_500 * 90 * 1e-6
    rig = study.rig.model_copy(update={"max_slew_v_per_us": slew * (1 + 1e-9)})
    study = study.model_copy(update={"rig": rig})
    assert problems_at(study, 20_000.0, sliding=True) == []
    assert problems_at(study, 40_000.0, sliding=True) == []
    relative = study.model_copy(update={"slide": sliding().slide})
    assert problems_at(relative, 25_001.0, sliding=True)


def test_a_sliding_experiment_that_is_not_asked_for_forbids_nothing() -> None:
    document = small_document(1)
    document["rig"] = {"max_voltage_v": 50.0}
    for touches in [item["touches"] for item in document["condition"]]:
        touches[:] = [{"place": "smooth", "voltage_v": 10}] * len(touches)
    assert not limit_problems(Study.model_validate(document))
    document["slide"] = {}
    (problem,) = limit_problems(Study.model_validate(document))
    assert problem.path == ("slide", "voltage_v")
    assert problems_at(Study.model_validate(document), 24_221.0) == [], "participants may go on"


def test_a_block_is_drawn_on_a_beam_of_the_study() -> None:
    (problem,) = slide_problems(sliding(beam="other"))
    assert (problem.path, problem.value) == (("slide", "beam"), "'other'")


def test_a_sliding_experiment_needs_something_that_measures_forces() -> None:
    document = small_document(1)
    document["rig"] = {"dialect": "keysight", "amplifier_gain": 20.0}
    document["slide"] = {}
    (problem,) = limit_problems(Study.model_validate(document))
    assert problem.rule.startswith("needs a board or a gauge")
    document["force_channel"] = {"gauge": "/dev/ttyUSB7"}
    assert not limit_problems(Study.model_validate(document))


def test_a_sliding_experiment_is_a_session_of_bounded_length() -> None:
    study = sliding()
    lasts_s = session_s(slide_study(study), slide_plan(slide_study(study)))

    def found(limit_s: float) -> list[Problem]:
        timing = study.timing.model_copy(update={"max_session_s": limit_s})
        return slide_problems(study.model_copy(update={"timing": timing}))

    assert found(lasts_s) == []
    (problem,) = found(lasts_s - 1e-6)
    assert problem.path == ("slide", "repeats")


def test_a_hint_on_touches_is_kept_where_sliding_has_none_of_its_own() -> None:
    study = sliding()
    rig = study.rig.model_copy(update={"max_voltage_v": 80.0, "max_drive_s": 1.0})
    amplitude, duration = slide_problems(study.model_copy(update={"rig": rig}))
    assert amplitude.hint.startswith("amplitudes are peak, not peak-to-peak: 90 V")
    assert duration.hint == "draw faster or shorten the paths; touch.lead_in_s counts"
