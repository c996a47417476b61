"""Ratings of single trials, with their predicted contrasts."""

from dataclasses import dataclass, replace

import numpy as np

from analysis.estimates import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Ratings:
    """Subject, condition, predicted contrast and rating of each trial.

    Parameters:
        subjects: names; a subject without trials is allowed.
        conditions: names.
        subject: shape (trials,), positions in `subjects`.
        condition: shape (trials,), positions in `conditions`.
        contrast: shape (trials,), predicted contrast, dimensionless; 0 on a catch trial, negative
            if the opposite of the expected change is predicted.
        rating: shape (trials,), on the study's scale; NaN if missing.

    Raises:
        ValueError: arrays of different length, an invalid position, an infinite value.
    """

    subjects: tuple[str, ...]
    conditions: tuple[str, ...]
    subject: IntArray
    condition: IntArray
    contrast: FloatArray
    rating: FloatArray

    def __post_init__(self) -> None:
        for name in ("condition", "contrast", "rating"):
            count, trials = len(getattr(self, name)), len(self.subject)
            if count != trials:
                raise ValueError(f"{name} must have {trials} trials, got {count}")
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

    def where(self, chosen: BoolArray) -> "Ratings":
        """Return the chosen trials; subjects and conditions stay the same."""
        names = ("subject", "condition", "contrast", "rating")
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})


def _check_positions(name: str, positions: IntArray, count: int) -> None:
    outside = positions[(positions < 0) | (positions >= count)]
    if outside.size:
        raise ValueError(f"{name} must lie in [0, {count - 1}], got {outside[0]}")
