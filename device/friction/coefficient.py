"""The friction coefficient of a scene, by a named rung or the cheapest that is certified."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from device.beam.modes import FloatArray, IndexArray
from device.errors import OutOfRangeError, positive
from device.friction.bounds import (
    Range,
    certified,
    reduced_certified,
    reduced_prediction,
    top_rung_range,
)
from device.friction.contact import contact_of
from device.friction.laws import Law
from device.friction.prediction import (
    Batch,
    LawChoice,
    Prediction,
    joined,
    law_terms,
    rung_prediction,
)
from device.friction.rungs import MODAL_RUNGS, REDUCED_RUNG, TOP_RUNG, rung_field
from device.friction.scenes import Scene

_AT_ONCE = 3000
"""Places computed together: arrays of more leave the processor's cache and cost more per place."""

_choice = lru_cache(maxsize=8)(LawChoice)
_lowest, _highest = np.minimum.reduce, np.maximum.reduce  # a third less than `min` and `max`


def _places(scene: Scene, x_m: ArrayLike | None) -> FloatArray:
    """Return the places `x_m`, shape (n,), or the scene's own place for None."""
    places = np.atleast_1d(np.asarray(scene.touch.x_m if x_m is None else x_m, dtype=np.float64))
    length_m = scene.structure.beam.length_m
    if places.size and not (_lowest(places) >= 0 and _highest(places) <= length_m):
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
    tolerance: float = 0.01,
) -> FloatArray:
    """Return the friction coefficient μ' of a scene, shape (n,), or (1,) for its own place.

    Args:
        scene: structure, drive and touch.
        law: `printed`, `consistent` or `coulomb`, or a `LawChoice`.
        rung: how the beam's motion is computed; see `device.friction.rungs`. `auto` uses, place by
            place, the cheapest rung that is certified to be within `tolerance` of the top rung.
        x_m: right edges of the finger, shape (n,), in [0, L]; by default the scene's own place.
        tolerance: the largest error in μ' that `auto` may make.

    Raise `OutOfRangeError` for a place off the beam, or no such law or rung.

    >>> from device.friction.scenes import Drive
    >>> friction_coefficient(Scene(drive=Drive(voltage_v=0.0)))
    array([0.4])
    """
    places = _places(scene, x_m)
    choice = _choice(name=law) if isinstance(law, str) else law
    if rung == "auto":
        chosen = auto_prediction(scene_batch(scene, places), choice, tolerance)
        return chosen.prediction.mu_effective
    field = rung_field(rung, scene.structure.beam, scene.drive, choice.overlap)
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


CANDIDATES = ("far-field", "mode")
FEWEST_DRIVES = 32
"""From so many drives on, `timoshenko-modes` with its set-up costs less than the top rung."""
FINEST_TOLERANCE = 1e-8
"""Below it `timoshenko-modes`, which is rarely certified to be that near, is not tried."""
_ROUNDING = 1e-12


@dataclass(frozen=True, kw_only=True, eq=False)
class Chosen:
    """Predictions, their rungs, and bounds of |μ' - μ'(top rung)|, nan for none; shape (n,)."""

    prediction: Prediction
    rung: NDArray[np.object_]
    error_bound: FloatArray


def _by_drive(batch: Batch, law: Law) -> list[tuple[IndexArray, bool]]:
    """Return the certified scenes, those at resonance separate from the others."""
    if not law.extremes_at_corners:
        return []
    inside, resonant = certified(batch), np.isnan(batch.frequency_hz)
    groups = [(inside & resonant, True), (inside & ~resonant, False)]
    return [(np.flatnonzero(rows), kind) for rows, kind in groups if rows.any()]


def _bound(top: Range, mu: FloatArray) -> FloatArray:
    """Return how far the top rung can be from `mu`."""
    # (2), mathematics/bounds
    rounding = _ROUNDING * np.maximum(1.0, np.abs(mu))
    return np.asarray(np.maximum(top[1] - mu, mu - top[0]) + rounding)


