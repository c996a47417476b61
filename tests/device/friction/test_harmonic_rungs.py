"""Rungs that solve the segmented beam, against matrix exponentials in 40 digits."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import mpmath as mp
import numpy as np
import pytest

from device.beam.beam import Beam
from device.beam.modes import modal_displacement_m, natural_frequency_hz
from device.beam.motion import modal_motion, motion_pattern, segmented_motion
from device.beam.timoshenko import segmented_natural_frequency_hz
from device.friction.changes import CONDITIONS, Moment, predicted_contrast
from device.friction.coefficient import friction_coefficient
from device.friction.rungs import TOP_RUNG, rung_field, rung_resonance_hz
from device.friction.scenes import Drive, FingerContact, Scene, Structure
from tests.device.friction import harmonic_reference as reference
from tests.device.friction.harmonic_reference import Driven, Model

FLAGS = {"euler-patched": (True, False), "timoshenko": (False, True), TOP_RUNG: (True, True)}


@pytest.mark.parametrize("mode", [1, 2, 6, 13, 25])
@pytest.mark.parametrize("rung", FLAGS)
def test_natural_frequencies_are_right(rung: str, mode: int) -> None:
    patched, shear = FLAGS[rung]
    ours = rung_resonance_hz(rung, Beam(), mode)
    exact = reference.natural_frequency(patched, shear, ours)
    assert abs(ours / exact - 1) < 1e-12


def test_bare_euler_beams_natural_frequencies_are_the_closed_forms() -> None:
    for mode in (1, 6, 20, 60):
        segmented = segmented_natural_frequency_hz(Beam(), mode, patched=False, shear=False)
        assert segmented == pytest.approx(natural_frequency_hz(Beam(), mode), rel=1e-12)


def test_published_ladder_resonances() -> None:
    assert [round(rung_resonance_hz(rung, Beam(), 6), 1) for rung in FLAGS] == [
        24513.1,
        21320.2,
        21624.8,
    ]


@dataclass(frozen=True)
class Point:
    """A scene for the comparison."""

    rung: str
    damping: float
    mode: int
    detuning: float | None
    x_m: float
    load_n: float


POINTS = [
    Point(TOP_RUNG, 0.005, 6, None, 0.0414, 0.5),
    Point(TOP_RUNG, 1e-6, 6, None, 0.0300, 20.0),
    Point("timoshenko", 0.3, 3, 0.9, 0.0950, 1e-3),
    Point("euler-patched", 0.005, 4, 1.02, 0.0870, 1.0),
    Point("timoshenko", 0.01, 20, None, 0.0414, 2.0),
]


@lru_cache(maxsize=8)
def _reference_tip_speed(rung: str) -> mp.mpf:
    patched, shear = FLAGS[rung]
    frequency = reference.natural_frequency(patched, shear, rung_resonance_hz(rung, Beam(), 6))
    driven = Driven(Model(patched=patched, shear=shear, damping=0.005), frequency)
    lever = mp.mpf(5e-3) / 2 + mp.mpf(1e-3)
    return 100 * mp.sqrt(2) * driven.omega * lever * driven.rms_rotation()


def _exact_mu(point: Point, frequency: mp.mpf) -> dict[str, mp.mpf]:
    """μ' of the repaired laws in 40 digits."""
    patched, shear = FLAGS[point.rung]
    driven = Driven(
        Model(patched=patched, shear=shear, damping=point.damping, mode=point.mode), frequency
    )
    high, low = mp.mpf(point.x_m), mp.mpf(point.x_m) - mp.mpf(0.01)
    edges = driven.edges()
    right = mp.mpf(0)
    for a, b in pairwise(edges):
        moves_right = driven.direction((a + b) / 2) > 0
        right += max(mp.mpf(0), min(high, b) - max(low, a)) * moves_right
    r = right / (high - low)
    lever = mp.mpf(5e-3) / 2 + mp.mpf(1e-3)
    tip = 100 * mp.sqrt(2) * driven.omega * lever * driven.rms_rotation()
    s = tip / _reference_tip_speed(point.rung)
    eta = mp.tanh(mp.log(3) / 2 * s)
    inertia = mp.mpf(0.01) * driven.omega**2 * 100 * driven.area(low, high) / mp.pi
    p = inertia / mp.mpf(point.load_n)
    mu = mp.mpf(0.4)
    return {
        "consistent": mu * (1 + eta * (1 - 2 * r) + mp.tanh(mp.pi * p) / mp.pi),
        "coulomb": mu * (1 - eta * r),
    }


@pytest.mark.parametrize("point", POINTS, ids=lambda p: f"{p.rung}-{p.mode}-{p.damping:g}")
def test_friction_is_right_to_1e_9(point: Point) -> None:
    resonance_hz = rung_resonance_hz(point.rung, Beam(), point.mode)
    if point.detuning is None:
        drive = Drive(mode=point.mode)
        frequency = reference.natural_frequency(*FLAGS[point.rung], resonance_hz)
    else:
        drive = Drive(mode=point.mode, frequency_hz=point.detuning * resonance_hz)
        frequency = mp.mpf(point.detuning * resonance_hz)
    scene = Scene(
        structure=Structure(beam=Beam(damping_ratio=point.damping)),
        drive=drive,
        touch=FingerContact(x_m=point.x_m, contact_m=0.01, finger_load_n=point.load_n),
    )
    with mp.workdps(40):
        exact = _exact_mu(point, frequency)
    for law, value in exact.items():
        ours = friction_coefficient(scene, law=law, rung=point.rung)[0]
        assert abs(ours / value - 1) < 1e-9


