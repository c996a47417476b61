"""Certified ranges of the top rung's terms for a scene, from a precomputed table.

The table (`certified_bounds.json`, made by `handbook/certify.py`) covers the paper's beam: at
resonance, the ranges of the top rung's zone edges, areas, tip speed and inertia over the domain;
off resonance, upper bounds on its motion, and the errors of `timoshenko-modes`, at each frequency.
Numbers of equations are those of docs/mathematics/bounds.md.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from importlib.resources import files
from typing import Any

import numpy as np

from device.beam import modes
from device.beam.beam import Beam
from device.beam.windows import window_width
from device.friction import prediction as model
from device.friction import rungs
from device.friction.contact import contact_window, same_direction_given, with_eq15_ratio
from device.friction.laws import ContactTerms
from device.friction.scenes import REFERENCE_SPEED_M_S, Drive

Range = modes.FloatArray
"""The lowest and the highest values, shape (2, n)."""


@lru_cache(maxsize=1)
def _table() -> Mapping[str, Any]:
    text = files("device.friction").joinpath("certified_bounds.json").read_text(encoding="utf-8")
    table: Mapping[str, Any] = json.loads(text)
    return table


@lru_cache(maxsize=32)
def _resonance(mode: int) -> Mapping[str, modes.FloatArray]:
    """Return the top rung at one mode's resonance: the mode's row, with its running sums."""
    row = {name: np.array(values) for name, values in _table()["modes"][str(mode)].items()}
    steps = {
        "right_before_m": np.diff(row["edges_m"]) * row["moves_right"],
        "slack_before_m": row["slack_m"][1:-1],
    }
    return row | {name: np.concatenate([[0.0], np.cumsum(each)]) for name, each in steps.items()}


def certified(batch: model.Batch) -> modes.BoolArray:
    """Return for which scenes the table has the top rung's range, shape (n,)."""
    resonant = np.isnan(batch.frequency_hz)
    inside = _in_domain(batch) & (str(batch.mode) in _table()["modes"])
    if not resonant.all():
        inside = np.where(resonant, inside, _in_domain(batch, batch.frequency_hz))
    return np.broadcast_to(inside, batch.size)


def reduced_certified(batch: model.Batch) -> modes.BoolArray:
    """Return for which scenes the table has the errors of `timoshenko-modes`, shape (n,)."""
    plain = _in_domain(batch)
    if plain.any():
        plain = plain & _in_domain(batch, model.reduced_frequency_hz(batch))
    return np.broadcast_to(plain, batch.size)


@lru_cache(maxsize=32)
def _is_of_table(beam: Beam) -> bool:
    """Return whether it is the table's beam but for damping and frequency scale."""
    return replace(beam, damping_ratio=Beam().damping_ratio, frequency_scale=1.0) == Beam()


def _in_domain(batch: model.Batch, frequency_hz: modes.FloatArray | None = None) -> modes.BoolArray:
    """Return which scenes have the table's beam and damping, and drives within its bins."""
    table = _table()
    if not _is_of_table(batch.beam):
        return np.zeros(batch.size, dtype=np.bool_)
    low, high = table["damping_ratio"]
    inside = (batch.damping_ratio >= low) & (batch.damping_ratio <= high)
    if frequency_hz is not None:
        bins = _bins(batch.beam, frequency_hz)
        inside = inside & (bins >= 0) & (bins < len(table["envelope"]["speed_per_v_m"]))
    return np.asarray(inside)


def _bins(beam: Beam, frequency_hz: modes.FloatArray) -> modes.IndexArray:
    """Return the table's bin of each drive frequency; 0, which is unused, at resonance."""
    envelope = _table()["envelope"]
    scaled = frequency_hz / (beam.frequency_scale * envelope["low_hz"])
    steps = np.log(np.where(np.isnan(scaled), 1.0, scaled)) / math.log(envelope["growth"])
    return np.asarray(np.floor(steps), dtype=np.intp)