def error_bounds(batch: Batch, rung: str, choice: LawChoice, mu: FloatArray) -> FloatArray:
    """Return the certified error of a rung's μ' against the top rung; nan if not certified."""
    bounds = np.full(batch.size, 0.0 if rung == TOP_RUNG else np.nan)
    if rung in MODAL_RUNGS:
        for which, resonant in _by_drive(batch, choice.law):
            top = top_rung_range(batch.rows(which), choice, resonant=resonant)
            bounds[which] = _bound(top, mu[which])
    if rung == REDUCED_RUNG and choice.law.extremes_at_corners:
        which = np.flatnonzero(reduced_certified(batch))
        if which.size:
            _, top = reduced_prediction(batch.rows(which), choice)
            bounds[which] = _bound(top, mu[which])
    return bounds


Part = tuple[IndexArray, str, FloatArray, Prediction]


def _cheap_parts(
    batch: Batch, which: IndexArray, choice: LawChoice, tolerance: float, *, resonant: bool
) -> Iterator[Part]:
    """Yield the scenes that a candidate covers: rows, candidate, bounds and predictions."""
    top = top_rung_range(batch.rows(which), choice, resonant=resonant)
    # No μ' is nearer to both ends of a range than its middle.
    open_ = np.flatnonzero((top[1] - top[0]) / 2 <= tolerance)
    for name in CANDIDATES:
        if open_.size < which.size:
            which, top = which[open_], top.take(open_, axis=1)
        if which.size:
            prediction = rung_prediction(batch.rows(which), name, choice)
            bound = _bound(top, prediction.mu_effective)
            within = bound <= tolerance
            good = np.flatnonzero(within)
            yield which[good], name, bound[good], prediction.rows(good)
            open_ = np.flatnonzero(~within)


def _worthwhile(batch: Batch, which: IndexArray) -> bool:
    """Whether scenes have so many different drives that setting up the modes saves time."""
    most = max(batch.frequency_hz.size, batch.damping_ratio.size)
    if min(most, which.size) < FEWEST_DRIVES:
        return False
    return batch.rows(which).drives()[0].size >= FEWEST_DRIVES


def _reduced_part(
    batch: Batch, which: IndexArray, choice: LawChoice, tolerance: float
) -> Iterator[Part]:
    """Yield the scenes that `timoshenko-modes` covers, if their drives outnumber its set-up."""
    if not choice.law.extremes_at_corners or tolerance < FINEST_TOLERANCE:
        return
    if _worthwhile(batch, which):
        which = which[reduced_certified(batch.rows(which))]
    if _worthwhile(batch, which):
        prediction, top = reduced_prediction(batch.rows(which), choice)
        bound = _bound(top, prediction.mu_effective)
        good = np.flatnonzero(bound <= tolerance)
        yield which[good], REDUCED_RUNG, bound[good], prediction.rows(good)


def auto_prediction(batch: Batch, choice: LawChoice, tolerance: float) -> Chosen:
    """Return μ' within `tolerance` of the top rung, by the cheapest certified rungs.

    Raise `OutOfRangeError` for no tolerance above 0, or a mode beyond the top rung's cut-off.
    """
    positive("tolerance", tolerance)
    rung, bounds = np.empty(batch.size, dtype=np.object_), np.zeros(batch.size)
    rung.fill(TOP_RUNG)  # `np.full` would make a new text for each scene
    is_open = np.ones(batch.size, dtype=np.bool_)

    def certified_parts() -> Iterator[Part]:
        for which, resonant in _by_drive(batch, choice.law):
            yield from _cheap_parts(batch, which, choice, tolerance, resonant=resonant)
        yield from _reduced_part(batch, np.flatnonzero(is_open), choice, tolerance)

    parts = []
    for taken, name, bound, prediction in certified_parts():
        rung[taken], bounds[taken], is_open[taken] = name, bound, False
        parts.append((taken, prediction))
    rest = np.flatnonzero(is_open)
    if rest.size:
        parts.append((rest, rung_prediction(batch.rows(rest), TOP_RUNG, choice)))
    return Chosen(prediction=joined(parts, batch.size), rung=rung, error_bound=bounds)
