"""Ratings of single trials, the axes on which they are fitted, and how lines differ between people.

Numbers of equations are those of docs/mathematics/sensitivity.md.
"""

from dataclasses import dataclass, replace

import numpy as np

from analysis.estimates import BoolArray, FloatArray, IntArray, NotEstimable

# Ratings of single trials, with their predicted contrasts.


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
        if len(bad := self.contrast[~np.isfinite(self.contrast)]):
            raise ValueError(f"a predicted contrast must be finite, got {bad[0]}")
        if len(bad := self.rating[np.isinf(self.rating)]):
            raise ValueError(f"a rating must be finite or missing, got {bad[0]}")

    @property
    def given(self) -> "Ratings":
        """The trials that have a rating."""
        return self.where(~np.isnan(self.rating))

    def where(self, chosen: BoolArray) -> "Ratings":
        """Return the chosen trials; subjects and conditions stay the same."""
        names = ("subject", "condition", "contrast", "rating")
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})


def _check_positions(name: str, positions: IntArray, count: int) -> None:
    if len(outside := positions[(positions < 0) | (positions >= count)]):
        raise ValueError(f"{name} must lie in [0, {count - 1}], got {outside[0]}")


# The scale on which ratings are fitted, and how lines differ between subjects.


@dataclass(frozen=True, kw_only=True)
class Axes:
    """Centre and scale of contrasts and ratings, which are fitted in standard units."""

    x_mean: float
    x_sd: float
    y_mean: float
    y_sd: float


def axes_of(trials: Ratings) -> Axes | NotEstimable:
    """Return centre and scale of the trials, or why they do not determine a line."""
    if len(trials.rating) < 3:
        return NotEstimable(
            f"a line needs at least 3 ratings with a predicted contrast, got {len(trials.rating)}"
        )
    x, y = ((float(each.mean()), float(each.std())) for each in (trials.contrast, trials.rating))
    axes = Axes(x_mean=x[0], x_sd=x[1], y_mean=y[0], y_sd=y[1])
    if axes.x_sd <= 1e-9 * float(np.abs(trials.contrast).max()):
        return NotEstimable("all predicted contrasts are equal, so the gain cannot be estimated")
    if axes.y_sd <= 1e-9 * float(np.abs(trials.rating).max()):
        return NotEstimable(f"all ratings are equal ({trials.rating[0]:g})")
    return axes


def roots_of_covariances(points: FloatArray) -> FloatArray:
    """Return (1), L of T = L L' at points (log τ_bias, log τ_gain, artanh ρ), (points, 2, 2)."""
    bias, gain = np.exp(points[:, :2]).T
    rows = [[bias, 0 * bias], [gain * np.tanh(points[:, 2]), gain / np.cosh(points[:, 2])]]
    return np.moveaxis(np.array(rows), -1, 0)


def log_prior_of_spread(log_sd: FloatArray) -> FloatArray:
    """Return the log prior density of the logarithm of a standard deviation between subjects.

    The density of s is s / (1 + s²)^(3/2), in standard units. It is flat in the variance where
    this is small relative to that of the ratings, so that intervals of single subjects have their
    nominal coverage (Morris and Tang, Statistical Science 26, 2011, 271-287), and proper because
    it falls off beyond.
    """
    # (2)
    return np.asarray(2 * log_sd - 1.5 * np.log1p(np.exp(2 * log_sd)))
