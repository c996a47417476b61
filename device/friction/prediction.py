"""Predictions for many scenes at once, with all the numbers of each."""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from device.arrays import FloatArray, IndexArray
from device.beam.beam import Beam
from device.beam.driven import Fineness
from device.beam.eq15 import Overlap, describes
from device.beam.fields import Field
from device.errors import OutOfRangeError, one_of
from device.friction import rungs
from device.friction.contact import Contact, contact_terms, with_eq15_ratio
from device.friction.fineness import DEFAULT
from device.friction.laws import ContactTerms, Law, anisotropy, law_by_name

Ratio = Literal["eq15", "mode"]


@dataclass(frozen=True, kw_only=True)
class LawChoice:
    """A friction law, with the choices that the printed one leaves open: a/u and its overlaps.

    `ratio` and `overlap` do not affect the repaired laws, which use the rung's own r.
    """

    name: str = "consistent"
    ratio: Ratio = "eq15"
    overlap: Overlap = "first"

    def __post_init__(self) -> None:
        law_by_name(self.name)
        one_of("ratio", self.ratio, get_args(Ratio))
        one_of("eq15_overlap", self.overlap, get_args(Overlap))

    @cached_property
    def law(self) -> Law:
        return law_by_name(self.name)

    def on(self, beam: Beam) -> "LawChoice":
        """Return the choice for a beam: Eq 15 is about the paper's, others have their own a/u."""
        return self if describes(beam) else replace(self, ratio="mode")

    @property
    def takes_eq15(self) -> bool:
        """Whether a/u is that of Eq 15 where the finger does not cover the beam."""
        return self.law.as_printed and self.ratio == "eq15"


@dataclass(frozen=True, kw_only=True, eq=False)
class Batch:
    """Scenes that share beam, mode, coverage and direction; arrays of shape (n,).

    Arrays other than places may have shape (1,), for a value that all scenes share, so that one
    scene at many places costs what depends on the place alone. A frequency of nan is the rung's
    resonance.
    """

    contact: Contact
    mode: int
    voltage_v: FloatArray
    frequency_hz: FloatArray
    damping_ratio: FloatArray

    @property
    def beam(self) -> Beam:
        """The beam that all scenes share, except for its damping ratio."""
        return self.contact.beam

    @property
    def size(self) -> int:
        return int(self.contact.x_m.size)

    def rows(self, which: IndexArray) -> "Batch":
        """Return some of the scenes, in their order."""
        if which.size == self.size:
            return self
        drives = ("voltage_v", "frequency_hz", "damping_ratio")
        # A value that all scenes share stays one.
        own = {name: getattr(self, name) for name in drives}
        own = {name: all_[which] for name, all_ in own.items() if all_.size == self.size}
        return replace(self, contact=self.contact.rows(which), **own)

    def drives(self) -> tuple[FloatArray, FloatArray, IndexArray]:
        """Return frequencies and damping ratios that differ, and which of them each scene has.

        A resonance is -1 here: one NaN would be unlike another. The last is of shape (1,) if all
        scenes share their drive.
        """
        frequency_hz = np.where(np.isnan(self.frequency_hz), -1.0, self.frequency_hz)
        if frequency_hz.size == self.damping_ratio.size == 1:
            return frequency_hz, self.damping_ratio, np.zeros(1, dtype=np.intp)
        # As complex numbers, because those sort 20 times faster than pairs.
        pairs, drive = np.unique(frequency_hz + 1j * self.damping_ratio, return_inverse=True)
        return pairs.real, pairs.imag, drive


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """What a rung and a law say of n scenes: μ', r, η, p, f_p (N) and |q| (m).

    μ' is of shape (n,), and so is what differs between the scenes; other shapes broadcast to it.
    For the printed law the ratio is a/u, the anisotropy ½, and the inertial ratio f_p/(uf).
    """

    mu_effective: FloatArray
    same_direction_ratio: FloatArray
    anisotropy: FloatArray
    inertial_ratio: FloatArray
    inertial_load_n: FloatArray
    displacement_m: FloatArray

    def rows(self, which: IndexArray) -> "Prediction":
        """Return some of the scenes, in their order."""
        shape = self.mu_effective.shape
        if which.shape == shape:
            return self
        columns = vars(self).items()
        return Prediction(
            **{name: column[which] if column.shape == shape else column for name, column in columns}
        )


def law_terms(
    contact: Contact,
    field: Field,
    rung: str,
    choice: LawChoice,
    *,
    whole: bool = True,
) -> ContactTerms:
    """Return the contact's terms as a law sees them; see `contact_terms` for the rest.

    Raise `OutOfRangeError` if a repaired law would take an a/u of Eq 15 outside [0, 1].
    """
    reference = rungs.reference_tip_speed_m_s(rung)
    terms = contact_terms(contact, field, reference, whole=whole or choice.law.as_printed)
    if choice.takes_eq15:
        return with_eq15_ratio(terms, contact, choice.overlap)
    if rung == "eq15" and not choice.law.as_printed:
        # The other rungs measure their ratio along the beam and keep it in [0, 1].
        _refuse_impossible_ratio(contact, terms.same_direction, rung)
    return terms


