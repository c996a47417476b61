"""Ordered answers prepared for the latent line: categories, thresholds, equal trials counted."""

from dataclasses import dataclass

import numpy as np

from analysis.scores import FloatArray
from analysis.sensitivity.ratings import IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class OrdinalTrials:
    """Trials sorted by subject, equal ones once with their number as `weight`.

    Parameters:
        subjects, conditions: how many there are; `conditions` 0 leaves discrepancies out.
        subject, condition, x, category, weight: shape (trials,); x in standard units.
        thresholds: shape (categories - 1,), in standard units of the ratings: where they are held,
            and elsewhere where the search begins.
        free: shape (categories - 1,), which thresholds are sought. At least two are held: they
            give the latent scale its zero and unit.
    """

    subjects: int
    conditions: int
    subject: IntArray
    condition: IntArray
    x: FloatArray
    category: IntArray
    weight: FloatArray
    thresholds: FloatArray
    free: np.typing.NDArray[np.bool_]

    @property
    def held_out(self) -> slice:
        """Where the free thresholds are among the shared numbers; the line follows."""
        return slice(0, int(self.free.sum()))

    @property
    def line_columns(self) -> slice:
        """Where the population's line is among the shared numbers; discrepancies follow."""
        return slice(self.held_out.stop, self.held_out.stop + 2)

    @property
    def shared_start(self) -> FloatArray:
        """Where the search for what subjects share begins."""
        return np.concatenate([self.thresholds[self.free], np.zeros(2 + self.conditions)])

    def edges(self, shared: FloatArray) -> FloatArray:
        """Return all thresholds at these shared numbers, with an infinite one at either end."""
        thresholds = self.thresholds.copy()
        thresholds[self.free] = shared[self.held_out]
        return np.concatenate([[-np.inf], thresholds, [np.inf]])

    def location(self, shared: FloatArray, own: FloatArray) -> FloatArray:
        """Return each trial's place on the latent scale; `own` (subjects, 2) adds to the line."""
        lines = (own + shared[self.line_columns])[self.subject]
        discrepancies = shared[self.line_columns.stop :]
        added = discrepancies[self.condition] if self.conditions else 0.0
        return np.asarray(lines[:, 0] + lines[:, 1] * self.x + added)


def counted(columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the different rows in order of their columns, and how often each occurs."""
    rows, counts = np.unique(columns, axis=0, return_counts=True)
    return rows, counts.astype(np.float64)
