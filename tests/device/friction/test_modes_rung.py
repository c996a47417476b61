"""The rung `timoshenko-modes` against the top rung, scene by scene, and `auto` with it."""

import re
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from device.beam.beam import Beam
from device.beam.modes import FloatArray
from device.beam.timoshenko import (
    segmented_natural_frequencies_hz,
    segmented_natural_frequency_hz,
)
from device.friction.bounds import Range, _around, reduced_certified, reduced_prediction
from device.friction.coefficient import auto_prediction, error_bounds, friction_coefficient
from device.friction.contact import contact_of
from device.friction.laws import LAWS
from device.friction.prediction import Batch, LawChoice, rung_prediction
from device.friction.rungs import REDUCED_RUNG, TOP_RUNG
from device.friction.scenes import Drive, FingerContact, Scene, Structure

PLACES = np.array([0.0, 1e-9, 1e-6, 1e-3, 0.0414, 0.081, 0.0810001, 0.086, 0.091, 0.0999999, 0.1])
TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10)


def _frequencies(draw: np.random.Generator, count: int) -> FloatArray:
    """Frequencies over the domain, half of them within some widths of a resonance."""
    resonances_hz = segmented_natural_frequencies_hz(Beam(), 18, patched=True, shear=True)
    near = draw.choice(resonances_hz, count) * (1 + 0.01 * draw.standard_normal(count))
    far = np.exp(draw.uniform(np.log(150.0), np.log(1.1e5), count))
    return np.where(draw.random(count) < 0.5, near, far)


def _scenes(seed: int, count: int) -> Batch:
    """Scenes that share mode, coverage and direction; each has a drive and a touch of its own."""
    draw = np.random.default_rng(seed)
    frequency_hz = _frequencies(draw, count)
    frequency_hz[draw.random(count) < 0.3] = np.nan
    scene = Scene(
        structure=Structure(beam=Beam(frequency_scale=float(draw.uniform(0.95, 1.05)))),
        drive=Drive(mode=int(draw.integers(1, 19))),
        coverage="full" if draw.random() < 0.2 else "local",
        direction="left" if draw.random() < 0.5 else "right",
    )
    edges = draw.choice([0.0, 1e-6, 0.081, 0.086, 0.091, 0.1], count)
    places = np.where(draw.random(count) < 0.1, edges, draw.uniform(0.0, 0.1, count))
    contact = replace(
        contact_of(scene, places),
        contact_m=10 ** draw.uniform(-3, -1, count),
        body_height_m=draw.uniform(0.0, 3e-3, count),
        finger_load_n=None if draw.random() < 0.3 else 10 ** draw.uniform(-1.5, 1, count),
        sliding_speed_m_s=10 ** draw.uniform(-2, -0.5, count),
    )
    return Batch(
        contact=contact,
        mode=scene.drive.mode,
        voltage_v=draw.uniform(0.0, 300.0, count),
        frequency_hz=frequency_hz,
        damping_ratio=np.exp(draw.uniform(np.log(0.0015), np.log(0.025), count)),
    )


def _check(batch: Batch) -> int:
    """Check bounds and tolerances of all laws; return how many predictions had a bound."""
    bounded = 0
    for law in sorted(LAWS):
        choice = LawChoice(name=law, ratio="mode")
        top = rung_prediction(batch, TOP_RUNG, choice).mu_effective
        inside = np.flatnonzero(reduced_certified(batch))
        part = batch.rows(inside)
        ours = rung_prediction(part, REDUCED_RUNG, choice).mu_effective
        bounds = error_bounds(part, REDUCED_RUNG, choice, ours)
        assert (np.abs(ours - top[inside]) <= bounds).all()
        bounded += inside.size
        for tolerance in TOLERANCES:
            chosen = auto_prediction(batch, choice, tolerance)
            error = np.abs(chosen.prediction.mu_effective - top)
            assert (error <= chosen.error_bound + 1e-12).all()
            assert (chosen.error_bound <= tolerance).all()
    return bounded


@pytest.mark.parametrize("seed", range(4))
def test_the_certified_bounds_hold_on_new_scenes(seed: int) -> None:
    assert _check(_scenes(seed, 60)) > 90


@pytest.mark.soak
def test_the_certified_bounds_hold_on_20_000_scenes() -> None:
    bounded, seed = 0, 1000
    while bounded < 3 * 20_000:
        bounded += _check(_scenes(seed, 250))
        seed += 1


