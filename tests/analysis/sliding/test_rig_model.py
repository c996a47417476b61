"""Friction along passes: the same as the friction model's, and its derivatives."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.sliding.comparison import predicted
from analysis.sliding.rig_model import (
    PROPERTIES,
    Places,
    RigProperties,
    Setting,
    coordinates,
    friction_along,
    rig_at,
    slopes,
)
from device.beam.beam import Beam, Patch
from device.friction.rungs import TOP_RUNG
from device.friction.scenes import Structure
from device.friction.surfaces import BeamSurface

RIG = RigProperties(
    friction_coefficient=0.35,
    resonance_hz=24_150.0,
    damping_ratio=0.0056,
    gain=1.04,
    body_height_m=0.9e-3,
)
SLOW = Setting(
    voltage_v=100.0,
    frequency_hz=24_100.0,
    direction="right",
    load_n=0.56,
    contact_m=0.01,
    speed_m_s=0.01,
)
SETTINGS = (
    SLOW,
    replace(SLOW, direction="left", speed_m_s=0.04),
    replace(SLOW, frequency_hz=23_200.0, load_n=1.0),
    replace(SLOW, voltage_v=0.0),
)
X_M = np.linspace(0.01, 0.081, 50)
PLACES = Places.along(SETTINGS, [X_M] * len(SETTINGS))


@pytest.mark.parametrize("centre_m", [0.086, 0.0843])
def test_friction_is_that_of_the_top_rung(centre_m: float) -> None:
    """To the tolerance of the fit."""
    rig = replace(RIG, patch_centre_m=centre_m)
    mu = friction_along(PLACES, [rig])[0].reshape(len(SETTINGS), -1)
    for setting, row in zip(SETTINGS, mu, strict=True):
        assert row == pytest.approx(predicted(setting, rig, "consistent", TOP_RUNG, X_M), abs=2e-7)


def test_several_rigs_at_once_are_each_as_alone() -> None:
    rigs = [RIG, replace(RIG, damping_ratio=0.004), replace(RIG, gain=0.9, resonance_hz=24_000.0)]
    together = friction_along(PLACES, rigs)
    for rig, row in zip(rigs, together, strict=True):
        assert row == pytest.approx(friction_along(PLACES, [rig])[0], abs=1e-12)


def test_coordinates_are_reversible() -> None:
    back = rig_at(coordinates(RIG))
    for name in PROPERTIES:
        assert getattr(back, name) == pytest.approx(getattr(RIG, name), rel=1e-12)


def test_slopes_agree_with_differences() -> None:
    at = coordinates(RIG)
    found = slopes(PLACES, at, PROPERTIES)
    widths = (1e-3, 2e-5, 5e-3, 1e-3, 1e-3, 1e-4)
    for column, (name, width) in enumerate(zip(PROPERTIES, widths, strict=True)):
        step = width * np.eye(len(PROPERTIES))[PROPERTIES.index(name)]
        above, below = (friction_along(PLACES, [rig_at(at + s * step)])[0] for s in (1, -1))
        due = (above - below) / (2 * width)
        assert found[:, column] == pytest.approx(due, abs=0.02 * np.abs(due).max())


def test_friction_of_a_bin_is_a_mean_over_the_places_in_it() -> None:
    fine_m = np.linspace(0.03, 0.05, 2001)
    plain = friction_along(Places.along([SLOW], [fine_m]), [RIG])[0]
    at_m = np.linspace(0.032, 0.048, 33)
    blurred = friction_along(Places.along([SLOW], [at_m], [0.2e-3]), [RIG])[0]
    for x_m, mean in zip(at_m, blurred, strict=True):
        weight = np.exp(-(((fine_m - x_m) / 0.2e-3) ** 2) / 2)
        assert mean == pytest.approx(np.average(plain, weights=weight), abs=1.5e-3)


def test_several_patches_move_together() -> None:
    first, second = replace(Patch(), centre_m=0.02), replace(Patch(), centre_m=0.07)
    beam = Beam(length_m=0.12, supports=("clamped", "clamped"), patches=(first, second))
    surface = BeamSurface(structure=Structure(beam=beam))
    own = RigProperties.nominal(surface, friction_coefficient=0.4, resonance_hz=2e4)
    assert own.beam() == beam
    moved = replace(own, patch_centre_m=0.021).beam()
    assert [patch.centre_m for patch in moved.patches] == pytest.approx([0.021, 0.071])
    assert rig_at(coordinates(own), surface).beam().patches == beam.patches


def test_the_printed_law_takes_no_pattern_of_the_papers_beam_on_another() -> None:
    surface = BeamSurface(structure=Structure(beam=Beam(length_m=0.2)))
    own = RigProperties.nominal(surface, friction_coefficient=0.4, resonance_hz=6e3)
    near = replace(SLOW, frequency_hz=6e3)
    x_m = np.linspace(0.01, 0.19, 40)
    assert np.isfinite(predicted(near, own, "printed", TOP_RUNG, x_m)).all()
