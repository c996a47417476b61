"""`auto` never errs more than its tolerance, whatever the scene; cheap rungs where they serve."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from device.auto import auto_prediction
from device.beam import Beam
from device.bounds import certified, top_rung_range
from device.contact import contact_of
from device.friction import friction_coefficient, scene_batch
from device.prediction import Batch, LawChoice, rung_prediction
from device.rungs import TOP_RUNG
from device.scenes import Drive, Scene, Structure, Touch

PLACES = np.linspace(0.0, 0.1, 23)


@st.composite
def batches(draw: st.DrawFn) -> Batch:
    mode = draw(st.integers(1, 18))
    scene = Scene(
        structure=Structure(
            beam=Beam(frequency_scale=draw(st.floats(0.9, 1.1))),
            body_height_m=draw(st.floats(0.0, 3e-3)),
        ),
        drive=Drive(mode=mode),
        touch=Touch(
            contact_m=draw(st.floats(1e-4, 0.1)),
            finger_load_n=draw(st.one_of(st.none(), st.floats(0.01, 10.0))),
        ),
        coverage=draw(st.sampled_from(["local", "full"])),
        direction=draw(st.sampled_from(["right", "left"])),
    )
    driven = draw(st.one_of(st.none(), st.floats(50.0, 1.2e5)))
    count = PLACES.size
    return Batch(
        contact=contact_of(scene, PLACES),
        mode=mode,
        voltage_v=np.full(count, draw(st.floats(0.0, 500.0))),
        frequency_hz=np.full(count, np.nan if driven is None else driven),
        damping_ratio=np.full(count, draw(st.floats(1e-3, 0.05))),
    )


@settings(max_examples=40, deadline=None)
@given(batches(), st.sampled_from(["consistent", "coulomb", "printed"]), st.floats(1e-4, 0.2))
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
    assert ((found.low <= top) & (top <= found.high)).all()
    assert np.median(found.high - found.low) < 0.01


def test_another_beam_is_outside_the_domain() -> None:
    scene = Scene(structure=Structure(beam=Beam(thickness_m=4e-3)))
    batch = scene_batch(scene, PLACES)
    assert not certified(batch).any()
    own = friction_coefficient(scene, rung="auto", x_m=PLACES)
    assert (own == friction_coefficient(scene, rung=TOP_RUNG, x_m=PLACES)).all()


def test_a_tolerance_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match=r"tolerance must be a finite number above 0, got 0\.0"):
        friction_coefficient(Scene(), rung="auto", tolerance=0.0)