@pytest.mark.parametrize(
    ("frequency_hz", "error"),
    [
        ("resonance", 5e-5),
        (200.0, 1e-11),
        (1000.0, 5e-9),
        (21_000.0, 1e-5),
        (50_000.0, 2e-6),
        (99_000.0, 1e-5),
        (150_000.0, 2e-6),
        (199_000.0, 5e-2),
    ],
)
@pytest.mark.parametrize("damping", [1e-4, 0.002, 0.02, 0.2])
def test_it_agrees_with_the_top_rung_everywhere(
    frequency_hz: float | Literal["resonance"], error: float, damping: float
) -> None:
    for contact_m in (1e-3, 0.01, 0.1):
        scene = Scene(
            structure=Structure(beam=Beam(damping_ratio=damping)),
            drive=Drive(frequency_hz=frequency_hz),
            touch=FingerContact(contact_m=contact_m, finger_load_n=0.5),
        )
        for law in ("consistent", "coulomb"):
            ours = friction_coefficient(scene, law=law, rung=REDUCED_RUNG, x_m=PLACES)
            top = friction_coefficient(scene, law=law, rung=TOP_RUNG, x_m=PLACES)
            assert np.abs(ours - top).max() <= 0.4 * error


def test_all_natural_frequencies_at_once_are_those_found_one_by_one() -> None:
    for patched, shear in ((False, False), (True, True)):
        found = segmented_natural_frequencies_hz(Beam(), 20, patched=patched, shear=shear)
        for mode in (1, 2, 6, 13, 20):
            single = segmented_natural_frequency_hz(Beam(), mode, patched=patched, shear=shear)
            assert found[mode - 1] == pytest.approx(single, rel=1e-14)


def test_places_asked_for_in_parts_give_what_they_give_together() -> None:
    scene = Scene(drive=Drive(frequency_hz=23_200.0), touch=FingerContact(contact_m=2e-3))
    places = np.random.default_rng(4).uniform(0.0, 0.1, 300)
    together = friction_coefficient(scene, rung=REDUCED_RUNG, x_m=places)
    for size in (1, 7, 100):
        parts = [places[first : first + size] for first in range(0, places.size, size)]
        found = [friction_coefficient(scene, rung=REDUCED_RUNG, x_m=part) for part in parts]
        np.testing.assert_allclose(np.concatenate(found), together, rtol=1e-12)


def test_a_drive_beyond_its_modes_is_refused() -> None:
    scene = Scene(drive=Drive(frequency_hz=2.1e5))
    message = "frequency_hz must be at most 200097 on the rung timoshenko-modes; take"
    with pytest.raises(ValueError, match=re.escape(message)):
        friction_coefficient(scene, rung=REDUCED_RUNG)


def test_few_drives_take_the_top_rung_and_many_take_its_modes() -> None:
    batch = _scenes(1, 400)
    batch = replace(
        batch,
        frequency_hz=np.linspace(2.0e4, 2.2e4, 400),
        damping_ratio=np.full(400, 0.005),
    )
    many = auto_prediction(batch, LawChoice(), 1e-4)
    few = auto_prediction(batch.rows(np.arange(8)), LawChoice(), 1e-4)
    assert np.mean(many.rung == REDUCED_RUNG) > 0.8
    assert not (few.rung == REDUCED_RUNG).any()


@pytest.mark.parametrize("scale", [0.9, 1.05])
def test_the_error_of_the_speed_does_not_depend_on_the_scale_of_the_beam(
    scale: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The speed is relative to that of the nominal beam, whose error is one number."""
    errors: list[FloatArray] = []

    def seen(values: FloatArray, relative: FloatArray) -> Range:
        errors.append(relative)
        return _around(values, relative)

    monkeypatch.setattr("device.friction.bounds._around", seen)
    for each in (1.0, scale):
        scene = Scene(structure=Structure(beam=Beam(frequency_scale=each)), drive=Drive(mode=6))
        batch = Batch(
            contact=contact_of(scene, np.array([0.05])),
            mode=6,
            voltage_v=np.array([100.0]),
            frequency_hz=np.array([np.nan]),
            damping_ratio=np.array([0.005]),
        )
        reduced_prediction(batch, LawChoice())
    of_speed, inertia, _, of_scaled_speed, *_ = errors
    assert of_speed[0] != inertia[0]
    np.testing.assert_allclose(of_scaled_speed, of_speed, rtol=1e-12)