def _terms(
    batch: model.Batch,
    choice: model.LawChoice,
    same_direction: Range,
    tip_speed: Range,
    inertia_n_per_m: Range,
) -> ContactTerms:
    """Return the ranges as a law's terms, by (2) to (5) of mathematics/friction.

    `tip_speed` is per metre of lever, and `inertia_n_per_m` the load per metre of (1) there. What
    no corner needs has no range: the opposing part, and f_p/(uf) or p, whichever the law leaves.
    """
    contact = batch.contact
    reference = rungs.reference_tip_speed_m_s(rungs.TOP_RUNG)
    factor = contact.lever_m / contact.sliding_speed_m_s * (REFERENCE_SPEED_M_S / reference)
    if choice.law.as_printed:
        inertia = inertia_n_per_m * (contact.covered_m / (contact.body_count * contact.body_load_n))
    else:
        inertia = inertia_n_per_m * (1.0 / contact.load_n_per_m)
    return ContactTerms(
        friction_coefficient=np.asarray(contact.friction_coefficient),
        same_direction=same_direction,
        opposing=same_direction,
        relative_tip_speed=tip_speed * factor,
        inertial_ratio=inertia,
        printed_inertial_ratio=inertia,
    )


def _window_ranges(batch: model.Batch, top: Mapping[str, modes.FloatArray]) -> tuple[Range, Range]:
    """Return the top rung's right-moving part and mean |W|/rms over each window."""
    contact, length_m = batch.contact, batch.beam.length_m
    full = contact.coverage == "full"
    end_m = np.full(batch.size, length_m) if full else contact.x_m
    width_m = end_m if full else window_width(contact.x_m, contact.contact_m)
    start_m, width = end_m - width_m, np.where(width_m > 0, width_m, 1e-12)

    def between(places_m: modes.FloatArray, before: modes.FloatArray) -> modes.FloatArray:
        return np.interp(end_m, places_m, before) - np.interp(start_m, places_m, before)

    part = between(top["edges_m"], top["right_before_m"]) / width
    # (3): each edge within reach of the window may be off by its own slack.
    inner, widest_m = top["edges_m"][1:-1], top["slack_m"].max()
    last = np.searchsorted(inner, end_m + widest_m)
    first = np.searchsorted(inner, start_m - widest_m)
    slack = (top["slack_before_m"].take(last) - top["slack_before_m"].take(first)) / width
    area_m = between(np.linspace(0.0, length_m, top["area_m"].size), top["area_m"])
    reach = 2 * top["area_slack_m"]  # (4): the area is off at both ends of the window
    mean = _between(area_m - reach, area_m + reach, math.inf)
    mean /= width
    return _between(part - slack, part + slack, 1.0), mean


def _between(low: modes.FloatArray, high: modes.FloatArray, most: float) -> Range:
    """Return the range from `low` to `high`, as far as it lies in [0, most]."""
    found = np.empty((2, low.size))
    np.maximum(low, 0.0, out=found[0])
    np.minimum(high, most, out=found[1])
    return found


def _same_direction(batch: model.Batch, right: Range) -> Range:
    """Return the range of r: the right-moving part, or the rest for a finger that moves left."""
    given = same_direction_given(batch.contact)
    if given is not None:
        return np.broadcast_to(np.asarray(given, dtype=np.float64), (2, batch.size))
    return right if batch.contact.direction == "right" else 1.0 - right[::-1]


def resonant_terms(batch: model.Batch, choice: model.LawChoice) -> ContactTerms:
    """Return the ranges for scenes driven at the resonance of a mode in the table."""
    top, beam, mode = _resonance(batch.mode), batch.beam, batch.mode
    omega = 2 * math.pi * modes.natural_frequency_hz(beam, mode)
    displacement_m = modes.modal_displacement_m(
        beam, mode, batch.voltage_v, omega / (2 * math.pi), batch.damping_ratio
    )
    # (5)
    speed = (
        math.sqrt(2.0) * omega * displacement_m * (modes.mode_constants(mode).root / beam.length_m)
    )
    right, mean = _window_ranges(batch, top)
    inertia = omega**2 * displacement_m * batch.contact.body_mass_kg / math.pi
    return _terms(
        batch,
        choice,
        _same_direction(batch, right),
        np.multiply.outer(top["speed_ratio"], speed),
        np.multiply.outer(top["inertia_ratio"], inertia) * mean,
    )


