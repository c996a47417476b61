"""The friction coefficient of a scene: limits that any sound law must keep, and messages."""

import math
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from device.beam.beam import Beam
from device.beam.modes import modal_displacement_m, natural_frequency_hz
from device.friction.bounds import certified, top_rung_range
from device.friction.coefficient import auto_prediction, friction_coefficient, scene_batch
from device.friction.contact import contact_of
from device.friction.laws import LAWS
from device.friction.prediction import Batch, LawChoice, rung_prediction
from device.friction.rungs import TOP_RUNG
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
@pytest.mark.parametrize("rung", ["mode", "far-field"])
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
    displacement_m = modal_displacement_m(beam, 6, 100.0, natural_frequency_hz(beam, 6))
    assert natural_frequency_hz(beam, 6) == pytest.approx(24105.149, abs=1e-3)
    assert displacement_m == pytest.approx(4.35881501388920e-07, rel=1e-13)
    assert pytest.approx(0.0399244307250251, rel=1e-14) == REFERENCE_SPEED_M_S
    assert pytest.approx(0.0564616714013556, rel=1e-14) == REFERENCE_TIP_SPEED_M_S


def test_a_scaled_beam_resonates_at_the_scaled_frequency() -> None:
    beam = Beam(frequency_scale=1.01, damping_ratio=0.01)
    assert natural_frequency_hz(beam, 6) == pytest.approx(1.01 * natural_frequency_hz(Beam(), 6))
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
        (lambda: friction_coefficient(Scene(), rung="exact"), "timoshenko-patched, got 'exact'"),
    ],
)
def test_a_bad_scene_is_refused_with_name_rule_and_value(make: Any, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        make()


AUTO_PLACES = np.linspace(0.0, 0.1, 23)


@st.composite
def batches(draw: st.DrawFn) -> Batch:
    mode = draw(st.integers(1, 18))
    scene = Scene(
        structure=Structure(
            beam=Beam(frequency_scale=draw(st.floats(0.9, 1.1))),
            body_height_m=draw(st.floats(0.0, 3e-3)),
        ),
        drive=Drive(mode=mode),
        touch=FingerContact(
            contact_m=draw(st.floats(1e-4, 0.1)),
            finger_load_n=draw(st.one_of(st.none(), st.floats(0.01, 10.0))),
        ),
        coverage=draw(st.sampled_from(["local", "full"])),
        direction=draw(st.sampled_from(["right", "left"])),
    )
    driven = draw(st.one_of(st.none(), st.floats(50.0, 1.2e5)))
    count = AUTO_PLACES.size
    return Batch(
        contact=contact_of(scene, AUTO_PLACES),
        mode=mode,
        voltage_v=np.full(count, draw(st.floats(0.0, 500.0))),
        frequency_hz=np.full(count, np.nan if driven is None else driven),
        damping_ratio=np.full(count, draw(st.floats(1e-3, 0.05))),
    )


@settings(max_examples=40, deadline=None)
@given(batches(), st.sampled_from(sorted(LAWS)), st.floats(1e-4, 0.2))
def test_auto_keeps_its_tolerance_and_its_bound(batch: Batch, law: str, tolerance: float) -> None:
    choice = LawChoice(name=law, ratio="mode")
    top = rung_prediction(batch, TOP_RUNG, choice).mu_effective
    chosen = auto_prediction(batch, choice, tolerance)
    error = np.abs(chosen.prediction.mu_effective - top)
    assert (error <= tolerance).all()
    assert (error <= chosen.error_bound + 1e-12).all()
    outside = ~certified(batch)
    assert (chosen.rung[outside] == TOP_RUNG).all()


def test_at_0_1_scenes_at_resonance_need_no_harmonic_solve() -> None:
    batch = scene_batch(Scene(), np.linspace(0.0, 0.1, 1000))
    chosen = auto_prediction(batch, LawChoice(), 0.1)
    assert np.mean(chosen.rung != TOP_RUNG) > 0.9


def test_the_top_rung_lies_in_the_certified_range_at_resonance() -> None:
    batch = scene_batch(Scene(), np.linspace(0.0, 0.1, 1000))
    top = rung_prediction(batch, TOP_RUNG, LawChoice()).mu_effective
    found = top_rung_range(batch, LawChoice(), resonant=True)
    assert ((found[0] <= top) & (top <= found[1])).all()
    assert np.median(found[1] - found[0]) < 0.01


def test_another_beam_is_outside_the_domain() -> None:
    scene = Scene(structure=Structure(beam=Beam(thickness_m=4e-3)))
    batch = scene_batch(scene, AUTO_PLACES)
    assert not certified(batch).any()
    own = friction_coefficient(scene, rung="auto", x_m=AUTO_PLACES)
    assert (own == friction_coefficient(scene, rung=TOP_RUNG, x_m=AUTO_PLACES)).all()


def test_a_tolerance_of_zero_is_refused() -> None:
    with pytest.raises(ValueError, match=r"tolerance must be a finite number above 0, got 0\.0"):
        friction_coefficient(Scene(), rung="auto", tolerance=0.0)
