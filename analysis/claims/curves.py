"""Friction along the beam and under a whole hand (the paper's Figs 8, 12, 13 and 14)."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from analysis.claims.claim import Finding, finding
from device.beam.beam import Beam
from device.beam.modes import FloatArray, natural_frequency_hz
from device.beam.zones import zones
from device.friction.changes import PATH_M
from device.friction.coefficient import friction_coefficient
from device.friction.scenes import Drive, FingerContact, Scene, Structure

BEAM = Beam()
ZONES = zones(6, BEAM.length_m)
PATCH_START_M = BEAM.patches.start_m
PLACES_M = np.linspace(0.0, 0.1, 2001)
OPERATING_M = 0.0231  # Eq 15 is periodic from here on; the first rise lies before
MU = 0.4
CONTACT_M = 0.01


def local_scene(*, voltage_v: float = 100.0, mode: int = 6, detuning: float = 1.0) -> Scene:
    """Return the paper's scene under one finger, driven at `detuning` times the resonance."""
    return Scene(drive=_drive(voltage_v, mode, detuning))


def _drive(voltage_v: float, mode: int, detuning: float) -> Drive:
    if detuning == 1.0:
        return Drive(voltage_v=voltage_v, mode=mode)
    frequency_hz = detuning * natural_frequency_hz(BEAM, mode)
    return Drive(voltage_v=voltage_v, frequency_hz=frequency_hz, mode=mode)


@lru_cache(maxsize=256)
def local_curve(law: str, scene: Scene, rung: str = "mode") -> FloatArray:
    """Return μ' at `PLACES_M`."""
    return friction_coefficient(scene, law=law, rung=rung, x_m=PLACES_M)


def along_path(law: str, scene: Scene, rung: str = "mode") -> FloatArray:
    """Return μ' along the path of the paper's conditions."""
    return friction_coefficient(scene, law=law, rung=rung, x_m=np.linspace(*PATH_M, 711))


def mu(law: str, scene: Scene, rung: str = "mode") -> float:
    """Return μ' of a scene at its own place."""
    return float(friction_coefficient(scene, law=law, rung=rung)[0])


def operating(curve: FloatArray) -> FloatArray:
    """Return the part of a curve in which Eq 15 is periodic."""
    return curve[PLACES_M >= OPERATING_M]


def trough_places_m(curve: FloatArray) -> FloatArray:
    """Return the middles of minima, plateaus included, that are 0.01 below both adjacent peaks."""
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
    """Return μ' of a hand on the whole beam, `same_direction` of whose `bodies` help."""
    scene = Scene(
        structure=Structure(body_count=bodies),
        drive=_drive(voltage_v, 6, detuning),
        touch=FingerContact(body_load_n=load_n),
        coverage="full",
        same_direction_fraction=same_direction / bodies,
    )
    return mu(law, scene)


def leftward(scene: Scene) -> Scene:
    """Return the scene with the finger moving left."""
    return replace(scene, direction="left")


def swing(curve: FloatArray) -> float:
    """Return half the range of a curve."""
    return float(np.ptp(curve)) / 2


def centre(curve: FloatArray) -> float:
    """Return the middle of a curve's range."""
    return float(curve.max() + curve.min()) / 2


def falling(values: Sequence[float]) -> bool:
    """Return whether each value lies below the one before."""
    return all(b < a for a, b in pairwise(values))


def rising(values: Sequence[float]) -> bool:
    """Return whether each value lies above the one before."""
    return all(b > a for a, b in pairwise(values))


def spread(values: Sequence[float]) -> float:
    """Return the range of the values."""
    return max(values) - min(values)


def from_02_to_06(low: float, high: float) -> Finding:
    """Return whether these extremes of μ' are about 0.2 and 0.6, as in Figs 8 and 12."""
    return finding([abs(low - 0.2) < 0.02, abs(high - 0.6) < 0.02], lowest=low, highest=high)
