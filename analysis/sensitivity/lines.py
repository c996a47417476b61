"""Bias and gain of each subject with intervals, the result of every sensitivity model."""

from dataclasses import dataclass

import numpy as np

from analysis.estimates import FloatArray, Interval, NotEstimable
from analysis.sensitivity.integration import intervals_95, weighted_quantile
from analysis.sensitivity.ratings import Ratings


@dataclass(frozen=True, kw_only=True)
class SubjectLine:
    """One subject's bias (rating at contrast 0) and gain (rating points per unit of contrast).

    `shrinkage` is the share of the gain that comes from the subject's own trials and not from the
    group, 0 to 1. `trials` is the number of rated trials.
    """

    subject: str
    bias: float
    bias_interval: Interval
    gain: float
    gain_interval: Interval
    shrinkage: float
    trials: int


@dataclass(frozen=True, kw_only=True)
class Lines:
    """Lines of all subjects and of the population, and the SDs between subjects; 95 % intervals."""

    subjects: tuple[SubjectLine, ...]
    bias: float
    bias_interval: Interval
    gain: float
    gain_interval: Interval
    bias_sd: float
    bias_sd_interval: Interval
    gain_sd: float
    gain_sd_interval: Interval


@dataclass(frozen=True, kw_only=True)
class Axes:
    """Centre and scale of contrasts and ratings, which are fitted in standard units."""

    x_mean: float
    x_sd: float
    y_mean: float
    y_sd: float


def axes_about(contrast: FloatArray, rating: FloatArray) -> Axes:
    """Return centre and scale of these contrasts and ratings."""
    x, y = ((float(values.mean()), float(values.std())) for values in (contrast, rating))
    return Axes(x_mean=x[0], x_sd=x[1], y_mean=y[0], y_sd=y[1])


def axes_of(trials: Ratings) -> Axes | NotEstimable:
    """Return centre and scale of the trials, or why they do not determine a line."""
    if len(trials.rating) < 3:
        return NotEstimable(
            f"a line needs at least 3 ratings with a predicted contrast, got {len(trials.rating)}"
        )
    axes = axes_about(trials.contrast, trials.rating)
    if axes.x_sd <= 1e-9 * float(np.abs(trials.contrast).max()):
        return NotEstimable("all predicted contrasts are equal, so the gain cannot be estimated")
    if axes.y_sd <= 1e-9 * float(np.abs(trials.rating).max()):
        return NotEstimable(f"all ratings are equal ({trials.rating[0]:g})")
    return axes


def covariance_matrices(points: FloatArray) -> FloatArray:
    """Return T of points (log τ_bias, log τ_gain, artanh ρ), shape (points, 2, 2)."""
    sds = np.exp(points[:, :2])
    across = np.tanh(points[:, 2]) * sds[:, 0] * sds[:, 1]
    return np.moveaxis(np.array([[sds[:, 0] ** 2, across], [across, sds[:, 1] ** 2]]), -1, 0)


@dataclass(frozen=True, kw_only=True, eq=False)
class LineMixture:
    """Lines in standard units, as a mixture of normal posteriors, one per weighted point.

    `weights` (points,); `means` (points, subjects + 1, 2) and `covariances` (points, subjects + 1,
    2, 2) of intercept and slope, the population's line last; `between` (points, 2, 2), the
    covariance of subjects.
    """

    weights: FloatArray
    means: FloatArray
    covariances: FloatArray
    between: FloatArray


def summary(subjects: tuple[str, ...], counts: FloatArray, known: LineMixture, axes: Axes) -> Lines:
    """Return lines in rating points; `counts` has each subject's number of trials."""
    # Bias is the line's value at contrast 0; the intercept is its value at the mean contrast.
    turn = np.array([[1.0, -axes.x_mean / axes.x_sd], [0.0, 1.0]]) * axes.y_sd
    turn[1] /= axes.x_sd
    weights = known.weights
    centres = known.means @ turn.T + np.array([axes.y_mean, 0.0])
    sds = np.sqrt(np.diagonal(turn @ known.covariances @ turn.T, axis1=-2, axis2=-1))
    bias, gain = (weights @ centres[..., part] for part in (0, 1))
    bias_intervals, gain_intervals = (
        intervals_95(weights, centres[..., part], sds[..., part]) for part in (0, 1)
    )
    spread = np.sqrt(np.diagonal(turn @ known.between @ turn.T, axis1=-2, axis2=-1))
    # The subject's own share of the gain: 1 - posterior variance / variance between subjects.
    variance_ratio = known.covariances[:, :-1, 1, 1] / known.between[:, 1, 1][:, None]
    own = weights @ np.clip(1 - variance_ratio, 0.0, 1.0)
    return Lines(
        subjects=tuple(
            SubjectLine(
                subject=name,
                bias=float(bias[row]),
                bias_interval=bias_intervals[row],
                gain=float(gain[row]),
                gain_interval=gain_intervals[row],
                shrinkage=float(own[row]),
                trials=int(counts[row]),
            )
            for row, name in enumerate(subjects)
        ),
        bias=float(bias[-1]),
        bias_interval=bias_intervals[-1],
        gain=float(gain[-1]),
        gain_interval=gain_intervals[-1],
        bias_sd=weighted_quantile(weights, spread[:, 0], 0.5),
        bias_sd_interval=_interval(weights, spread[:, 0]),
        gain_sd=weighted_quantile(weights, spread[:, 1], 0.5),
        gain_sd_interval=_interval(weights, spread[:, 1]),
    )


def log_prior_of_spread(log_sd: FloatArray) -> FloatArray:
    """Return the log prior density of the logarithm of a standard deviation between subjects.

    The density of s is s / (1 + s²)^(3/2), in standard units. It is flat in the variance where
    this is small relative to that of the ratings, so that intervals of single subjects have their
    nominal coverage (Morris and Tang, Statistical Science 26, 2011, 271-287), and proper because
    it falls off beyond.
    """
    return np.asarray(2 * log_sd - 1.5 * np.log1p(np.exp(2 * log_sd)))


def _interval(weights: FloatArray, values: FloatArray) -> Interval:
    return (weighted_quantile(weights, values, 0.025), weighted_quantile(weights, values, 0.975))
