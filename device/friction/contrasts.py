"""The predicted contrast of a change: how much friction changes, as one number."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from device.beam.beam import Beam
from device.beam.modes import FloatArray
from device.friction.calibration import NOMINAL, Calibration
from device.friction.changes import Change, Moment
from device.friction.coefficient import friction_coefficient
from device.friction.rungs import TOP_RUNG, rung_resonance_hz
from device.friction.scenes import Drive, FingerContact, Scene, Structure

LAW, RUNG = "consistent", TOP_RUNG
"""Under these a contrast is predicted unless others are named. `consistent` alone has the right
limits, and no rung errs less than the top one, which a few contrasts can afford."""


def predicted_contrast(
    change: Change, law: str = LAW, rung: str = RUNG, rig: Calibration = NOMINAL
) -> float:
    """Return the contrast of `change`, positive when the change is the expected one.

    `Change` gives the formula of each effect. Drives are relative to the resonance of the rung.
    The contrast is NaN where the law gives no friction above 0, as the printed one may.

    >>> from device.friction.changes import CONDITIONS
    >>> round(predicted_contrast(CONDITIONS["pressure"]), 3)
    0.065
    """
    before, after = (
        friction_at(moment, change.places_m, law, rung, rig)
        for moment in (change.before, change.after)
    )
    if min(before.min(), after.min()) <= 0:
        return np.nan
    # (10) and (11), mathematics/friction
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
def friction_at(
    moment: Moment,
    places_m: tuple[float, ...],
    law: str = LAW,
    rung: str = RUNG,
    rig: Calibration = NOMINAL,
) -> FloatArray:
    """Return the friction coefficient of `moment` at each place (right edge, m), shape (n,)."""
    beam = Beam(damping_ratio=rig.damping_ratio)
    drive = Drive(voltage_v=rig.gain * moment.voltage_v)
    if moment.frequency != 1:
        resonance_hz = rung_resonance_hz(rung, beam, drive.mode)
        drive = replace(drive, frequency_hz=moment.frequency * resonance_hz)
    scene = Scene(
        structure=Structure(
            beam=beam, body_height_m=rig.body_height_m if moment.has_bodies else 0.0
        ),
        drive=drive,
        touch=FingerContact(
            contact_m=moment.contact_m,
            finger_load_n=moment.force_n,
            sliding_speed_m_s=moment.sliding_speed_m_s,
        ),
        coverage=moment.coverage,
        direction=moment.direction,
    )
    return friction_coefficient(scene, law=law, rung=rung, x_m=places_m)
