"""The friction coefficient of a scene, or of one scene at many places."""

import numpy as np
from numpy.typing import ArrayLike

from device.contact import contact_of, contact_state
from device.laws import law_by_name
from device.mode_shapes import FloatArray
from device.ranges import OutOfRangeError
from device.rungs import reference_tip_speed_m_s, rung_by_name
from device.scenes import Scene


def _places(scene: Scene, x_m: ArrayLike | None) -> FloatArray:
    """The places asked for, shape (n,); the scene's own when none are."""
    places = np.atleast_1d(np.asarray(scene.touch.x_m if x_m is None else x_m, dtype=np.float64))
    length_m = scene.structure.beam.length_m
    if not ((places >= 0) & (places <= length_m)).all():
        wrong = places[~((places >= 0) & (places <= length_m))][0]
        raise OutOfRangeError("x_m", f"must lie in [0, {length_m:g}]", wrong)
    return places


def friction_coefficient(
    scene: Scene, *, law: str = "consistent", rung: str = "mode", x_m: ArrayLike | None = None
) -> FloatArray:
    """The friction coefficient μ' of a scene.

    Args:
        scene: structure, drive and touch.
        law: `printed`, `consistent` or `coulomb`.
        rung: how the beam's motion is found; see `device.rungs`.
        x_m: right edges of the finger, shape (n,), in [0, L]; the scene's own place without it.

    Returns:
        μ', dimensionless, shape (n,) (shape (1,) for the scene's own place).

    Raises:
        OutOfRangeError: a place lies off the beam, or there is no such law or rung.

    >>> from device.scenes import Drive
    >>> friction_coefficient(Scene(drive=Drive(voltage_v=0.0)))
    array([0.4])
    """
    places = _places(scene, x_m)
    field = rung_by_name(rung)(scene.structure.beam, scene.drive)
    state = contact_state(contact_of(scene, places), field, reference_tip_speed_m_s(rung))
    friction = law_by_name(law)(state.terms)
    return np.broadcast_to(friction, places.shape) if friction.shape != places.shape else friction
