"""The voltage of a contrast: the model gives that contrast there, or the level is refused."""

import pytest

from device.friction.calibration import NOMINAL, Calibration
from device.friction.changes import friction_difference
from device.tracks.contrast import voltages
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study, template

LEVELS = 'axis = "voltage"\nlevels = { from = 4, to = 160, count = 41'


def study(levels: str, place: str = "smooth") -> Study:
    text = template("threshold").replace(LEVELS, f'axis = "contrast"\nlevels = {{ {levels}', 1)
    return parsed_study(text.replace('place = "smooth"', f'place = "{place}"'))


@pytest.mark.parametrize("rig", [NOMINAL, Calibration(gain=0.8, origin="a fit")])
@pytest.mark.parametrize("place", ["smooth", "path"])
def test_the_model_gives_the_contrast_at_the_voltage(rig: Calibration, place: str) -> None:
    asked = study("from = 0.02, to = 0.2, count = 9", place)
    found, problems = voltages(asked, 0, rig)
    assert not problems
    track = asked.track[0]
    assert track.standard is not None
    assert list(found) == sorted(found)
    for value, volts in zip(track.values, found, strict=True):
        touch = track.comparison.model_copy(update={"voltage_v": volts})
        contrast = friction_difference(asked, track.standard, touch, rig)
        # Along the path the model gives more friction, at this place less.
        assert contrast * (1 if place == "smooth" else -1) == pytest.approx(value, abs=1e-7)


def test_a_contrast_beyond_the_largest_voltage_is_refused() -> None:
    found, problems = voltages(study("from = 0.02, to = 0.5, count = 9"), 0)
    assert found == ()
    assert str(problems[0]) == (
        "track smallest amplitude, levels: must lie within the contrasts predicted for this rig, "
        "0 at 0 V to 0.346 at 200 V, the limit of the rig, got 0.02 to 0.5; take levels within "
        'it, other touches, or axis = "voltage"'
    )


def test_a_contrast_is_refused_where_it_no_longer_rises() -> None:
    _, problems = voltages(study("from = 0.02, to = 0.3, count = 9", "path"), 0)
    assert "where it no longer rises" in str(problems[0])


def test_a_voltage_that_breaks_a_limit_of_the_rig_is_refused() -> None:
    asked = study("from = 0.02, to = 0.3, count = 9")
    rig = asked.rig.model_copy(update={"max_slew_v_per_us": 20.0})
    _, problems = voltages(asked.model_copy(update={"rig": rig}), 0)
    assert [problem.path for problem in problems] == [("track", 0, "comparison", "voltage_v")] or [
        problem.path for problem in problems
    ] == [("track", 0, "levels")]
    assert "max_slew_v_per_us = 20" in str(problems[0])
