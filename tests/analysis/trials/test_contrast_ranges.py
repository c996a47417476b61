"""Ranges of contrasts over rungs, laws and assumptions, and the kinds of contrast."""

import numpy as np
import pytest

from analysis.trials.contrasts import (
    BEAM_MODELS,
    condition_changes,
    contrast_range,
)
from device.friction.changes import CONDITIONS, predicted_contrast, trial_change
from device.friction.laws import LAWS
from device.friction.rungs import TOP_RUNG
from protocol.study_file.loading import parsed_study, template
from tests.analysis.reports import EXTENDED, PAPER, imported

NAMES = ("frequency", "structure", "voltage", "direction", "pressure")
SCORES = [[7, 8, 9, 6, 5], [8, 7, 9, 7, 6], [6, 8, 8, 8, 4], [7, 9, 10, 6, 6]]


def test_each_condition_has_a_kind_of_contrast() -> None:
    assert {name: change.kind for name, change in CONDITIONS.items()} == {
        "signal": "at a place",
        "frequency": "growth of a swing",
        "structure": "at a place",
        "voltage": "at a place",
        "direction": "over a path",
        "pressure": "at a place",
    }
    touch = PAPER.opening[-1].touches[-1].model_copy(update={"place": "path", "voltage_v": 100.0})
    assert trial_change(PAPER, "roughness", "smoother", [touch]).kind == "over a path"


@pytest.mark.parametrize("name", CONDITIONS)
def test_a_range_holds_the_contrast_itself(name: str) -> None:
    found = contrast_range(name, CONDITIONS[name])
    assert found.value == predicted_contrast(CONDITIONS[name])
    assert tuple(found.by_rung) == BEAM_MODELS
    assert tuple(found.by_law) == tuple(LAWS)
    assert found.by_rung[TOP_RUNG] == found.by_law["consistent"] == found.value
    assert found.by_damping["0.005"] == found.by_speed["0.03992"] == found.value
    for values in (found.by_damping, found.by_speed):
        assert len(values) == 5
        assert min(values.values()) < found.value < max(values.values()) or name == "pressure"


def test_twice_the_damping_is_about_half_the_voltage() -> None:
    """At resonance the motion is inversely proportional to the damping."""
    found = contrast_range("voltage", CONDITIONS["voltage"])
    assert found.by_damping["0.01"] == pytest.approx(
        predicted_contrast(CONDITIONS["signal"]), rel=1e-3
    )


def test_a_law_without_friction_above_zero_gives_no_contrast() -> None:
    text = template("paper").replace("contact_m = 0.010", "contact_m = 0.001")
    study = parsed_study(text)
    entry = next(entry for entry in study.condition if entry.name == "direction")
    change = trial_change(study, entry.question, entry.expected, entry.touches)
    assert np.isnan(predicted_contrast(change, "printed"))
    assert np.isfinite(predicted_contrast(change))


def test_a_study_has_the_changes_that_it_plans() -> None:
    data = imported(SCORES, names=NAMES)
    assert condition_changes(EXTENDED, data) == {name: CONDITIONS[name] for name in NAMES}
    unknown = imported([[5, 6]], names=("voltage", "temperature"))
    assert list(condition_changes(EXTENDED, unknown)) == ["voltage"]
