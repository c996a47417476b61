"""`auto`: the cheapest rung whose error against the top rung is certified to be small enough.

A table made once (`certify`) tells, for the paper's beam, what the top rung says of a scene to
within bounds: at resonance from its zone edges and areas, off resonance from the most it can reach.
A cheap rung is taken where its friction coefficient lies within the tolerance of everything the
top rung may say. The domain: the paper's beam with any stiffness scale, damping ratios of 0.002 to
0.02, modes whose row the table has, local coverage or full; outside it the top rung is taken.

Only `far-field` and `mode` are candidates: `eq15` costs more than `far-field`, and rungs that
solve the segmented beam cost what the top rung costs.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from device.bounds import Range, certified, top_rung_range
from device.mode_shapes import FloatArray
from device.prediction import Batch, LawChoice, Prediction, joined, rung_prediction
from device.ranges import positive
from device.rungs import MODAL_RUNGS, TOP_RUNG

CANDIDATES = ("far-field", "mode")
_ROUNDING = 1e-12


@dataclass(frozen=True, kw_only=True, eq=False)
class Chosen:
    """Predictions with the rung that each comes from and its certified error; shape (n,).

    `error_bound` bounds |μ' - μ'(top rung)|; nan where nothing is certified.
    """

    prediction: Prediction
    rung: NDArray[np.str_]
    error_bound: FloatArray


def _by_drive(batch: Batch) -> list[tuple[NDArray[np.intp], bool]]:
    """The certified scenes, at resonance and at a stated frequency apart."""
    inside, resonant = certified(batch), np.isnan(batch.frequency_hz)
    groups = [(inside & resonant, True), (inside & ~resonant, False)]
    return [(np.flatnonzero(rows), kind) for rows, kind in groups if rows.any()]


def _bound(top: Range, mu: FloatArray) -> FloatArray:
    """How far the top rung can be from `mu`."""
    return np.maximum(top.high - mu, mu - top.low) + _ROUNDING


def error_bounds(batch: Batch, rung: str, choice: LawChoice, mu: FloatArray) -> FloatArray:
    """The certified error of a named rung's μ' against the top rung; nan where there is none."""
    bounds = np.full(batch.size, 0.0 if rung == TOP_RUNG else np.nan)
    if rung in MODAL_RUNGS:
        for which, resonant in _by_drive(batch):
            top = top_rung_range(batch.rows(which), choice, resonant=resonant)
            bounds[which] = _bound(top, mu[which])
    return bounds


Part = tuple[NDArray[np.intp], str, FloatArray, Prediction]


def _cheap_parts(
    batch: Batch, which: NDArray[np.intp], choice: LawChoice, tolerance: float, *, resonant: bool
) -> Iterator[Part]:
    """The scenes that a candidate serves: rows, the candidate, its bounds, its predictions."""
    top = top_rung_range(batch.rows(which), choice, resonant=resonant)
    for name in CANDIDATES:
        if which.size:
            prediction = rung_prediction(batch.rows(which), name, choice)
            bound = _bound(top, prediction.mu_effective)
            within = bound <= tolerance
            good = np.flatnonzero(within)
            yield which[good], name, bound[good], prediction.rows(good)
            which = which[~within]
            top = Range(low=top.low[~within], high=top.high[~within])


def auto_prediction(batch: Batch, choice: LawChoice, tolerance: float) -> Chosen:
    """Predictions within `tolerance` of the top rung, each by the cheapest rung certified for it.

    Args:
        batch: the scenes.
        choice: the law.
        tolerance: the largest error in μ' against the top rung, above 0.

    Raises:
        OutOfRangeError: the tolerance is not above 0, or a mode lies beyond the top rung's cut-off.
    """
    positive("tolerance", tolerance)
    rung = np.full(batch.size, TOP_RUNG, dtype=f"<U{len(TOP_RUNG)}")
    bounds = np.zeros(batch.size)
    parts = []
    for which, resonant in _by_drive(batch):
        for taken, name, bound, prediction in _cheap_parts(
            batch, which, choice, tolerance, resonant=resonant
        ):
            rung[taken], bounds[taken] = name, bound
            parts.append((taken, prediction))
    rest = np.flatnonzero(rung == TOP_RUNG)
    if rest.size:
        parts.append((rest, rung_prediction(batch.rows(rest), TOP_RUNG, choice)))
    return Chosen(prediction=joined(parts, batch.size), rung=rung, error_bound=bounds)
