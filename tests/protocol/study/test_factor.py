"""Factors become conditions; drives in Hz stay what they are on any beam."""

from dataclasses import replace
from itertools import product
from math import inf

import pytest

from protocol.plan.orders import opposite
from protocol.plan.plan import plan
from protocol.plan.trials import planned_trial
from protocol.proof.trial_checks import plan_problems
from protocol.study.study import Study
from protocol.study.touch import Touch
from protocol.study_file.limits import max_resonance_hz, problems_at
from protocol.study_file.loading import StudyError, parsed_study

RAMPS = """
[study]
name = "ramps"
[design]
order = "blocks"
[[factor]]
name = "voltage"
varies = "ramp_to_v"
values = [50, 100, 150, 200]
[[factor]]
name = "frequency"
varies = "frequency_hz"
values = [23000, 24000, 25000]
[[condition]]
name = "ramp"
question = "roughness"
expected = "smoother"
touches = [{ place = "path", voltage_v = 0 }]
"""
HERTZ = '"\nvalues = [23000, 24000, 25000]'
ANOTHER = """
[[condition]]
name = "harder"
question = "roughness"
expected = "smoother"
touches = [{ place = "path", voltage_v = 0 }, { place = "path", voltage_v = 0, press = 2.0 }]
"""


def test_factors_cross_into_conditions_that_say_what_they_are() -> None:
    study = parsed_study(RAMPS)
    volts, hertz = (50, 100, 150, 200), (23_000, 24_000, 25_000)
    assert study.conditions == tuple(f"{v} V, {f // 1000} kHz" for v, f in product(volts, hertz))
    driven = [(each.touches[0].ramp_to_v, each.touches[0].frequency_hz) for each in study.condition]
    assert driven == list(product(volts, hertz))
    assert study.condition[5].cell == {"voltage": "100 V", "frequency": "25 kHz"}
    assert list(study.factors) == ["voltage", "frequency"]
    assert not plan_problems(study, plan(study, 0))


def test_conditions_of_the_file_are_a_factor_of_their_own() -> None:
    study = parsed_study(RAMPS + ANOTHER)
    assert study.factors["condition"] == ("ramp", "harder")
    assert study.conditions[12] == "harder, 50 V, 23 kHz"
    # Only the last touch varies unless the factor says otherwise.
    assert [touch.ramp_to_v for touch in study.condition[12].touches] == [None, 50]
    whole = parsed_study(RAMPS.replace('"ramp_to_v"', '"ramp_to_v"\ntouches = "all"') + ANOTHER)
    assert [touch.ramp_to_v for touch in whole.condition[12].touches] == [50, 50]


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        (
            "[50, 100, 150, 200]",
            "[50, 250]",
            "study.toml:9: factor voltage: the amplitude must",
        ),
        ("[50, 100, 150, 200]", "[50, 50]", "factor voltage, values: must differ"),
        ("[50, 100, 150, 200]", '["a", "b"]', "factor voltage, value 1: must be a number, got 'a'"),
        ("[50, 100, 150, 200]", str(list(range(1, 12))), "at most 30 conditions, got 33; leave a"),
        ('"frequency_hz"', '"frequency"', "value 1: must be at most 10, .*; frequency_hz is in Hz"),
        ('"frequency_hz"', '"frequncy_hz"', "varies: must be .*; did you mean 'frequency_hz'"),
        (
            f"frequency_hz{HERTZ}",
            'ramp_to_v"\nvalues = [1, 2]',
            "varies: must differ from",
        ),
        (
            "[50, 100, 150, 200]",
            "[50, 50.00000001]",
            "condition: names must differ, got '50 V",
        ),
        ('"frequency"\n', '"Voltage"\n', "names must differ by more than case"),
        ('"frequency"\n', '"Group"\n', "have anyway, got 'Group'"),
        ('"frequency"\n', '"condition by voltage"\n', "have anyway, got 'condition by"),
        (
            '"frequency"\n',
            '"Condition"\n',
            "not have the name of what reports have anyway, got 'Con",
        ),
        (
            "[50, 100, 150, 200]",
            "[true, 50]",
            "voltage, value 1: must be a text or a number, got True",
        ),
        ("25000]", '25000]\nlabels = ["a"]', "labels: must be as many as values, 3, and differ"),
        ("voltage_v = 0 }", "voltage_v = 0, frequency = 1.0 }", "not be given beside frequency_hz"),
        (
            "voltage_v = 0 }",
            "voltage_v = 0, ramp_to_v = 100 }",
            "study.toml:18: condition, touch 1: must not give ramp_to_v, which a factor sets",
        ),
        (
            "voltage_v = 0 }",
            "voltage_v = 0, frequency_hz = 23700 }",
            "study.toml:18: condition, touch 1: must not give frequency_hz, which a factor sets",
        ),
        (
            f"frequency_hz{HERTZ}",
            'ramp_to_v"\ntouches = "all"\nvalues = [1, 2]',
            "varies: must differ from",
        ),
    ],
)
def test_a_bad_factor_is_refused_in_one_line(right: str, wrong: str, message: str) -> None:
    with pytest.raises(StudyError, match=message) as refused:
        parsed_study(RAMPS.replace(right, wrong, 1))
    assert "internal" not in str(refused.value)
    # What several cells share is told once.
    assert len(refused.value.problems) == len({str(each) for each in refused.value.problems}) <= 3