def driven_terms(batch: model.Batch, choice: model.LawChoice) -> ContactTerms:
    """Return the ranges for scenes driven at a given frequency: any direction, bounded motion."""
    envelope, scale = _table()["envelope"], batch.beam.frequency_scale
    bins = _bins(batch.beam, batch.frequency_hz)
    # (6): the scale leaves ω²|W| as it is and divides ω|ψ|
    speed = np.array(envelope["speed_per_v_m"])[bins] * batch.voltage_v / scale
    acceleration = np.array(envelope["acceleration_per_v"])[bins] * batch.voltage_v
    inertia = acceleration * batch.contact.body_mass_kg / math.pi

    def up_to(most: modes.FloatArray | float) -> Range:
        return np.stack([np.zeros(batch.size), np.broadcast_to(most, batch.size)])

    return _terms(batch, choice, _same_direction(batch, up_to(1.0)), up_to(speed), up_to(inertia))


def _corner(terms: ContactTerms, end: int) -> ContactTerms:
    """Return the corner of the ranges at which a law is lowest (0) or highest (1) at any speed."""
    ratio = terms.same_direction[1 - end]  # the law falls with it
    return replace(
        terms,
        same_direction=ratio,
        opposing=1.0 - ratio,
        inertial_ratio=terms.inertial_ratio[end],
        printed_inertial_ratio=terms.printed_inertial_ratio[end],
    )


def top_rung_range(batch: model.Batch, choice: model.LawChoice, *, resonant: bool) -> Range:
    """Return the range of the top rung's μ' by a law with extremes at corners, all certified."""
    terms = (resonant_terms if resonant else driven_terms)(batch, choice)
    return _law_range(terms, batch, choice)


def _law_range(terms: ContactTerms, batch: model.Batch, choice: model.LawChoice) -> Range:
    """Return the range of a law's friction coefficient over ranges of its terms."""
    if choice.takes_eq15:  # a/u is equal on every rung
        ratio = with_eq15_ratio(terms, batch.contact, choice.overlap).same_direction
        terms = replace(terms, same_direction=np.broadcast_to(ratio, (2, batch.size)))
    # (1): in s either end may be the extreme. As rows, so that the rest is computed once for both.
    lowest, highest = (np.atleast_2d(choice.law(_corner(terms, end))) for end in (0, 1))
    found = np.empty((2, batch.size))
    np.minimum(lowest[0], lowest[-1], out=found[0])
    np.maximum(highest[0], highest[-1], out=found[1])
    return found


_ROUNDING_M = (
    1e-15  # of a running length or area in (8), which a narrow window divides by its width
)


def reduced_prediction(
    batch: model.Batch, choice: model.LawChoice
) -> tuple[model.Prediction, Range]:
    """Return `timoshenko-modes` of certified scenes, and the range of the top rung's μ'."""
    table, contact = _table()["modal_sum"], batch.contact
    bins = _bins(batch.beam, model.reduced_frequency_hz(batch))
    direction, area_m, rotation = (
        np.array(table[name])[bins] for name in ("direction", "area_m", "rotation")
    )
    field = model.reduced_field(batch, direction)
    window = contact_window(contact, field)
    width = np.maximum(contact.covered_m, 1e-300)
    terms = model.law_terms(contact, field, rungs.REDUCED_RUNG, choice, window)
    # (8), and (9) for the speed
    slack = (window.doubt_m + _ROUNDING_M) / width
    # The reference's speed is that of the nominal beam, whatever the scale of this one.
    plain = Beam()
    reference = _bins(
        plain, np.array([rungs.rung_resonance_hz(rungs.REDUCED_RUNG, plain, Drive().mode)])
    )
    speed = rotation + float(np.array(table["rotation"])[reference][0])
    inertia = (area_m + _ROUNDING_M) / np.maximum(width * window.mean, 1e-300)
    ranges = replace(
        terms,
        same_direction=_same_direction(
            batch, _between(window.right - slack, window.right + slack, 1.0)
        ),
        relative_tip_speed=_around(terms.relative_tip_speed, speed),
        inertial_ratio=_around(terms.inertial_ratio, inertia),
        printed_inertial_ratio=_around(terms.printed_inertial_ratio, inertia),
    )
    prediction = model.terms_prediction(contact, field, terms, choice)
    return prediction, _law_range(ranges, batch, choice)


def _around(values: modes.FloatArray, relative: modes.FloatArray) -> Range:
    """Return the range about values of at least 0 that have a relative error."""
    return np.stack([np.maximum(values * (1 - relative), 0.0), values * (1 + relative)])