@lru_cache(maxsize=2)
def _driven_at(frequency: float) -> Driven:
    """The top rung's motion, driven at a frequency relative to its resonance."""
    resonance_hz = reference.natural_frequency(
        patched=True, shear=True, near_hz=rung_resonance_hz(TOP_RUNG, Beam(), 6)
    )
    return Driven(Model(patched=True, shear=True, damping=0.005), resonance_hz * frequency)


@lru_cache(maxsize=8)
def _sums(frequency: float, places_m: tuple[float, ...]) -> list[tuple[mp.mpf, mp.mpf]]:
    """Right-moving length and ∫|W|dx under a finger of 10 mm at each place."""
    driven = _driven_at(frequency)
    zones = [(a, b) for a, b in pairwise(driven.edges()) if driven.direction((a + b) / 2) > 0]
    windows = [(mp.mpf(x) - mp.mpf(0.01), mp.mpf(x)) for x in places_m]
    # Ends of windows that differ by rounding bound one cell.
    ends = {round(float(end), 12): end for window in windows for end in window}
    known = {key: mp.mpf(0) for key in ends}
    for low, high in pairwise(sorted(ends)):
        known[high] = known[low] + driven.area(ends[low], ends[high])
    return [
        (
            mp.fsum(max(mp.mpf(0), min(high, b) - max(low, a)) for a, b in zones),
            known[round(float(high), 12)] - known[round(float(low), 12)],
        )
        for low, high in windows
    ]


def _exact_friction(moment: Moment, places_m: tuple[float, ...], law: str) -> list[mp.mpf]:
    """μ' of a moment of the paper's conditions at each place, in 40 digits."""
    driven = _driven_at(moment.frequency)
    lever = mp.mpf(5e-3) / 2 + mp.mpf(1e-3) * moment.has_bodies
    tip = moment.voltage_v * mp.sqrt(2) * driven.omega * lever * driven.rms_rotation()
    eta = mp.tanh(mp.log(3) / 2 * tip / _reference_tip_speed(TOP_RUNG))
    inertia = mp.mpf(0.01) * driven.omega**2 * moment.voltage_v / mp.pi
    found = []
    for right_m, area in _sums(moment.frequency, places_m):
        share = right_m / mp.mpf(0.01)
        r = share if moment.direction == "right" else 1 - share
        p = inertia * area / mp.mpf(moment.force_n)
        bracket = 1 - eta * r
        if law == "consistent":
            bracket = 1 + eta * (1 - 2 * r) + mp.tanh(mp.pi * p) / mp.pi
        found.append(mp.mpf(0.4) * bracket)
    return found


def _rms(values: list[mp.mpf]) -> mp.mpf:
    return mp.sqrt(mp.fsum(value**2 for value in values) / len(values))


@pytest.mark.parametrize("law", ["consistent", "coulomb"])
@pytest.mark.parametrize("name", CONDITIONS)
def test_contrasts_of_the_paper_conditions_are_right_to_1e_9(name: str, law: str) -> None:
    change = CONDITIONS[name]
    with mp.workdps(40):
        before, after = (
            _exact_friction(moment, change.places_m, law)
            for moment in (change.before, change.after)
        )
        ratios = [mp.log(a / b) for a, b in zip(before, after, strict=True)]
        exact = {
            "friction": mp.fsum(ratios) / len(ratios),
            "places": _rms(ratios),
            "depth": _rms([mp.log(mu / mp.mpf(0.4)) for mu in after])
            - _rms([mp.log(mu / mp.mpf(0.4)) for mu in before]),
        }[change.effect]
    assert abs(predicted_contrast(change, law) - exact) < 1e-9


def test_a_sharp_resonance_costs_no_more_than_rounding_its_frequency() -> None:
    near_hz = rung_resonance_hz(TOP_RUNG, Beam(), 6) * (1 + 2e-6)
    with mp.workdps(40):
        rotations = [
            Driven(Model(patched=True, shear=True, damping=1e-6), hz).rms_rotation()
            for hz in (near_hz, near_hz * (1 + mp.mpf(2) ** -53))
        ]
    field = rung_field(TOP_RUNG, Beam(damping_ratio=1e-6), Drive(frequency_hz=near_hz))
    rounding = abs(rotations[1] / rotations[0] - 1)
    assert abs(float(field.rotation) / 100 / rotations[0] - 1) < 10 * rounding


def test_without_shear_and_patches_the_beam_is_the_sum_of_its_modes() -> None:
    beam, frequency_hz = Beam(damping_ratio=1e-4), 15_000.0
    direct = motion_pattern(segmented_motion(beam, frequency_hz, patched=False, shear=False))
    summed = motion_pattern(modal_motion(beam, frequency_hz, 60))
    assert direct.rms_m_per_v == pytest.approx(summed.rms_m_per_v, rel=1e-4)
    assert direct.edges_m == pytest.approx(summed.edges_m, abs=3e-5)


def test_at_a_sharp_resonance_the_sum_of_modes_is_one_mode() -> None:
    beam = Beam(damping_ratio=1e-6)
    summed = rung_field("modes:8", beam, Drive())
    alone = modal_displacement_m(beam, 6, 100.0, natural_frequency_hz(beam, 6))
    assert float(summed.displacement_m) == pytest.approx(float(alone), rel=1e-6)


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


def test_a_mode_beyond_the_cut_off_is_refused() -> None:
    with pytest.raises(
        ValueError, match=r"mode must lie below the beam's cut-off at 218 kHz .* 27"
    ):
        segmented_natural_frequency_hz(Beam(), 27, patched=False, shear=True)
