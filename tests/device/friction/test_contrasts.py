"""The paper's conditions: regression of the repaired law's changes, and rungs of the prediction."""

import pytest

from device.friction.changes import CONDITIONS, REFERENCE, friction_at, predicted_contrast
from device.friction.rungs import TOP_RUNG
from device.friction.scenes import FingerContact
from protocol.study.touch import TouchDefaults

CHANGES = {
    "frequency": -0.050,
    "structure": -0.041,
    "voltage": -0.133,
    "direction": 0.326,
    "pressure": -0.015,
}


@pytest.mark.parametrize(("name", "change"), CHANGES.items())
def test_change_at_the_smooth_place(name: str, change: float) -> None:
    condition = CONDITIONS[name]
    before, after = (
        friction_at(moment, (FingerContact().x_m,), rung="mode")[0]
        for moment in (condition.before, condition.after)
    )
    assert after - before == pytest.approx(change, abs=5e-4)


def test_the_repaired_law_orders_the_conditions() -> None:
    order = sorted(CHANGES, key=lambda name: -predicted_contrast(CONDITIONS[name]))
    assert order == ["direction", "voltage", "frequency", "structure", "pressure"]


@pytest.mark.parametrize("name", CONDITIONS)
def test_every_condition_is_felt_as_expected_under_the_repaired_law(name: str) -> None:
    assert predicted_contrast(CONDITIONS[name]) > 0.04


def test_study_file_and_model_have_the_same_default_finger() -> None:
    study, model = TouchDefaults(), FingerContact()
    assert (study.smooth_place_m, study.contact_m) == (model.x_m, model.contact_m)


@pytest.mark.parametrize("name", CONDITIONS)
def test_a_contrast_depends_on_the_rung(name: str) -> None:
    change = CONDITIONS[name]
    found = {rung: predicted_contrast(change, rung=rung) for rung in ("mode", TOP_RUNG)}
    assert found[TOP_RUNG] == predicted_contrast(change)
    assert found["mode"] != found[TOP_RUNG]


def test_a_drive_is_relative_to_the_resonance_of_the_rung() -> None:
    """Below its own resonance every rung moves less than at it."""
    place, below = (FingerContact().x_m,), CONDITIONS["frequency"].before
    for rung in ("mode", "timoshenko-patched"):
        at_resonance = friction_at(REFERENCE, place, rung=rung)
        assert friction_at(below, place, rung=rung) > at_resonance
