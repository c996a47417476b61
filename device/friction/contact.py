"""The contact's terms, which a friction law needs, from a field and a touch (Eqs 9, 11, 12)."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from device.arrays import FloatArray, IndexArray
from device.beam.beam import Beam
from device.beam.eq15 import Overlap, same_direction_ratio
from device.beam.fields import Field
from device.beam.pattern import Window
from device.friction.laws import ContactTerms
from device.friction.scenes import REFERENCE_SPEED_M_S, Coverage, Direction, Scene

Number = FloatArray | float


@dataclass(frozen=True, kw_only=True, eq=False)
class Contact:
    """A scene's touch and bodies as arrays of shape (n,) or numbers; one coverage, one direction.

    An array of shape (1,) counts as a number, except for `x_m`, which has the shape of the scenes.
    A `finger_load_n` or `same_direction_fraction` of None means that it is not given.
    """

    beam: Beam
    coverage: Coverage
    direction: Direction
    x_m: FloatArray
    contact_m: Number
    body_count: Number
    body_mass_kg: Number
    body_height_m: Number
    body_load_n: Number
    finger_load_n: Number | None
    sliding_speed_m_s: Number
    friction_coefficient: Number
    same_direction_fraction: Number | None

    @property
    def covered_m(self) -> Number:
        """The length of beam under the finger, or under the hand that covers all of it."""
        full = self.coverage == "full"
        return self.beam.length_m if full else np.minimum(self.x_m, self.contact_m)

    @property
    def lever_m(self) -> Number:
        """The bodies' tips' distance from the neutral axis."""
        return self.beam.thickness_m / 2 + self.body_height_m

    @property
    def load_n_per_m(self) -> Number:
        """σ, the static load per metre: the finger's over its contact, else the paper's uf/L."""
        if self.finger_load_n is None:
            return self.body_count * self.body_load_n / self.beam.length_m
        return self.finger_load_n / self.contact_m

    def rows(self, which: IndexArray) -> "Contact":
        """Return the contact at some of the places; numbers apply to all of them."""
        chosen: dict[str, Any] = {
            name: value[which]
            for name, value in vars(self).items()
            if isinstance(value, np.ndarray) and value.shape == self.x_m.shape
        }
        return replace(self, **chosen)


def contact_of(scene: Scene, x_m: FloatArray) -> Contact:
    """Return the contact of one scene, moved to the places `x_m`, shape (n,)."""
    structure, touch = scene.structure, scene.touch
    return Contact(
        beam=structure.beam,
        coverage=scene.coverage,
        direction=scene.direction,
        x_m=x_m,
        contact_m=touch.contact_m,
        body_count=structure.body_count,
        body_mass_kg=structure.body_mass_kg,
        body_height_m=structure.body_height_m,
        body_load_n=touch.body_load_n,
        finger_load_n=touch.finger_load_n,
        sliding_speed_m_s=touch.sliding_speed_m_s,
        friction_coefficient=structure.friction_coefficient,
        same_direction_fraction=scene.same_direction_fraction,
    )


def same_direction_given(contact: Contact) -> Number | None:
    """Return the a/u given for full coverage, which applies in any field, or None."""
    return contact.same_direction_fraction if contact.coverage == "full" else None


def _directions(contact: Contact, right: FloatArray, left: FloatArray) -> tuple[Number, Number]:
    """Return the part of the contact that moves with the finger, and the part against it."""
    given = same_direction_given(contact)
    if given is not None:
        return given, 1.0 - given
    return (right, left) if contact.direction == "right" else (left, right)


def with_eq15_ratio(terms: ContactTerms, contact: Contact, overlap: Overlap) -> ContactTerms:
    """Return the terms with Eq 15's a/u instead of the field's own, as in the printed local law."""
    if contact.coverage == "full":
        return terms
    ratio = same_direction_ratio(contact.x_m, contact.contact_m, overlap)
    same_direction, opposing = _directions(contact, ratio, 1.0 - ratio)
    return replace(terms, same_direction=np.asarray(same_direction), opposing=np.asarray(opposing))


def _window(contact: Contact, field: Field) -> Window:
    """Return the motion under the finger, or under the hand that covers the whole beam."""
    if contact.coverage == "full":
        return field.pattern.whole()
    return field.pattern.window(contact.x_m, contact.contact_m)


def contact_terms(
    contact: Contact,
    field: Field,
    reference_tip_speed_m_s: float,
    *,
    whole: bool = True,
) -> ContactTerms:
    """Return the terms of a contact in a field.

    Unless they are to be `whole`, f_p and its ratio are nan: no repaired law needs them.

    Inertia per metre is mω²|q|·mean|φ|/π: over the window it is Eq 11's f_p (inner limit T/2; Eq
    9's over the whole beam) with the body mass m read as kg per metre. The reference tip speed is
    the rung's in the paper's scene.
    """
    window = _window(contact, field)
    # (1) to (5), mathematics/friction
    omega = field.angular_frequency_rad_s
    acceleration = omega * omega * field.displacement_m * contact.body_mass_kg / math.pi
    load_n = np.asarray(acceleration * window.mean * contact.covered_m if whole else np.nan)
    tip_speed = field.tip_speed_m_s(contact.lever_m) / contact.sliding_speed_m_s
    same_direction, opposing = _directions(contact, window.right, window.left)
    return ContactTerms(
        friction_coefficient=np.asarray(contact.friction_coefficient),
        same_direction=np.asarray(same_direction),
        opposing=np.asarray(opposing),
        relative_tip_speed=tip_speed * (REFERENCE_SPEED_M_S / reference_tip_speed_m_s),
        inertial_ratio=acceleration / contact.load_n_per_m * window.mean,
        printed_inertial_ratio=load_n / (contact.body_count * contact.body_load_n),
        inertial_load_n=load_n,
    )
