"""Friction along the passes as the rig's unknown properties determine it.

The friction law is `consistent` on the rung `timoshenko-modes`, which differs from the top rung by
less than 1e-7 in μ' and sums its modes for all drives at once. Frequencies enter relative to the
resonance, as in every prediction for a trial: what makes a real resonance differ from the model's
is not known.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from analysis.estimates import FloatArray
from analysis.sliding.passes import Setting
from device.beam.beam import Beam
from device.friction.contact import Contact, contact_state
from device.friction.contrasts import LAW
from device.friction.laws import ContactTerms, law_by_name
from device.friction.rungs import (
    REDUCED_RUNG,
    modal_sum_field,
    reference_tip_speed_m_s,
    rung_resonance_hz,
)
from device.friction.scenes import Structure

MODE = 6
_STRUCTURE = Structure()


@dataclass(frozen=True, kw_only=True)
class RigProperties:
    """What a fit determines.

    Attributes:
        friction_coefficient: μ, with the output off.
        damping_ratio: ζ.
        resonance_hz: of the mode that is driven.
        gain: volts at the beam per volt of the drive.
        body_height_m: height of the ciliary bodies.
        patch_centre_m: place of the patches' middle.
    """

    friction_coefficient: float
    resonance_hz: float
    damping_ratio: float = _STRUCTURE.beam.damping_ratio
    gain: float = 1.0
    body_height_m: float = _STRUCTURE.body_height_m
    patch_centre_m: float = _STRUCTURE.beam.patches.centre_m

    def beam(self) -> Beam:
        """Return the beam with this damping and these patches."""
        patches = replace(_STRUCTURE.beam.patches, centre_m=self.patch_centre_m)
        return replace(_STRUCTURE.beam, damping_ratio=self.damping_ratio, patches=patches)


PROPERTIES = tuple(entry.name for entry in fields(RigProperties))
HALF_THICKNESS_M = _STRUCTURE.beam.thickness_m / 2


def coordinates(rig: RigProperties) -> FloatArray:
    """Return the properties as a fit varies them: as logarithms, but the patches' place, m.

    The body height counts from the beam's middle, where the tip's lever begins.
    """
    return np.array([_coordinate(name, getattr(rig, name)) for name in PROPERTIES])


def _coordinate(name: str, value: float) -> float:
    if name == "patch_centre_m":
        return value
    return float(np.log(value + HALF_THICKNESS_M * (name == "body_height_m")))


def property_at(name: str, coordinate: float) -> float:
    """Return a property from its coordinate."""
    if name == "patch_centre_m":
        return float(coordinate)
    return float(np.exp(coordinate)) - HALF_THICKNESS_M * (name == "body_height_m")


def rig_at(found: FloatArray) -> RigProperties:
    """Return the rig at some coordinates."""
    values = zip(PROPERTIES, found.tolist(), strict=True)
    return RigProperties(**{name: property_at(name, value) for name, value in values})


@lru_cache(maxsize=64)
def _resonance_hz(patch_centre_m: float) -> float:
    patches = replace(_STRUCTURE.beam.patches, centre_m=patch_centre_m)
    return rung_resonance_hz(REDUCED_RUNG, replace(_STRUCTURE.beam, patches=patches), MODE)


NODES = np.sqrt(3.0) * np.array([-1.0, 0.0, 1.0])
_WEIGHTS = np.array([1.0, 4.0, 1.0]) / 6
"""Gauss and Hermite's rule of three points for a mean over a normal spread."""
_LEAST_M = 1e-5


@dataclass(frozen=True, kw_only=True, eq=False)
class Places:
    """Places under given settings, one after the other; `of` is the setting of each place.

    Friction at a place is its mean over places about it that have the standard deviation
    `spread_m`: a bin's mean rounds the corners of the curve.
    """

    settings: tuple[Setting, ...]
    of: NDArray[np.intp]
    x_m: FloatArray
    spread_m: FloatArray

    @classmethod
    def along(
        cls, settings: Sequence[Setting], x_m: Sequence[FloatArray], spread_m: Sequence[float] = ()
    ) -> "Places":
        """Return places of each setting, with the spread of each setting if there is any."""
        of = np.repeat(np.arange(len(settings)), [each.size for each in x_m])
        spread = np.array(spread_m)[of] if spread_m else np.zeros(of.size)
        return cls(settings=tuple(settings), of=of, x_m=np.concatenate(list(x_m)), spread_m=spread)

    def about(self) -> "Places":
        """Return the places over which means are taken, `NODES` to each, as plain places."""
        x_m = (self.x_m[:, None] + self.spread_m[:, None] * NODES).ravel()
        return Places(
            settings=self.settings,
            of=np.repeat(self.of, NODES.size),
            x_m=np.clip(x_m, _LEAST_M, _STRUCTURE.beam.length_m),
            spread_m=np.zeros(x_m.size),
        )

    def each(self, name: str) -> FloatArray:
        """Return a number of the setting of each place."""
        return np.array([getattr(one, name) for one in self.settings], dtype=np.float64)[self.of]


