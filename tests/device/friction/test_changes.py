"""Predicted contrasts of trials: the model's published changes, and laws of sign and size."""

from math import log
from typing import Literal

import numpy as np
import pytest

from device.friction.calibration import Calibration
from device.friction.changes import CONDITIONS, predicted_contrast, trial_change
from device.friction.coefficient import friction_coefficient
from device.friction.laws import LAWS
from device.friction.rungs import TOP_RUNG
from device.friction.scenes import REFERENCE_SPEED_M_S, Drive, Scene
from device.friction.scenes import FingerContact as Finger
from device.friction.surfaces import GivenSurface
from protocol.plan.plan import plan
from protocol.plan.trials import Trial
from protocol.study.study import Study
from protocol.study.touch import Touch
from protocol.study_file.loading import parsed_study, template

PAPER = parsed_study(template("paper"))
EXTENDED = parsed_study(template("extended"))


def contrast(study: Study, trial: Trial) -> float:
    assert trial.question is not None
    return predicted_contrast(trial_change(study, trial.question, trial.expected, trial.touches))


def test_the_signal_is_the_change_from_the_resting_beam() -> None:
    touch = Touch(place="smooth", voltage_v=100)
    driven = friction_coefficient(
        Scene(drive=Drive(), touch=Finger(finger_load_n=0.5, sliding_speed_m_s=0.04)), rung=TOP_RUNG
    )
    found = predicted_contrast(trial_change(PAPER, "roughness", "smoother", [touch]))
    assert found == pytest.approx(log(0.4 / driven[0]))


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("trial", plan(PAPER, 0).trials[1:], ids=lambda t: t.condition or t.kind)
def test_trials_of_the_paper_study_have_the_contrasts_of_the_named_conditions(
    trial: Trial, law: str
) -> None:
    finger = PAPER.touch.model_copy(update={"sliding_speed_m_s": REFERENCE_SPEED_M_S})
    study = PAPER.model_copy(update={"touch": finger})
    assert trial.question is not None
    change = trial_change(study, trial.question, trial.expected, trial.touches)
    named = predicted_contrast(CONDITIONS[trial.condition or "signal"], law)
    assert predicted_contrast(change, law) == pytest.approx(named, rel=1e-9, abs=1e-12)


def test_the_paper_conditions_are_ranked_as_the_model_ranks_them() -> None:
    found = {t.condition: contrast(PAPER, t) for t in plan(PAPER, 0).trials if t.kind == "trial"}
    assert sorted(found, key=lambda name: -found[name]) == [
        "direction",
        "voltage",
        "frequency",
        "structure",
        "pressure",
    ]
    assert min(found.values()) > 0


@pytest.mark.parametrize("slot", range(3))
def test_catch_trials_have_zero_contrast(slot: int) -> None:
    catches = [trial for trial in plan(EXTENDED, slot).trials if trial.kind == "catch"]
    assert [contrast(EXTENDED, trial) for trial in catches] == [0.0] * 4


def test_an_opposite_trial_is_as_strong_as_the_trial_itself() -> None:
    seen: dict[tuple[str | None, float, bool], float] = {}
    for slot in range(40):
        for trial in plan(EXTENDED, slot).trials:
            if trial.kind == "trial":
                seen[trial.condition, trial.level, trial.opposite] = contrast(EXTENDED, trial)
    opposite = [key for key in seen if key[2]]
    assert len(opposite) == 16
    for condition, level, _ in opposite:
        assert seen[condition, level, True] == pytest.approx(seen[condition, level, False])


def test_contrasts_of_the_extended_study_are_widely_spaced() -> None:
    spread = {
        study.study.name: np.std([contrast(study, t) for t in plan(study, 0).trials if t.block])
        for study in (PAPER, EXTENDED)
    }
    main = [contrast(EXTENDED, t) for t in plan(EXTENDED, 0).trials if t.kind == "trial"]
    assert len(main) >= 20
    assert max(main) - min(main) > 0.6
    assert spread["extended"] > spread["paper"]


