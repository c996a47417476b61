"""Programmes and variants of touches: what the device does, and the contrary of it."""

import pytest
from pydantic import ValidationError

from device.friction.calibration import NOMINAL
from device.friction.changes import friction_difference
from protocol.errors import BadInput
from protocol.plan.orders import at_level, opposite, opposite_expected
from protocol.plan.plan import plan
from protocol.proof.trial_checks import plan_problems
from protocol.study.rig_settings import Rig
from protocol.study.study_question import QUESTIONS
from protocol.study.touch import Touch, TouchDefaults, driven_s, touch_s
from protocol.study_file.loading import parsed_study, template
from runner.study.check import validated_study

FINGER, RIG = TouchDefaults(), Rig()
RAMP = Touch(place="smooth", voltage_v=0, ramp_to_v=200, duration_s=6)
SWEEP = Touch(place="path", voltage_v=100, frequency=0.9, sweep_to=1.0)


def test_a_touch_begins_softly_and_ends_at_once() -> None:
    at_once = FINGER.model_copy(update={"lead_in_s": 0.0})
    assert driven_s(SWEEP, at_once, RIG) == pytest.approx(100 / 400 + 0.071 / 0.04)
    assert driven_s(RAMP, at_once, RIG) == 6
    (back,) = opposite((RAMP,))
    assert driven_s(back, at_once, RIG) == 200 / 400 + 6


def test_the_lead_in_is_driven_and_holds_the_soft_start() -> None:
    assert driven_s(SWEEP, FINGER, RIG) == pytest.approx(3 + 0.071 / 0.04)
    assert driven_s(RAMP, FINGER, RIG) == 3 + 6
    slow = Rig(ramp_v_per_s=20)
    assert driven_s(SWEEP, FINGER, slow) == pytest.approx(100 / 20 + 0.071 / 0.04)


def test_a_resting_beam_is_not_driven() -> None:
    rest = Touch(place="smooth", voltage_v=0)
    assert driven_s(rest, FINGER, RIG) == 0
    assert touch_s(rest, FINGER) == 2


@pytest.mark.parametrize(
    ("touch", "programme"),
    [
        (RAMP, "ramp"),
        (SWEEP, "sweep"),
        (RAMP.model_copy(update={"sweep_to": 1.1}), "ramp and sweep"),
        (Touch(place="path", voltage_v=1), "hold"),
    ],
)
def test_a_programme_has_a_name(touch: Touch, programme: str) -> None:
    assert touch.programme == programme


def test_the_opposite_of_the_opposite_is_the_same() -> None:
    for condition in parsed_study(template("paper")).condition:
        assert opposite(opposite(condition.touches)) == condition.touches
    (back,) = opposite((RAMP,))
    assert (back.voltage_v, back.end_voltage_v) == (200, 0)


def test_only_conditions_with_a_contrary_answer_have_an_opposite() -> None:
    found = {c.name: opposite_expected(c) for c in parsed_study(template("paper")).condition}
    assert found == {
        "frequency": "weaker",
        "structure": "weaker",
        "voltage": "rougher",
        "direction": None,
        "pressure": "rougher",
    }


def test_contrary_answers_come_in_pairs() -> None:
    for asked in QUESTIONS.values():
        assert asked.contrary(asked.same) is None
        for answer in asked.answers:
            other = asked.contrary(answer)
            assert other is None or asked.contrary(other) == answer


def test_a_level_scales_every_amplitude_and_nothing_else() -> None:
    (half,) = at_level((RAMP,), 0.5)
    assert half == RAMP.model_copy(update={"ramp_to_v": 100.0})
    (silent,) = at_level((SWEEP,), 0.0)
    assert silent.peak_voltage_v == 0
    assert silent.sweep_to == 1.0


def test_a_ramp_that_goes_nowhere_is_no_change() -> None:
    condition = parsed_study(template("paper")).condition[2]
    hold = Touch(place="smooth", voltage_v=50)
    flat = hold.model_copy(update={"ramp_to_v": 50.0})
    assert opposite_expected(condition.model_copy(update={"touches": (hold, flat)})) is None


def test_a_slide_of_its_own_speed_takes_as_long_as_its_way() -> None:
    finger = TouchDefaults(sliding_speed_m_s=0.04, path_m=(0.01, 0.09))
    usual = Touch(place="path", voltage_v=0)
    fast = usual.model_copy(update={"sliding_speed_m_s": 0.1})
    assert touch_s(usual, finger) == pytest.approx(2.0)
    assert touch_s(fast, finger) == pytest.approx(0.8)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ('place = "smooth", sliding_speed_m_s = 0.1', 'is for place = "path"'),
        ('place = "path", duration_s = 2, sliding_speed_m_s = 0.1', "must not be given beside"),
        ('place = "path", sliding_speed_m_s = 40', "at most 1"),
    ],
)
def test_a_speed_that_no_slide_has_is_refused(keys: str, message: str) -> None:
    text = template("threshold").replace(
        'standard = { place = "smooth", voltage_v = 0 }', f"standard = {{ {keys}, voltage_v = 0 }}"
    )
    with pytest.raises(BadInput, match=message):
        validated_study(text, "study.toml")


def test_speeds_of_touches_are_shown_proved_and_felt() -> None:
    text = (
        template("threshold")
        .replace(
            'standard = { place = "smooth", voltage_v = 0 }\ncomparison = { place = "smooth" }',
            'standard = { place = "path", voltage_v = 100, sliding_speed_m_s = 0.02 }\n'
            'comparison = { place = "path", sliding_speed_m_s = 0.1 }',
            1,
        )
        .replace("from = 4, to = 160", "from = 110, to = 160")
    )
    study = validated_study(text, "study.toml")
    assert list(plan_problems(study, plan(study, 0))) == []
    track = study.track[0]
    assert track.standard is not None
    same = track.at(9).model_copy(update={"sliding_speed_m_s": 0.02})
    slow, fast = (
        friction_difference(study, track.standard, it, NOMINAL) for it in (same, track.at(9))
    )
    # Whether the same amplitude lowers friction more depends on how fast the finger goes.
    assert slow != pytest.approx(fast, abs=1e-3)


@pytest.mark.parametrize("hz", [20.0, 250.0, 99_000.0])
def test_a_drive_far_from_the_resonance_can_be_read_again(hz: float) -> None:
    touch = Touch(place="path", voltage_v=50, frequency_hz=hz, sweep_to_hz=100.0).at(8000.0)
    assert touch.frequency == hz / 8000
    assert Touch.model_validate(touch.model_dump()) == touch
    for wrong in ({"frequency": "x"}, {"frequency": float("nan")}, {"frequency": -1.0}):
        with pytest.raises(ValidationError):
            Touch.model_validate({**touch.model_dump(), **wrong})
    with pytest.raises(ValidationError):
        Touch(place="path", voltage_v=50, frequency=0.01)
