"""The rungs `beam` and `own-mode` in the paper's scenes, against exact waves."""

import re
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pytest

from device.arrays import FloatArray
from device.beam.beam import Beam, Patch
from device.friction.changes import CONDITIONS, Moment, predicted_contrast
from device.friction.coefficient import friction_coefficient
from device.friction.fineness import DEFAULT, TOLERANCES, fineness_for
from device.friction.rungs import REFERENCE_RATIO, TOP_RUNG, rung_field, rung_resonance_hz
from device.friction.scenes import (
    REFERENCE_SPEED_M_S,
    Drive,
    FingerContact,
    Scene,
    Structure,
)
from tests.device.beam import exact_waves
from tests.device.beam.exact_waves import Waves


@dataclass(frozen=True)
class Point:
    """A scene for the comparison."""

    damping: float
    mode: int
    detuning: float | None
    x_m: float
    load_n: float


POINTS = [
    Point(0.005, 6, None, 0.0414, 0.5),
    Point(1e-6, 6, None, 0.0300, 20.0),
    Point(0.3, 3, 0.9, 0.0950, 1e-3),
    Point(0.005, 4, 1.02, 0.0870, 1.0),
    Point(0.01, 20, None, 0.0414, 2.0),
]


@pytest.mark.parametrize("point", POINTS, ids=lambda p: f"{p.mode}-{p.damping:g}")
def test_friction_is_that_of_exact_waves(point: Point) -> None:
    own_hz = rung_resonance_hz(TOP_RUNG, Beam(), point.mode)
    driven_hz = None if point.detuning is None else point.detuning * own_hz
    scene = Scene(
        structure=Structure(beam=Beam(damping_ratio=point.damping)),
        drive=Drive(mode=point.mode, frequency_hz=driven_hz or "resonance"),
        touch=FingerContact(x_m=point.x_m, contact_m=0.01, finger_load_n=point.load_n),
    )
    exact_hz = driven_hz or exact_waves.natural_frequency(Beam(), own_hz)
    waves = Waves(Beam(), exact_hz, point.damping).solve()
    exact = exact_waves.friction(scene, waves, np.array([point.x_m]))
    for law, value in exact.items():
        ours = friction_coefficient(scene, law=law, rung=TOP_RUNG)[0]
        assert ours == pytest.approx(float(value[0]), abs=1e-7)


def test_the_constant_of_the_skin_is_that_of_the_papers_scene() -> None:
    """η is ½ at 100 V in resonance for a finger at the reference speed."""
    own_hz = exact_waves.natural_frequency(Beam(), rung_resonance_hz(TOP_RUNG, Beam(), 6))
    waves = Waves(Beam(), own_hz, 0.005).solve()
    tip = 100 * np.sqrt(2) * float(waves.omega) * 3.5e-3 * waves.rms()[1]
    assert pytest.approx(tip / REFERENCE_SPEED_M_S, rel=1e-8) == REFERENCE_RATIO


@lru_cache(maxsize=2)
def _driven_at(frequency: float) -> Waves:
    """The motion at a frequency relative to the resonance."""
    own_hz = exact_waves.natural_frequency(Beam(), rung_resonance_hz(TOP_RUNG, Beam(), 6))
    return Waves(Beam(), own_hz * frequency, 0.005).solve()


def _exact_friction(moment: Moment, places_m: tuple[float, ...], law: str) -> FloatArray:
    """μ' of a moment of the paper's conditions at each place."""
    scene = Scene(
        structure=Structure(body_height_m=1e-3 * moment.has_bodies),
        drive=Drive(voltage_v=moment.voltage_v),
        touch=FingerContact(contact_m=0.01, finger_load_n=moment.force_n),
        direction=moment.direction,
    )
    return exact_waves.friction(scene, _driven_at(moment.frequency), np.array(places_m))[law]


@pytest.mark.parametrize("law", ["consistent", "coulomb"])
@pytest.mark.parametrize("name", CONDITIONS)
def test_contrasts_of_the_paper_conditions_are_those_of_exact_waves(name: str, law: str) -> None:
    change = CONDITIONS[name]
    before, after = (
        _exact_friction(moment, change.places_m, law) for moment in (change.before, change.after)
    )
    ratios = np.log(before / after)

    def depth(friction: FloatArray) -> float:
        return float(np.sqrt(np.mean(np.log(friction / 0.4) ** 2)))

    exact = {
        "friction": ratios.mean(),
        "places": np.sqrt(np.mean(ratios**2)),
        "depth": depth(after) - depth(before),
    }[change.effect]
    assert predicted_contrast(change, law) == pytest.approx(float(exact), abs=1e-7)


