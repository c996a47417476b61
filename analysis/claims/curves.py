"""Friction along the beam and under a whole hand, as the paper draws it (Figs 8, 12, 13, 14)."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from device.beam.beam import Beam
from device.beam.modes import FloatArray, natural_frequency_hz
from device.friction.coefficient import friction_coefficient
from device.friction.scenes import Drive, FingerContact, Scene, Structure

PATCH_START_M = 0.081
PLACES_M = np.linspace(0.0, 0.1, 2001)
OPERATING_M = 0.0231  # where Eq 15 becomes periodic: what comes before is the first rise
MU = 0.4
CONTACT_M = 0.01


def local_scene(*, voltage_v: float = 100.0, mode: int = 6, detuning: float = 1.0) -> Scene:
    """The paper's scene under one finger; the drive at `detuning` times the resonance."""
    return Scene(drive=_drive(voltage_v, mode, detuning))


def _drive(voltage_v: float, mode: int, detuning: float) -> Drive:
    if detuning == 1.0:
        return Drive(voltage_v=voltage_v, mode=mode)
    frequency_hz = detuning * natural_frequency_hz(Beam(), mode)
    return Drive(voltage_v=voltage_v, frequency_hz=frequency_hz, mode=mode)


@lru_cache(maxsize=256)
def local_curve(law: str, scene: Scene) -> FloatArray:
    """Μ' at `PLACES_M`."""
    return friction_coefficient(scene, law=law, x_m=PLACES_M)


def operating(curve: FloatArray) -> FloatArray:
    """The part of a curve in which Eq 15 is periodic."""
    return curve[PLACES_M >= OPERATING_M]


def trough_places_m(curve: FloatArray) -> FloatArray:
    """The middles of a curve's minima, plateaus included, deeper than 0.01 beside both peaks."""
    from scipy.signal import find_peaks

    found, _ = find_peaks(-np.round(curve, 9), prominence=0.01)
    return np.asarray(PLACES_M[found])


def full_coverage(
    law: str,
    *,
    same_direction: float = 10.0,
    bodies: int = 20,
    load_n: float = 20.0,
    voltage_v: float = 100.0,
    detuning: float = 1.0,
) -> float:
    """Μ' of a hand on the whole beam with a same-directional bodies of u."""
    scene = Scene(
        structure=Structure(body_count=bodies),
        drive=_drive(voltage_v, 6, detuning),
        touch=FingerContact(body_load_n=load_n),
        coverage="full",
        same_direction_fraction=same_direction / bodies,
    )
    return float(friction_coefficient(scene, law=law)[0])


def leftward(scene: Scene) -> Scene:
    """The same scene with the finger moving left."""
    return replace(scene, direction="left")


def swing(curve: FloatArray) -> float:
    """Half the distance between a curve's highest and lowest value."""
    return float(np.ptp(curve)) / 2


def centre(curve: FloatArray) -> float:
    """The middle between a curve's highest and lowest value."""
    return float(curve.max() + curve.min()) / 2


def falling(values: Sequence[float]) -> bool:
    """Whether each value lies below the one before."""
    return all(b < a for a, b in pairwise(values))


def spread(values: Sequence[float]) -> float:
    """The distance of the largest value from the smallest."""
    return max(values) - min(values)
