"""The friction coefficient of a scene, or of one scene at many places."""

import numpy as np
from numpy.typing import ArrayLike

from device.contact import contact_of
from device.laws import law_by_name
from device.mode_shapes import FloatArray
from device.prediction import Batch, LawChoice, law_state
from device.ranges import OutOfRangeError
from device.rungs import rung_field
from device.scenes import Scene


def _places(scene: Scene, x_m: ArrayLike | None) -> FloatArray:
    """The places asked for, shape (n,); the scene's own when none are."""
    places = np.atleast_1d(np.asarray(scene.touch.x_m if x_m is None else x_m, dtype=np.float64))
    length_m = scene.structure.beam.length_m
    if places.size and not (places.min() >= 0 and places.max() <= length_m):
        wrong = places[~((places >= 0) & (places <= length_m))][0]
        raise OutOfRangeError("x_m", f"must lie in [0, {length_m:g}]", wrong)
    return places


def scene_batch(scene: Scene, places: FloatArray) -> Batch:
    """One scene at many places as a batch."""
    drive = scene.drive
    frequency_hz = np.nan if isinstance(drive.frequency_hz, str) else drive.frequency_hz
    return Batch(
        contact=contact_of(scene, places),
        mode=drive.mode,
        voltage_v=np.full(places.size, drive.voltage_v),
        frequency_hz=np.full(places.size, frequency_hz),
        damping_ratio=np.full(places.size, scene.structure.beam.damping_ratio),
    )


def friction_coefficient(
    scene: Scene,
    *,
    law: str | LawChoice = "consistent",
    rung: str = "mode",
    x_m: ArrayLike | None = None,
    tolerance: float = 0.01,
) -> FloatArray:
    """The friction coefficient μ' of a scene.

    Args:
        scene: structure, drive and touch.
        law: `printed`, `consistent` or `coulomb`, or a `LawChoice`.
        rung: how the beam's motion is found; see `device.rungs`. `auto` takes, place by place,
            the cheapest rung that is certified to be within `tolerance` of the top rung.
        x_m: right edges of the finger, shape (n,), in [0, L]; the scene's own place without it.
        tolerance: the largest error in μ' that `auto` may make.

    Returns:
        μ', dimensionless, shape (n,) (shape (1,) for the scene's own place).

    Raises:
        OutOfRangeError: a place lies off the beam, or there is no such law or rung.

    >>> from device.scenes import Drive
    >>> friction_coefficient(Scene(drive=Drive(voltage_v=0.0)))
    array([0.4])
    """
    places = _places(scene, x_m)
    choice = LawChoice(name=law) if isinstance(law, str) else law
    if rung == "auto":
        from device.auto import auto_prediction

        chosen = auto_prediction(scene_batch(scene, places), choice, tolerance)
        return chosen.prediction.mu_effective
    field = rung_field(rung, scene.structure.beam, scene.drive, choice.overlap)
    contact = contact_of(scene, places)
    terms = law_state(contact, field, rung, choice).terms
    return np.broadcast_to(law_by_name(choice.name)(terms), places.shape)