def _refuse_impossible_ratio(contact: Contact, ratio: FloatArray, rung: str) -> None:
    outside = np.flatnonzero((ratio < 0) | (ratio > 1))
    if not outside.size:
        return
    row = int(outside[0])
    contact_m, x_m = (
        float(np.broadcast_to(values, ratio.shape)[row])
        for values in (contact.contact_m, contact.x_m)
    )
    rule = (
        f"must be longer at x_m = {x_m:g} on the rung {rung}, where it makes a/u "
        f"{float(ratio[row]):.3g}, outside [0, 1]; take a longer contact or another rung"
    )
    raise OutOfRangeError("contact_m", rule, contact_m, row)


def field_prediction(contact: Contact, field: Field, rung: str, choice: LawChoice) -> Prediction:
    """Return the prediction of a law in a field of the named rung."""
    return terms_prediction(contact, field, law_terms(contact, field, rung, choice), choice)


def terms_prediction(
    contact: Contact, field: Field, terms: ContactTerms, choice: LawChoice
) -> Prediction:
    """Return the prediction of a law from the terms that `law_terms` gives in a field."""
    law, shape = choice.law, contact.x_m.shape
    mu, printed = law(terms), law.as_printed
    return Prediction(
        mu_effective=mu if mu.shape == shape else np.full(shape, mu),
        same_direction_ratio=terms.same_direction,
        anisotropy=np.asarray(0.5) if printed else anisotropy(terms.relative_tip_speed),
        inertial_ratio=terms.printed_inertial_ratio if printed else terms.inertial_ratio,
        inertial_load_n=np.asarray(terms.inertial_load_n),
        displacement_m=field.displacement_m,
    )


def joined(parts: list[tuple[IndexArray, Prediction]], size: int) -> Prediction:
    """Return the predictions for parts of a batch, joined in the order of the batch."""
    if len(parts) == 1 and parts[0][0].size == size:
        return parts[0][1]
    columns = {entry.name: np.empty(size) for entry in fields(Prediction)}
    for which, part in parts:
        for name, column in columns.items():
            column[which] = getattr(part, name)
    return Prediction(**columns)


def rung_prediction(
    batch: Batch, rung: str, choice: LawChoice, fineness: Fineness = DEFAULT
) -> Prediction:
    """Return a rung's prediction; raise `OutOfRangeError` as `rungs.rung_fields`.

    Drives that several scenes share are solved once.
    """
    frequency_hz, damping_ratio, drive = batch.drives()
    frequency_hz = np.where(frequency_hz < 0, np.nan, frequency_hz)
    parts = [
        (scenes, field_prediction(batch.rows(scenes).contact, field, rung, choice))
        for scenes, field in _fields_of_scenes(
            batch, rung, (frequency_hz, damping_ratio), drive, choice.overlap, fineness
        )
    ]
    return joined(parts, batch.size)


def _fields_of_scenes(
    batch: Batch,
    rung: str,
    drives: tuple[FloatArray, FloatArray],
    drive: IndexArray,
    overlap: Overlap,
    fineness: Fineness,
) -> Iterator[tuple[IndexArray, Field]]:
    """Yield scenes, which have the drives of that number, with the field of each."""
    for which, field in rungs.rung_fields(
        rung, batch.beam, batch.mode, *drives, overlap=overlap, fineness=fineness
    ):
        number = np.full(drives[0].size, -1)
        number[which] = np.arange(which.size)
        own = np.broadcast_to(number[drive], batch.size)
        scenes = np.flatnonzero(own >= 0)
        voltage_v = batch.rows(scenes).voltage_v
        if drives[0].size > 1:
            field = field.chosen(own[scenes])  # noqa: PLW2901 - the same, of each scene
        yield scenes, field.scaled(voltage_v)


def drive_terms(
    batch: Batch, drives: tuple[FloatArray, FloatArray], drive: IndexArray, fineness: Fineness
) -> ContactTerms:
    """Return the terms on the top rung of scenes whose drives are numbered; shape (n,) each.

    `drives` are frequencies, Hz, and damping ratios, which may repeat.
    """
    rung = rungs.TOP_RUNG
    reference = rungs.reference_tip_speed_m_s(rung)
    terms = {entry.name: np.empty(batch.size) for entry in fields(ContactTerms)}
    for scenes, field in _fields_of_scenes(batch, rung, drives, drive, "first", fineness):
        part = contact_terms(batch.rows(scenes).contact, field, reference)
        for name, values in terms.items():
            values[scenes] = getattr(part, name)
    return ContactTerms(**terms)
