"""Predictions for a rig as calibrated: damping, gain and body height count, and are named."""

from dataclasses import replace

import pytest

from device.beam.beam import Beam
from device.errors import OutOfRangeError
from device.friction.calibration import NOMINAL, Calibration
from device.friction.changes import CONDITIONS, LAW, RUNG, friction_at, predicted_contrast
from device.friction.coefficient import friction_coefficient
from device.friction.rungs import rung_resonance_hz
from device.friction.scenes import Drive, FingerContact, Scene, Structure

OWN = Calibration(damping_ratio=0.004, gain=1.1, body_height_m=1.2e-3, origin="session slide/1")


def test_without_a_calibration_the_papers_rig_is_taken() -> None:
    assert Calibration() == NOMINAL
    change = CONDITIONS["voltage"]
    assert predicted_contrast(change, rig=NOMINAL) == predicted_contrast(change)


def test_friction_is_that_of_a_scene_on_the_rig() -> None:
    moment = CONDITIONS["frequency"].before
    beam = Beam(damping_ratio=0.004)
    scene = Scene(
        structure=Structure(beam=beam, body_height_m=1.2e-3),
        drive=Drive(
            voltage_v=110.0, frequency_hz=moment.frequency * rung_resonance_hz(RUNG, beam, 6)
        ),
        touch=FingerContact(
            x_m=0.03,
            contact_m=moment.contact_m,
            finger_load_n=moment.force_n,
            sliding_speed_m_s=moment.sliding_speed_m_s,
        ),
    )
    due = friction_coefficient(scene, law=LAW, rung=RUNG)
    assert friction_at(moment, (0.03,), rig=OWN) == pytest.approx(due, rel=1e-12)


def test_a_beam_without_bodies_has_none_on_any_rig() -> None:
    moment = CONDITIONS["structure"].before
    plain = friction_at(moment, (0.03,), rig=Calibration(body_height_m=5e-3))
    assert plain == pytest.approx(friction_at(moment, (0.03,)), rel=1e-12)


def test_a_calibration_names_its_values_and_origin() -> None:
    assert str(OWN) == "damping ratio 0.004, gain 1.1, bodies 1.2 mm high (session slide/1)"
    assert str(NOMINAL).endswith("(assumed)")


@pytest.mark.parametrize(
    ("name", "value"),
    [("damping_ratio", 0.0), ("gain", -1.0), ("body_height_m", -1e-3), ("resonance_hz", 0.0)],
)
def test_impossible_values_are_refused(name: str, value: float) -> None:
    with pytest.raises(OutOfRangeError, match=f"{name} must .*, got {value:g}"):
        replace(NOMINAL, **{name: value})  # type: ignore[arg-type]
