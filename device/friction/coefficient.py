"""The friction coefficient of a scene, by a named rung."""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from device.arrays import FloatArray
from device.errors import OutOfRangeError
from device.friction.contact import contact_of
from device.friction.fineness import TOLERANCE, fineness_for
from device.friction.prediction import Batch, LawChoice, law_terms
from device.friction.rungs import rung_field
from device.friction.scenes import Scene

_AT_ONCE = 3000
"""Places computed together: arrays of more leave the processor's cache and cost more per place."""

_choice = lru_cache(maxsize=8)(LawChoice)


def _places(scene: Scene, x_m: ArrayLike | None) -> FloatArray:
    """Return the places `x_m`, shape (n,), or the scene's own place for None."""
    places = np.atleast_1d(np.asarray(scene.touch.x_m if x_m is None else x_m, dtype=np.float64))
    length_m = scene.structure.beam.length_m
    if places.size and not (places.min() >= 0 and places.max() <= length_m):
        row = int(np.flatnonzero(~((places >= 0) & (places <= length_m)))[0])
        raise OutOfRangeError("x_m", f"must lie in [0, {length_m:g}]", places[row], row)
    return places


def scene_batch(scene: Scene, places: FloatArray) -> Batch:
    """Return one scene at many places as a batch."""
    drive = scene.drive
    frequency_hz = np.nan if isinstance(drive.frequency_hz, str) else drive.frequency_hz
    return Batch(
        contact=contact_of(scene, places),
        mode=drive.mode,
        voltage_v=np.array([drive.voltage_v], dtype=np.float64),
        frequency_hz=np.array([frequency_hz], dtype=np.float64),
        damping_ratio=np.array([scene.structure.beam.damping_ratio]),
    )


def friction_coefficient(
    scene: Scene,
    *,
    law: str | LawChoice = "consistent",
    rung: str = "mode",
    x_m: ArrayLike | None = None,
    tolerance: float = TOLERANCE,
) -> FloatArray:
    """Return the friction coefficient μ' of a scene, shape (n,), or (1,) for its own place.

    Args:
        scene: structure, drive and touch.
        law: `printed`, `consistent` or `coulomb`, or a `LawChoice`.
        rung: how the beam's motion is computed; see `device.friction.rungs`.
        x_m: right edges of the finger, shape (n,), in [0, L]; by default the scene's own place.
        tolerance: the largest error in μ' of the numbers on the rung `beam`.

    Raise `OutOfRangeError` for a place off the beam, no such law or rung, and a tolerance below the
    least.

    >>> from device.friction.scenes import Drive
    >>> friction_coefficient(Scene(drive=Drive(voltage_v=0.0)))
    array([0.4])
    """
    places = _places(scene, x_m)
    choice = (_choice(name=law) if isinstance(law, str) else law).on(scene.structure.beam)
    fineness = fineness_for(tolerance)
    field = rung_field(rung, scene.structure.beam, scene.drive, choice.overlap, fineness)
    mu = np.empty(places.shape)
    for first in range(0, places.size, _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        try:
            terms = law_terms(contact_of(scene, places[part]), field, rung, choice, whole=False)
        except OutOfRangeError as error:
            error.row += first  # it counts from the part's first place
            raise
        mu[part] = choice.law(terms)
    return mu