def test_a_factor_may_set_what_every_touch_must_give_and_other_touches_than_those_that_do() -> None:
    assert parsed_study(RAMPS.replace('"ramp_to_v"', '"voltage_v"'))
    own = ANOTHER.replace("voltage_v = 0 }, {", "voltage_v = 0, ramp_to_v = 30 }, {")
    study = parsed_study(RAMPS + own)
    assert [touch.ramp_to_v for touch in study.condition[12].touches] == [30, 50]


def test_one_factor_may_set_the_first_touch_and_another_the_last() -> None:
    text = RAMPS.replace(f"frequency_hz{HERTZ}", 'ramp_to_v"\ntouches = "first"\nvalues = [10, 20]')
    (condition,) = ANOTHER.split("[[condition]]")[1:]
    study = parsed_study(f"{text.partition('[[condition]]')[0]}[[condition]]{condition}")
    driven = [tuple(touch.ramp_to_v for touch in each.touches) for each in study.condition]
    assert driven == [(first, last) for last in (50, 100, 150, 200) for first in (10, 20)]


def fixed(**keys: float) -> Touch:
    return Touch.model_validate({"place": "path", "voltage_v": 100, **keys})


def test_a_drive_in_hertz_follows_no_resonance() -> None:
    touch = fixed(frequency_hz=23_000, sweep_to_hz=25_000)
    for resonance_hz in (20_000.0, 24_221.0):
        there = touch.at(resonance_hz)
        assert there.frequency * resonance_hz == pytest.approx(23_000, rel=1e-15)
        assert there.end_frequency * resonance_hz == pytest.approx(25_000, rel=1e-15)
    (back,) = opposite((touch.at(20_000),))
    assert (back.frequency_hz, back.sweep_to_hz) == (25_000, 23_000)
    assert back.drive_ends == ("25000 Hz", "23000 Hz")


def test_limits_of_a_drive_in_hertz_are_those_of_the_drive_itself() -> None:
    study = parsed_study(RAMPS)
    # A beam that resonates elsewhere changes no drive.
    assert not problems_at(study, 90_000)
    assert max_resonance_hz(study, study.condition[0].touches) == inf
    with pytest.raises(StudyError, match="max_frequency_hz = 40000 Hz, got 41"):
        parsed_study(RAMPS.replace("25000]", "41000]"))


def test_the_proof_sees_a_wrong_drive_in_hertz() -> None:
    study = parsed_study(RAMPS)
    drawn = plan(study, 0)
    first = drawn.trials[0]
    wrong = first.touches[0].model_copy(update={"frequency_hz": 41_000.0})
    forged = replace(drawn, trials=(replace(first, touches=(wrong,)), *drawn.trials[1:]))
    told = [str(problem) for problem in plan_problems(study, forged)]
    assert any("frequency, Hz, must not exceed" in text for text in told)
    assert any("the touches must be the condition's" in text for text in told)


def test_a_journalled_trial_gives_the_same_touch_back() -> None:
    for trial in plan(parsed_study(RAMPS), 3).trials:
        again = tuple(map(Touch.model_validate, planned_trial(trial).touches))
        assert again == trial.touches


def test_a_study_that_is_worked_out_stays_as_it_is() -> None:
    study = parsed_study(RAMPS + ANOTHER)
    assert Study.model_validate(study) == study
    assert study.model_copy(update={"factor": study.factor}).conditions == study.conditions
