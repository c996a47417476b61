"""Ratings trial by trial, with the contrast that the friction model predicts for each."""

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from analysis.estimates import FloatArray

IntArray: TypeAlias = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Ratings:
    """One entry per trial: who, under which condition, at which predicted contrast, what rating.

    Parameters:
        subjects: names; a subject without trials is allowed.
        conditions: names.
        subject: shape (trials,), positions in `subjects`.
        condition: shape (trials,), positions in `conditions`.
        contrast: shape (trials,), predicted contrast, dimensionless; 0 on a catch trial, negative
            where the opposite of the expected change is predicted.
        rating: shape (trials,), on the study's scale; NaN where none was given.

    Raises:
        ValueError: arrays of different length, a position outside the names, an infinite value.
    """

    subjects: tuple[str, ...]
    conditions: tuple[str, ...]
    subject: IntArray
    condition: IntArray
    contrast: FloatArray
    rating: FloatArray

    def __post_init__(self) -> None:
        trials = len(self.subject)
        for name in ("condition", "contrast", "rating"):
            if len(getattr(self, name)) != trials:
                raise ValueError(f"{name} needs {trials} trials, got {len(getattr(self, name))}")
        _check_positions("subject", self.subject, len(self.subjects))
        _check_positions("condition", self.condition, len(self.conditions))
        if not np.isfinite(self.contrast).all():
            bad = self.contrast[~np.isfinite(self.contrast)][0]
            raise ValueError(f"a predicted contrast must be finite, got {bad}")
        if np.isinf(self.rating).any():
            bad = self.rating[np.isinf(self.rating)][0]
            raise ValueError(f"a rating must be finite or missing, got {bad}")

    @property
    def given(self) -> "Ratings":
        """The trials that have a rating."""
        return self.where(~np.isnan(self.rating))

    def where(self, chosen: NDArray[np.bool_]) -> "Ratings":
        """Return the chosen trials, of the same subjects and conditions."""
        return replace(
            self,
            subject=self.subject[chosen],
            condition=self.condition[chosen],
            contrast=self.contrast[chosen],
            rating=self.rating[chosen],
        )


def _check_positions(name: str, positions: IntArray, count: int) -> None:
    outside = positions[(positions < 0) | (positions >= count)]
    if outside.size:
        raise ValueError(f"{name} must be one of {count} positions from 0, got {outside[0]}")