def test_a_sharp_resonance_costs_no_more_than_rounding_its_frequency() -> None:
    near_hz = rung_resonance_hz(TOP_RUNG, Beam(), 6) * (1 + 2e-6)
    turns = [Waves(Beam(), hz, 1e-6).solve().rms()[1] for hz in (near_hz, near_hz * (1 + 2.0**-52))]
    field = rung_field(TOP_RUNG, Beam(damping_ratio=1e-6), Drive(frequency_hz=near_hz))
    rounding = abs(turns[1] / turns[0] - 1)
    assert abs(float(field.rotation[0]) / 100 / turns[0] - 1) < 100 * rounding


@pytest.mark.parametrize("damping", [1e-6, 1e-4, 0.005, 0.2])
@pytest.mark.parametrize("frequency_hz", [1e-3, 100.0, 21_624.85, 150_000.0])
def test_no_warning_and_no_nan_far_from_and_at_resonance(
    damping: float, frequency_hz: float
) -> None:
    places = np.linspace(0.0, 0.1, 301)
    for voltage_v in (0.0, 1e-3, 1e4):
        for load_n in (1e-6, 1e3):
            scene = Scene(
                structure=Structure(beam=Beam(damping_ratio=damping), body_count=1),
                drive=Drive(voltage_v=voltage_v, frequency_hz=frequency_hz),
                touch=FingerContact(body_load_n=load_n),
            )
            for law in ("printed", "consistent", "coulomb"):
                mu = friction_coefficient(scene, law=law, rung=TOP_RUNG, x_m=places)
                assert np.isfinite(mu).all()
                assert (mu > 0).all()


def test_places_asked_for_in_parts_give_what_they_give_together() -> None:
    scene = Scene(drive=Drive(frequency_hz=23_200.0), touch=FingerContact(contact_m=2e-3))
    places = np.random.default_rng(4).uniform(0.0, 0.1, 300)
    together = friction_coefficient(scene, rung=TOP_RUNG, x_m=places)
    for size in (1, 7, 100):
        parts = [places[first : first + size] for first in range(0, places.size, size)]
        mu = [friction_coefficient(scene, rung=TOP_RUNG, x_m=part) for part in parts]
        np.testing.assert_allclose(np.concatenate(mu), together, rtol=1e-12)


def test_a_drive_above_the_cut_off_is_refused() -> None:
    scene = Scene(drive=Drive(frequency_hz=2.3e5))
    message = "frequency_hz must be at most the beam's cut-off, 218"
    with pytest.raises(ValueError, match=re.escape(message)):
        friction_coefficient(scene, rung=TOP_RUNG)


def test_one_mode_as_built_is_the_whole_motion_at_a_sharp_resonance() -> None:
    beam, places = Beam(damping_ratio=1e-7), np.linspace(0.001, 0.1, 100)
    scene = Scene(structure=Structure(beam=beam), drive=Drive(voltage_v=1e-3))
    ours, whole = (friction_coefficient(scene, rung=r, x_m=places) for r in ("own-mode", "beam"))
    np.testing.assert_allclose(ours, whole, atol=1e-6)
    nominal = Scene(touch=FingerContact(finger_load_n=0.5))
    ours, bare, whole = (
        friction_coefficient(nominal, rung=r, x_m=places) for r in ("own-mode", "mode", "beam")
    )
    assert np.abs(ours - whole).max() < 2e-3 < np.abs(bare - whole).max()


def test_one_mode_is_refused_where_it_has_a_small_share_of_the_motion() -> None:
    """A patch about a node of the mode's curvature hardly drives it."""
    nodal = Beam(patches=(Patch(centre_m=0.077, length_m=0.01),))
    message = (
        "rung must be that of a mode with 0.9 or more of the motion on the rung own-mode; mode"
    )
    with pytest.raises(ValueError, match=message):
        friction_coefficient(Scene(structure=Structure(beam=nodal)), rung="own-mode")


@pytest.mark.parametrize("tolerance", [0.0, 1e-9, -1.0])
def test_a_tolerance_below_the_least_is_refused(tolerance: float) -> None:
    with pytest.raises(ValueError, match=f"tolerance must be at least 1e-08, got {tolerance:g}"):
        friction_coefficient(Scene(), rung=TOP_RUNG, tolerance=tolerance)


def test_the_coarsest_that_keeps_a_tolerance_is_taken() -> None:
    assert fineness_for(0.5) == fineness_for(TOLERANCES[0])
    assert fineness_for(5e-5) == fineness_for(1e-5)
    assert fineness_for(1e-6) == DEFAULT
    cells = [fineness_for(tolerance).cells for tolerance in TOLERANCES]
    assert cells == sorted(cells)
