"""The predicted contrast of a change: how much friction changes, as one number."""

from functools import lru_cache

import numpy as np

from device.beam import Beam
from device.change import Change, Moment
from device.friction import friction_coefficient
from device.mode_shapes import FloatArray
from device.response import natural_frequency_hz
from device.scenes import Drive, Scene, Structure, Touch


def predicted_contrast(change: Change, law: str = "consistent") -> float:
    """Return the contrast of `change`, positive when the change is the expected one.

    Args:
        change: see there for the formula of each effect.
        law: of friction, see `device.laws`.
    """
    before, after = (
        _friction(moment, change.places_m, law) for moment in (change.before, change.after)
    )
    if change.effect == "places":
        return _rms(np.log(after / before))
    if change.effect == "depth":
        resting = Structure().friction_coefficient
        size = _rms(np.log(after / resting)) - _rms(np.log(before / resting))
    else:
        size = float(np.log(before / after).mean())
    return -size if change.contrary else size


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@lru_cache(maxsize=4096)
def _friction(moment: Moment, places_m: tuple[float, ...], law: str) -> FloatArray:
    """The friction coefficient at each place, shape (n,)."""
    scene = Scene(
        structure=Structure() if moment.has_bodies else Structure(body_height_m=0.0),
        drive=_drive(moment),
        touch=Touch(
            contact_m=moment.contact_m,
            finger_load_n=moment.force_n,
            sliding_speed_m_s=moment.sliding_speed_m_s,
        ),
        coverage=moment.coverage,
        direction=moment.direction,
    )
    return friction_coefficient(scene, law=law, x_m=places_m)


def _drive(moment: Moment) -> Drive:
    if moment.frequency == 1:
        return Drive(voltage_v=moment.voltage_v)
    resonance_hz = float(natural_frequency_hz(Beam(), Drive().mode))
    return Drive(voltage_v=moment.voltage_v, frequency_hz=moment.frequency * resonance_hz)
