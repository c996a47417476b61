"""The predicted contrast of a change: how much friction changes, as one number."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from device.beam.beam import Beam
from device.beam.modes import FloatArray, natural_frequency_hz
from device.errors import one_of
from device.friction.changes import Change, Moment
from device.friction.coefficient import friction_coefficient
from device.friction.rungs import rung_resonance_hz
from device.friction.scenes import Drive, FingerContact, Scene, Structure


def predicted_contrast(change: Change, law: str = "consistent") -> float:
    """Return the contrast of `change`, positive when the change is the expected one.

    Args:
        change: see there for the formula of each effect.
        law: of friction, see `device.friction.laws`.
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
        touch=FingerContact(
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


SMOOTH_PLACE_M = 0.0414  # the second trough left of the patches
PATH_M = (0.010, 0.081)
_PATH_PLACES = 143


@dataclass(frozen=True, kw_only=True)
class Condition:
    """One condition: the scenes before and after, and how their difference is felt.

    Attributes:
        before: the scene that is touched first.
        after: the scene after the change.
        along_path: whether the finger travels (True) or stays at the smooth place.
        contrast: how the friction coefficients before and after make the contrast.
    """

    before: Scene
    after: Scene
    along_path: bool
    contrast: Callable[[FloatArray, FloatArray], float]


def _log_fall(before: FloatArray, after: FloatArray) -> float:
    """Ln(μ'_before / μ'_after) at one place: positive when it gets smoother."""
    return float(np.log(before[0] / after[0]))


def _log_difference(before: FloatArray, after: FloatArray) -> float:
    """Rms over the path of ln(μ'_after / μ'_before)."""
    return float(np.sqrt(np.mean(np.log(after / before) ** 2)))


def _depth_growth(friction_coefficient_off: float) -> Callable[[FloatArray, FloatArray], float]:
    """Growth of the modulation depth, the rms over the path of ln(μ'/μ)."""

    def growth(before: FloatArray, after: FloatArray) -> float:
        depth = [
            np.sqrt(np.mean(np.log(m / friction_coefficient_off) ** 2)) for m in (before, after)
        ]
        return float(depth[1] - depth[0])

    return growth


def reference_scene() -> Scene:
    """100 V at resonance, a finger of 10 mm pressing with 0.5 N at the smooth place, rightward."""
    return Scene(touch=FingerContact(x_m=SMOOTH_PLACE_M, contact_m=0.010, finger_load_n=0.5))


def _at_voltage(scene: Scene, voltage_v: float) -> Scene:
    return replace(scene, drive=replace(scene.drive, voltage_v=voltage_v))


def _signal(scene: Scene, _rung: str) -> Condition:
    """Signal off → on."""
    off = _at_voltage(scene, 0.0)
    return Condition(before=off, after=scene, along_path=False, contrast=_log_fall)


def _frequency(scene: Scene, rung: str) -> Condition:
    """2 % below resonance → resonance."""
    drive: Drive = scene.drive
    resonance_hz = drive.frequency_hz
    if isinstance(resonance_hz, str):
        resonance_hz = rung_resonance_hz(rung, scene.structure.beam, drive.mode)
    below = replace(scene, drive=replace(drive, frequency_hz=0.98 * resonance_hz))
    growth = _depth_growth(scene.structure.friction_coefficient)
    return Condition(before=below, after=scene, along_path=True, contrast=growth)


def _structure(scene: Scene, _rung: str) -> Condition:
    """No ciliary bodies → bodies as in the scene; no law here has a density term."""
    bare: Structure = replace(scene.structure, body_height_m=0.0)
    before = replace(scene, structure=bare)
    return Condition(before=before, after=scene, along_path=False, contrast=_log_fall)


def _voltage(scene: Scene, _rung: str) -> Condition:
    """0 → 200 V."""
    return Condition(
        before=_at_voltage(scene, 0.0),
        after=_at_voltage(scene, 200.0),
        along_path=False,
        contrast=_log_fall,
    )


def _direction(scene: Scene, _rung: str) -> Condition:
    """Rightward → leftward."""
    left = replace(scene, direction="left")
    right = replace(scene, direction="right")
    return Condition(before=right, after=left, along_path=True, contrast=_log_difference)


def _pressure(scene: Scene, _rung: str) -> Condition:
    """Load → 1.5 load."""
    touch: FingerContact = scene.touch
    if touch.finger_load_n is None:
        pressed = replace(touch, body_load_n=1.5 * touch.body_load_n)
    else:
        pressed = replace(touch, finger_load_n=1.5 * touch.finger_load_n)
    after = replace(scene, touch=pressed)
    return Condition(before=scene, after=after, along_path=False, contrast=_log_fall)


CONDITIONS: Mapping[str, Callable[[Scene, str], Condition]] = MappingProxyType(
    {
        "signal": _signal,
        "frequency": _frequency,
        "structure": _structure,
        "voltage": _voltage,
        "direction": _direction,
        "pressure": _pressure,
    }
)


def condition_by_name(name: str, scene: Scene, rung: str = "mode") -> Condition:
    """The named condition about a scene (the study's or rig's; `reference_scene()` else).

    Raises:
        OutOfRangeError: there is no such condition.
    """
    one_of("condition", name, CONDITIONS)
    return CONDITIONS[name](scene, rung)


def condition_friction(
    condition: Condition, *, law: str = "consistent", rung: str = "mode"
) -> tuple[FloatArray, FloatArray]:
    """Μ' before and after: at the scene's place, shape (1,), or along the path, shape (143,)."""
    path = np.linspace(*PATH_M, _PATH_PLACES) if condition.along_path else None
    before = friction_coefficient(condition.before, law=law, rung=rung, x_m=path)
    return before, friction_coefficient(condition.after, law=law, rung=rung, x_m=path)


def condition_contrast(
    name: str, scene: Scene | None = None, *, law: str = "consistent", rung: str = "mode"
) -> float:
    """The contrast that a law predicts for a condition, dimensionless (a logarithm of ratios).

    Args:
        name: `signal`, `frequency`, `structure`, `voltage`, `direction` or `pressure`.
        scene: the scene about which the condition changes; without it the reference scene.
        law: the friction law.
        rung: the rung of the ladder, whose own resonance is meant by `resonance`.

    >>> round(predicted_contrast("voltage"), 2) > round(predicted_contrast("pressure"), 2)
    True
    """
    condition = condition_by_name(name, reference_scene() if scene is None else scene, rung)
    return condition.contrast(*condition_friction(condition, law=law, rung=rung))
