"""`auto`: the cheapest rung whose error against the top rung is certified to be small enough.

A table made once (`certify`) tells, for the paper's beam, what the top rung says of a scene to
within bounds: at resonance from its zone edges and areas, off resonance from the most it can reach.
A cheap rung is taken where its friction coefficient lies within the tolerance of everything the
top rung may say. The domain: the paper's beam with any stiffness scale, damping ratios of 0.002 to
0.02, modes whose row the table has, local coverage or full; outside it the top rung is taken.

Only `far-field` and `mode` are candidates: `eq15` costs more than `far-field`, and rungs that
solve the segmented beam cost what the top rung costs.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from device.bounds import certified, top_rung_range
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


def _bound(batch: Batch, choice: LawChoice, mu: FloatArray, *, resonant: bool) -> FloatArray:
    """How far the top rung can be from `mu`."""
    top = top_rung_range(batch, choice, resonant=resonant)
    return np.maximum(top.high - mu, mu - top.low) + _ROUNDING


def error_bounds(batch: Batch, rung: str, choice: LawChoice, mu: FloatArray) -> FloatArray:
    """The certified error of a named rung's μ' against the top rung; nan where there is none."""
    bounds = np.full(batch.size, 0.0 if rung == TOP_RUNG else np.nan)
    if rung in MODAL_RUNGS:
        for which, resonant in _by_drive(batch):
            bounds[which] = _bound(batch.rows(which), choice, mu[which], resonant=resonant)
    return bounds


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
        open_rows = which
        for name in CANDIDATES:
            if open_rows.size:
                rows = batch.rows(open_rows)
                prediction = rung_prediction(rows, name, choice)
                bound = _bound(rows, choice, prediction.mu_effective, resonant=resonant)
                good = np.flatnonzero(bound <= tolerance)
                taken = open_rows[good]
                rung[taken], bounds[taken] = name, bound[good]
                parts.append((taken, prediction.rows(good)))
                open_rows = np.delete(open_rows, good)
    rest = np.flatnonzero(rung == TOP_RUNG)
    if rest.size:
        parts.append((rest, rung_prediction(batch.rows(rest), TOP_RUNG, choice)))
    return Chosen(prediction=joined(parts, batch.size), rung=rung, error_bound=bounds)