def friction_along(places: Places, rigs: Sequence[RigProperties]) -> FloatArray:
    """Return μ' at the places for rigs that share patches, shape (rigs, places).

    The motion is summed once for all rigs that differ in resonance or damping.
    """
    if places.spread_m.any():
        return friction_along(places.about(), rigs).reshape(len(rigs), -1, NODES.size) @ _WEIGHTS
    count = len(rigs)
    terms = _terms(places, tuple(rigs))
    lever = [HALF_THICKNESS_M + rig.body_height_m for rig in rigs]
    gain = np.array([rig.gain for rig in rigs])[:, None]
    # (2), mathematics/sliding
    tip = gain * (np.array(lever)[:, None] / (HALF_THICKNESS_M + _STRUCTURE.body_height_m))
    scaled = replace(
        terms,
        friction_coefficient=np.array([rig.friction_coefficient for rig in rigs])[:, None],
        relative_tip_speed=terms.relative_tip_speed * tip,
        inertial_ratio=terms.inertial_ratio * gain,
        printed_inertial_ratio=terms.printed_inertial_ratio * gain,
    )
    return np.broadcast_to(law_by_name(LAW)(scaled), (count, places.x_m.size))


def _terms(places: Places, rigs: tuple[RigProperties, ...]) -> ContactTerms:
    """Return the terms for a gain of 1 and the nominal body height, shape (rigs, places) each."""
    first = rigs[0]
    tuned = [(rig.resonance_hz, rig.damping_ratio) for rig in rigs]
    known = sorted(set(tuned))
    row = np.array([known.index(each) for each in tuned])
    scale = _resonance_hz(first.patch_centre_m)
    frequency_hz = np.array(
        [one.frequency_hz * scale / own_hz for own_hz, _ in known for one in places.settings]
    )
    damping = np.repeat([ratio for _, ratio in known], len(places.settings))
    offsets = len(places.settings) * np.arange(len(known))[:, None]
    drive = (offsets + places.of).ravel()
    beam = replace(first.beam(), damping_ratio=_STRUCTURE.beam.damping_ratio)
    size = len(known)
    field = modal_sum_field(beam, drive, frequency_hz, damping)
    contact = Contact(
        beam=beam,
        coverage="local",
        direction="right",
        x_m=np.tile(places.x_m, size),
        contact_m=np.tile(places.each("contact_m"), size),
        body_count=_STRUCTURE.body_count,
        body_mass_kg=_STRUCTURE.body_mass_kg,
        body_height_m=_STRUCTURE.body_height_m,
        body_load_n=1.0,
        finger_load_n=np.tile(places.each("load_n"), size),
        sliding_speed_m_s=np.tile(places.each("speed_m_s"), size),
        friction_coefficient=1.0,
        same_direction_fraction=None,
    )
    driven = field.scaled(np.tile(places.each("voltage_v"), size))
    found = contact_state(contact, driven, reference_tip_speed_m_s(REDUCED_RUNG)).terms
    leftward = np.array([one.direction == "left" for one in places.settings])[places.of]
    shape = (size, places.x_m.size)
    shaped = {
        name: np.broadcast_to(value, (size * places.x_m.size,)).reshape(shape)[row]
        for name, value in vars(found).items()
    }
    right, left = shaped["same_direction"], shaped["opposing"]
    shaped["same_direction"] = np.where(leftward, left, right)
    shaped["opposing"] = np.where(leftward, right, left)
    return ContactTerms(**shaped)


PATCH_STEP_M = 0.25e-3
_STEPS = {"damping_ratio": 0.01, "resonance_hz": 1e-5}
_PLAIN_STEP = 1e-4


def slopes(places: Places, found: FloatArray, names: Sequence[str]) -> FloatArray:
    """Return the derivatives of μ' by some coordinates, shape (places, names)."""
    columns = {}
    stepped = [name for name in names if name != "patch_centre_m"]
    rigs, widths = [], []
    for name in stepped:
        width = _STEPS.get(name, _PLAIN_STEP)
        rigs += [rig_at(found + sign * width * _unit(name)) for sign in (1, -1)]
        widths.append(2 * width)
    if rigs:
        values = friction_along(places, rigs).reshape(len(stepped), 2, -1)
        for name, (above, below), width in zip(stepped, values, widths, strict=True):
            columns[name] = (above - below) / width
    if "patch_centre_m" in names:
        step = PATCH_STEP_M * _unit("patch_centre_m")
        above, below = (friction_along(places, [rig_at(found + s * step)])[0] for s in (1, -1))
        columns["patch_centre_m"] = (above - below) / (2 * PATCH_STEP_M)
    return np.stack([columns[name] for name in names], axis=-1)


def _unit(name: str) -> FloatArray:
    return np.array([float(other == name) for other in PROPERTIES])