def test_ciliary_bodies_make_the_change_larger() -> None:
    bare, full = (
        [Touch(place="path", voltage_v=100, direction=way, beam=beam) for way in WAYS]
        for beam in ("no bodies", "1 mm")
    )
    without, with_bodies = (
        predicted_contrast(trial_change(PAPER, "places", "swapped", touches))
        for touches in (bare, full)
    )
    assert 0 < without < with_bodies


WAYS: tuple[Literal["right", "left"], ...] = ("right", "left")


def level(study: Study, *touches: Touch) -> float:
    return predicted_contrast(trial_change(study, None, None, touches))


@pytest.mark.parametrize("volts", [50.0, 150.0])
def test_a_rating_follows_ln_of_friction_over_that_at_rest_with_its_sign(volts: float) -> None:
    driven = Touch(place="smooth", voltage_v=volts)
    smoother = predicted_contrast(trial_change(PAPER, "roughness", "smoother", [driven]))
    assert level(PAPER, driven) == pytest.approx(-smoother)
    assert level(PAPER, driven) < 0
    # Touches before the last one say nothing of it.
    rest = Touch(place="smooth", voltage_v=0)
    assert level(PAPER, Touch(place="smooth", voltage_v=80), driven) == level(PAPER, driven)
    assert level(PAPER, rest) == level(PAPER, driven, rest) == 0


def test_a_rating_follows_the_end_of_a_ramp_and_the_mean_of_a_path() -> None:
    ramp = Touch(place="smooth", voltage_v=0, ramp_to_v=100)
    assert level(PAPER, ramp) == level(PAPER, Touch(place="smooth", voltage_v=100))
    path = Touch(place="path", voltage_v=100)
    change = trial_change(PAPER, None, None, [path])
    assert len(change.places_m) > 100
    assert change.kind == "over a path"


GIVEN = Study.model_validate(
    {
        "study": {"name": "plate"},
        "surface": {"kind": "given", "length_m": 0.1},
        "condition": [
            {"name": name, "touches": [{"place": "path", "voltage_v": volts, "friction": friction}]}
            for name, volts, friction in (("weak", 50, 0.4), ("strong", 100, 0.1))
        ],
    }
)
PLATE = Calibration.of(GivenSurface(length_m=0.1))


def stated(study: Study, **touch: float) -> float:
    touches = [Touch.model_validate({"place": "path", **touch})]
    return predicted_contrast(trial_change(study, None, None, touches), rig=PLATE)


def test_a_rating_of_stated_friction_is_relative_to_rest_or_else_to_the_mean() -> None:
    # The mean of logarithms of 0.4 and 0.1 is that of 0.2.
    assert stated(GIVEN, voltage_v=50, friction=0.4) == pytest.approx(log(2))
    assert np.isnan(stated(GIVEN, voltage_v=50))
    assert np.isnan(stated(GIVEN, voltage_v=0))
    rest = {"place": "path", "voltage_v": 0, "friction": 0.8}
    touches = (Touch.model_validate(rest), *GIVEN.condition[0].touches)
    first = GIVEN.condition[0].model_copy(update={"touches": touches})
    study = GIVEN.model_copy(update={"condition": (first, GIVEN.condition[1])})
    assert stated(study, voltage_v=50, friction=0.4) == pytest.approx(-log(2))
    assert stated(study, voltage_v=100, friction=0.1) == pytest.approx(-log(8))
    # A catch trial is at rest, whether it says so or not.
    assert stated(study, voltage_v=0) == stated(study, voltage_v=0, friction=0.8) == 0


def test_no_friction_that_is_stated_leaves_ratings_without_a_prediction() -> None:
    bare = [
        each.model_copy(update={"touches": (Touch(place="path", voltage_v=50),)})
        for each in GIVEN.condition
    ]
    assert np.isnan(stated(GIVEN.model_copy(update={"condition": tuple(bare)}), voltage_v=50))
