"""The simulated beam's friction: by default that of the report's law and rung."""

import pytest

from device.beam.beam import Beam
from device.errors import OutOfRangeError
from device.friction.changes import LAW, RUNG
from device.friction.coefficient import friction_coefficient
from device.friction.rungs import TOP_RUNG
from device.friction.scenes import Drive, FingerContact, Scene, Structure
from device.simulator.hardware.beam_and_finger import SimulatedBeam
from device.simulator.hardware.power_stage import Instrument

SCENES = [("consistent", TOP_RUNG), ("coulomb", TOP_RUNG), ("consistent", "mode")]


def felt(law: str, rung: str, voltage_v: float = 100.0) -> float:
    """The friction at the beam's resonance."""
    beam = SimulatedBeam(1, law, rung)
    beam.touch(0.5, 0.0414, "right")
    instrument = Instrument(output=True, voltage_v=voltage_v, frequency_hz=beam.resonance_hz)
    found = beam.friction_coefficient(instrument)
    assert found is not None
    return found


@pytest.mark.parametrize(("law", "rung"), SCENES)
def test_the_friction_at_resonance_is_that_of_the_law_on_the_rung(law: str, rung: str) -> None:
    beam = SimulatedBeam(1, law, rung)
    scene = Scene(
        structure=Structure(beam=Beam(damping_ratio=beam.beam.damping_ratio)),
        drive=Drive(voltage_v=beam.gain * 100.0),
        touch=FingerContact(x_m=0.0414, finger_load_n=0.5),
    )
    assert felt(law, rung) == pytest.approx(friction_coefficient(scene, law=law, rung=rung)[0])


def test_the_truth_is_what_a_session_has_to_find() -> None:
    beam = SimulatedBeam(3)
    told = beam.truth()
    assert told["resonance_hz"] == beam.resonance_hz
    assert (told["law"], told["rung"], told["gain"]) == (LAW, RUNG, beam.gain)
    troughs_m = told["troughs_m"]
    assert isinstance(troughs_m, list)
    assert [round(1e3 * place_m) for place_m in troughs_m[:3]] == [22, 41, 59]


def test_laws_and_rungs_differ_under_a_voltage_and_not_at_rest() -> None:
    assert len({felt(*each) for each in SCENES}) == 3
    assert {felt(*each, voltage_v=0.0) for each in SCENES} == {0.4}


def test_the_beam_takes_the_reports_law_and_the_top_rung() -> None:
    assert (LAW, RUNG) == ("consistent", TOP_RUNG)
    assert felt(LAW, RUNG) == felt("consistent", TOP_RUNG)


def test_unknown_laws_and_rungs_are_refused() -> None:
    with pytest.raises(OutOfRangeError, match=r"law must be one of .* got 'newton'"):
        SimulatedBeam(1, law="newton")
    with pytest.raises(OutOfRangeError, match=r"rung must be one of .* got 'highest'"):
        SimulatedBeam(1, rung="highest")
