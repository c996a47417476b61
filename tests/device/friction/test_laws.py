"""Properties of every valid friction law, on scenes drawn over the whole range."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from device.beam.beam import Beam
from device.beam.eq15 import same_direction_ratio
from device.errors import OutOfRangeError
from device.friction import laws
from device.friction.coefficient import friction_coefficient
from device.friction.laws import LAWS, ContactTerms, Law, anisotropy, consistent, coulomb
from device.friction.rungs import TOP_RUNG, rung_field
from device.friction.scenes import Drive, FingerContact, Scene, Structure

PLACES = np.linspace(0.0, 0.1, 101)


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    detuned = draw(st.booleans())
    return Scene(
        structure=Structure(
            beam=Beam(damping_ratio=draw(st.floats(1e-6, 0.5))),
            body_count=draw(st.integers(1, 200)),
            body_height_m=draw(st.floats(0.0, 3e-3)),
            friction_coefficient=draw(st.floats(0.05, 2.0)),
        ),
        drive=Drive(
            voltage_v=draw(st.floats(0.0, 1e4)),
            frequency_hz=draw(st.floats(10.0, 1e6)) if detuned else "resonance",
            mode=draw(st.integers(1, 40)),
        ),
        touch=FingerContact(
            contact_m=draw(st.floats(1e-6, 0.1)),
            body_load_n=draw(st.floats(1e-6, 1e3)),
            finger_load_n=draw(st.one_of(st.none(), st.floats(1e-3, 10.0))),
        ),
        direction=draw(st.sampled_from(["right", "left"])),
    )


@given(scenes())
def test_friction_keeps_its_bounds(scene: Scene) -> None:
    mu = scene.structure.friction_coefficient
    repaired = friction_coefficient(scene, law="consistent", x_m=PLACES)
    assert ((repaired >= 0) & (repaired <= mu * (2 + 1 / np.pi) * (1 + 1e-12))).all()
    bounded = friction_coefficient(scene, law="coulomb", x_m=PLACES)
    assert ((bounded >= 0) & (bounded <= mu * (1 + 1e-15))).all()


@given(scenes())
def test_without_voltage_friction_is_mu(scene: Scene) -> None:
    still = Scene(
        structure=scene.structure,
        drive=Drive(voltage_v=0.0, frequency_hz=scene.drive.frequency_hz, mode=scene.drive.mode),
        touch=scene.touch,
    )
    for law in ("consistent", "coulomb"):
        mu = friction_coefficient(still, law=law, x_m=PLACES)
        assert mu == pytest.approx(scene.structure.friction_coefficient, rel=3e-16, abs=0)


@given(st.floats(0.0, 1.0), st.floats(0.0, 10.0))
def test_reversing_mirrors_the_anisotropic_part(ratio: float, speed: float) -> None:
    def terms(same: float) -> ContactTerms:
        one = np.array(1.0)
        return ContactTerms(
            friction_coefficient=one,
            same_direction=np.array(same),
            opposing=np.array(1.0 - same),
            relative_tip_speed=np.array(speed),
            inertial_ratio=0 * one,
            printed_inertial_ratio=0 * one,
        )

    assert consistent(terms(ratio)) + consistent(terms(1 - ratio)) == pytest.approx(2.0, rel=1e-12)
    eta = float(anisotropy(np.array(speed)))
    both = float(coulomb(terms(ratio)) + coulomb(terms(1 - ratio)))
    assert both == pytest.approx(2 - eta, rel=1e-12)


@given(scenes())
def test_left_and_right_add_up_to_the_window(scene: Scene) -> None:
    field = rung_field("mode", scene.structure.beam, scene.drive)
    window = field.pattern.window(PLACES, scene.touch.contact_m)
    assert (window.right + window.left == 1.0).all()
    assert ((window.right >= 0) & (window.right <= 1)).all()


def test_friction_is_continuous_in_x() -> None:
    places = np.linspace(0.0, 0.1, 40_001)
    for rung in ("mode", "own-mode", "beam", "timoshenko-patched"):
        mu = friction_coefficient(Scene(), rung=rung, x_m=places)
        assert np.abs(np.diff(mu)).max() < 2.5e-6 / 0.01 * 0.4 * 1.5


def test_eq15_as_printed_has_its_plateaus_and_overlaps() -> None:
    places = np.array([0.010, 0.020, 0.0225, 0.0325, 0.0400])
    first = same_direction_ratio(places, 0.01)
    assert first == pytest.approx([0.0, 0.69, 0.87, 0.13, 0.82])
    assert same_direction_ratio(places, 0.01, "last")[-1] == pytest.approx(0.87)


def test_eq15_is_refused_beyond_its_range() -> None:
    with pytest.raises(ValueError, match=r"x_m must lie in \[0, 0.1\] for Eq 15, got 0.11"):
        same_direction_ratio(np.array([0.05, 0.11]), 0.01)


@pytest.mark.parametrize("row", [1, 2999, 3000, 7000])
def test_an_error_names_the_place_among_all_places(row: int) -> None:
    """However many are computed together."""
    smooth_m = 0.01  # where the ratio of Eq 15 is 0, however short the contact
    scene = Scene(touch=FingerContact(contact_m=1e-3))
    places = np.full(8000, smooth_m)
    for place, name in ((0.2, "x_m"), (0.0145, "contact_m")):
        places[row] = place
        with pytest.raises(OutOfRangeError, match=f"^{name} must") as refused:
            friction_coefficient(scene, rung="eq15", x_m=places)
        assert refused.value.row == row


def test_a_new_law_is_an_entry_among_the_laws(monkeypatch: pytest.MonkeyPatch) -> None:
    wave = Law(
        meaning="for this test",
        formula=lambda terms: np.sin(terms.relative_tip_speed) + terms.same_direction,
    )
    monkeypatch.setattr(laws, "LAWS", {**LAWS, "wave": wave})
    own = friction_coefficient(Scene(), law="wave", rung=TOP_RUNG, x_m=PLACES)
    window = rung_field(TOP_RUNG, Beam(), Drive()).pattern.window(PLACES, 0.01)
    np.testing.assert_allclose(own - window.right, np.sin(1.0), atol=1e-6)
