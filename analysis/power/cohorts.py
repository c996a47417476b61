"""A simulated cohort as the estimators take it, and its null: the same without any effect."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from analysis.estimates import FloatArray
from analysis.sensitivity.ratings import Ratings


@dataclass(frozen=True, kw_only=True, eq=False)
class Cohort:
    """The scored trials of a simulated study that its exclusions leave, and the truth.

    `bias` and `gain` are the subjects' true ones, shape (subjects,), in points of the study's
    scale and per unit of contrast; `population_gain` is the mean of those they were drawn from.
    """

    ratings: Ratings
    bias: FloatArray
    gain: FloatArray
    population_gain: float

    @property
    def scores(self) -> FloatArray:
        """Mean scores, shape (subjects, conditions); NaN where none was given."""
        given = self.ratings.given
        shape = len(given.subjects), len(given.conditions)
        cell = given.subject * shape[1] + given.condition
        counts = np.bincount(cell, minlength=shape[0] * shape[1])
        sums = np.bincount(cell, weights=given.rating, minlength=shape[0] * shape[1])
        means = np.full(shape[0] * shape[1], np.nan)
        np.divide(sums, counts, out=means, where=counts > 0)
        return means.reshape(shape)


class Simulate(Protocol):
    """A way to simulate one study again and again.

    A key gives the same study every time, on every machine.
    """

    def cohort(self, key: str) -> Cohort:
        """Return the scored trials of the study of `key`."""
        ...

    def tables(self, keys: Sequence[str]) -> FloatArray:
        """Return the tables of scores of the studies of `keys`.

        Shape (keys, participants, conditions); NaN where no score was given, and in the whole row
        of a participant whom the study's rules leave out.
        """
        ...


def without_effect(table: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return a table with each subject's scores shuffled over the conditions.

    What is given and withheld, ceilings and people's use of numbers stay; the conditions mean
    nothing any more, so that every difference, and every difference between gains, is 0.
    """
    return rng.permuted(table, axis=1)
