"""The friction coefficient of a scene: limits that any sound law must keep, and messages."""

import math
import re
from typing import Any

import numpy as np
import pytest

from device.beam.beam import Beam
from device.friction.coefficient import friction_coefficient
from device.friction.rungs import rung_field, rung_named, rung_resonance_hz
from device.friction.scenes import (
    REFERENCE_SPEED_M_S,
    REFERENCE_TIP_SPEED_M_S,
    Drive,
    FingerContact,
    Scene,
    Structure,
)

PLACES = np.linspace(0.0, 0.1, 201)


@pytest.mark.parametrize("law", ["consistent", "coulomb"])
@pytest.mark.parametrize("rung", ["mode", "own-mode", "beam"])
def test_without_voltage_friction_is_the_beams_own(law: str, rung: str) -> None:
    scene = Scene(drive=Drive(voltage_v=0.0))
    assert (friction_coefficient(scene, law=law, rung=rung, x_m=PLACES) == 0.4).all()


def test_full_coverage_uses_the_beams_own_ratio_or_the_one_given() -> None:
    own = friction_coefficient(Scene(coverage="full"), law="coulomb")
    given = friction_coefficient(
        Scene(coverage="full", same_direction_fraction=0.4489), law="coulomb"
    )
    assert own == pytest.approx(given, rel=1e-4)
    assert given == pytest.approx(0.4 * (1 - 0.5 * 0.4489))


def test_the_reference_scene_has_the_papers_anisotropy() -> None:
    beam = Beam()
    displacement_m = rung_field("mode", beam, Drive()).displacement_m
    assert rung_resonance_hz("mode", beam, 6) == pytest.approx(24105.149, abs=1e-3)
    assert displacement_m == pytest.approx(4.35881501388920e-07, rel=1e-10)
    assert pytest.approx(0.0399244307250251, rel=1e-14) == REFERENCE_SPEED_M_S
    assert pytest.approx(0.0564616714013556, rel=1e-14) == REFERENCE_TIP_SPEED_M_S


def test_a_scaled_beam_resonates_at_the_scaled_frequency() -> None:
    beam = Beam(frequency_scale=1.01, damping_ratio=0.01)
    own_hz, scaled_hz = (rung_resonance_hz("mode", one, 6) for one in (Beam(), beam))
    assert scaled_hz == pytest.approx(1.01 * own_hz)
    shifted = Scene(structure=Structure(beam=beam), drive=Drive(frequency_hz=24105.149))
    resonant = Scene(structure=Structure(beam=beam))
    assert friction_coefficient(shifted) > friction_coefficient(resonant)


def test_a_place_may_be_in_single_precision() -> None:
    single = PLACES.astype(np.float32)
    single[-1] = 0.0
    expected = friction_coefficient(Scene(), x_m=single.astype(np.float64))
    assert (friction_coefficient(Scene(), x_m=single) == expected).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: FingerContact(body_load_n=-1.0),
            "body_load_n must be a finite number above 0, got -1.0",
        ),
        (
            lambda: FingerContact(contact_m=math.nan),
            "contact_m must be a finite number above 0, got nan",
        ),
        (
            lambda: FingerContact(finger_load_n=0.0),
            "finger_load_n must be a finite number above 0, got 0",
        ),
        (lambda: Drive(voltage_v=math.inf), "voltage_v must be a finite number of at least 0, got"),
        (lambda: Drive(frequency_hz=0.0), "frequency_hz must be a finite number above 0, got 0.0"),
        (lambda: Drive(mode=0), "mode must be a whole number of at least 1, got 0"),
        (
            lambda: Beam(damping_ratio=0.0),
            "damping_ratio must lie strictly between 0 and 1, got 0.0",
        ),
        (lambda: Scene(touch=FingerContact(x_m=0.2)), "x_m must lie in [0, 0.1], got 0.2"),
        (
            lambda: Scene(same_direction_fraction=1.5),
            "same_direction_fraction must lie in [0, 1], got 1.5",
        ),
        (
            lambda: friction_coefficient(Scene(), x_m=[0.01, -0.02]),
            "x_m must lie in [0, 0.1], got -0.02",
        ),
        (
            lambda: friction_coefficient(Scene(), law="amontons"),
            "law must be one of printed, consistent, coulomb, got 'amontons'",
        ),
        (lambda: friction_coefficient(Scene(), rung="exact"), "own-mode, beam, got 'exact'"),
        (
            lambda: friction_coefficient(Scene(), rung="far-field"),
            "rung must be one of eq15, mode, own-mode, beam; take mode, got 'far-field'",
        ),
        (
            lambda: friction_coefficient(Scene(), rung="modes:8"),
            "rung must be one of eq15, mode, own-mode, beam; take beam, got 'modes:8'",
        ),
        (
            lambda: friction_coefficient(
                Scene(structure=Structure(beam=Beam(supports=("clamped", "clamped")))), rung="eq15"
            ),
            "clamped at its left end alone on the rung eq15; take beam, got 0.1",
        ),
    ],
)
def test_a_bad_scene_is_refused_with_name_rule_and_value(make: Any, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        make()


@pytest.mark.parametrize("former", ["timoshenko-patched", "timoshenko-modes", "auto"])
def test_names_of_version_1_are_the_whole_beam(former: str) -> None:
    assert rung_named(former) == "beam"
    ours, beam = (friction_coefficient(Scene(), rung=rung) for rung in (former, "beam"))
    assert ours == beam
