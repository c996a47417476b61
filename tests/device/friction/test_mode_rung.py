"""μ' of every law on the rung `mode` against 50 digits, over all drives and loads."""

import itertools

import mpmath as mp
import numpy as np
import pytest

from device.beam.beam import Beam
from device.beam.eq15 import same_direction_ratio
from device.friction.coefficient import friction_coefficient
from device.friction.prediction import LawChoice
from device.friction.rungs import rung_resonance_hz
from device.friction.scenes import REFERENCE_TIP_SPEED_M_S, Drive, FingerContact, Scene, Structure
from tests.device.beam import beam_reference as reference

CONTACT_M = 0.01
Point = tuple[int, float, float, tuple[float, int, float], object]


def _natural(mode: int) -> mp.mpf:
    root = reference.root(mode)
    rigidity = mp.mpf(105e9) * mp.mpf(5e-3) ** 3 / 12 / (mp.mpf(8500) * mp.mpf(5e-3))
    return root**2 / (2 * mp.pi * mp.mpf(0.1) ** 2) * mp.sqrt(rigidity)


def _displacement(mode: int, voltage: float, frequency: mp.mpf, damping: float) -> mp.mpf:
    start = (mp.mpf(0.086) - mp.mpf(0.010) / 2) / mp.mpf(0.1)
    stop = (mp.mpf(0.086) + mp.mpf(0.010) / 2) / mp.mpf(0.1)
    difference = (reference.slope(mode, stop) - reference.slope(mode, start)) / mp.mpf(0.1)
    moment = 2 * 2 * mp.mpf(5e-3) * (mp.mpf(5e-3) + mp.mpf(0.3e-3)) / 2 * mp.mpf(voltage)
    mass = mp.mpf(8500) * mp.mpf(5e-3) ** 2 * mp.mpf(0.1)
    omega, own = 2 * mp.pi * frequency, 2 * mp.pi * _natural(mode)
    stiffness = mp.mpc(own**2 - omega**2, 2 * mp.mpf(damping) * own * omega)
    return abs(moment * difference / mass / stiffness)


def _exact(scene: Scene, frequency: mp.mpf) -> dict[str, mp.mpf]:
    mode, touch, structure = scene.drive.mode, scene.touch, scene.structure
    q = _displacement(mode, scene.drive.voltage_v, frequency, structure.beam.damping_ratio)
    omega, b = 2 * mp.pi * frequency, reference.root(mode)
    right, area = reference.window(mode, 0.1, touch.x_m, CONTACT_M)
    covered = min(mp.mpf(CONTACT_M), mp.mpf(touch.x_m))
    lever = mp.mpf(5e-3) / 2 + mp.mpf(structure.body_height_m)
    tip = mp.sqrt(2) * omega * b / mp.mpf(0.1) * lever * q
    s = tip / mp.mpf(REFERENCE_TIP_SPEED_M_S)
    eta = mp.tanh(mp.log(3) / 2 * s)
    load = structure.body_count * mp.mpf(touch.body_load_n)
    inertia = mp.mpf(structure.body_mass_kg) * omega**2 * q / mp.pi * area * mp.mpf(0.1)
    p = inertia / covered / (load / mp.mpf(0.1))
    eq15 = mp.mpf(float(same_direction_ratio(np.array([touch.x_m]), CONTACT_M)[0]))
    mu = mp.mpf(structure.friction_coefficient)
    return {
        "consistent": mu * (1 + eta * (1 - 2 * right) + mp.tanh(mp.pi * p) / mp.pi),
        "coulomb": mu * (1 - eta * right),
        "printed": mu * (mp.mpf(3) / 2 - eq15 + inertia / load),
    }


GRID = list(
    itertools.product(
        (1, 2, 6, 27, 40),
        (0.0, 1e-3, 100.0, 1e4),
        (1e-6, 0.005, 0.5),
        ((1e-6, 1, 0.0414), (20.0, 20, 0.093), (1e3, 7, 0.0005)),
        ("resonance", 0.3, 1.7),
    )
)


@pytest.mark.parametrize("point", GRID[::7], ids=str)
def test_friction_is_right_to_1e_9(point: Point) -> None:
    mode, voltage_v, damping, (load_n, bodies, x_m), detuning = point
    own_hz = rung_resonance_hz("mode", Beam(), mode)
    frequency_hz = detuning * own_hz if isinstance(detuning, float) else None
    scene = Scene(
        structure=Structure(beam=Beam(damping_ratio=damping), body_count=bodies),
        drive=Drive(voltage_v=voltage_v, frequency_hz=frequency_hz or "resonance", mode=mode),
        touch=FingerContact(x_m=x_m, contact_m=CONTACT_M, body_load_n=load_n),
    )
    with mp.workdps(reference.DIGITS + 2 * mode):
        exact = _exact(scene, _natural(mode) if frequency_hz is None else mp.mpf(frequency_hz))
    for law, value in exact.items():
        ours = friction_coefficient(scene, law=law)[0]
        assert abs(ours / value - 1) < 1e-9


def test_a_number_beside_a_sharp_resonance_costs_no_more_than_its_own_rounding() -> None:
    frequency_hz = rung_resonance_hz("mode", Beam(), 6) * (1 + 1e-6)
    scene = Scene(
        structure=Structure(beam=Beam(damping_ratio=1e-6)),
        drive=Drive(voltage_v=0.05, frequency_hz=frequency_hz),
    )
    with mp.workdps(60):
        exact = _exact(scene, mp.mpf(frequency_hz))["consistent"]
        moved = _exact(scene, mp.mpf(frequency_hz) * (1 + mp.mpf(2) ** -53))["consistent"]
    ours = friction_coefficient(scene)[0]
    assert abs(ours - exact) <= 10 * abs(moved - exact)


def test_eq15_gives_the_printed_ratio_and_the_rung_gives_its_own() -> None:
    own = friction_coefficient(Scene(), law=LawChoice(name="printed", ratio="mode"))[0]
    eq15 = friction_coefficient(Scene(), law="printed")[0]
    assert own != eq15
