"""Bias and gain of each subject with intervals, the result of every sensitivity model."""

from dataclasses import dataclass

import numpy as np

from analysis.estimates import FloatArray, Interval, NotEstimable
from analysis.sensitivity.integration import Marginals, weighted_quantile
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
    """Posteriors of the lines in rating points, one per weighted point.

    `weights` (points,); `bias` and `gain` of each subject and, last, of the population; `spread`
    (points, 2), the SDs of bias and gain between subjects.
    """

    weights: FloatArray
    bias: Marginals
    gain: Marginals
    spread: FloatArray


def turn_of(axes: Axes) -> FloatArray:
    """Return the matrix that maps (intercept, slope) in standard units to (bias, gain).

    Bias is the line's value at contrast 0, less the mean rating; the intercept is its value at the
    mean contrast.
    """
    turn = np.array([[1.0, -axes.x_mean / axes.x_sd], [0.0, 1 / axes.x_sd]])
    return turn * axes.y_sd


def spread_of(between: FloatArray, axes: Axes) -> FloatArray:
    """Return the SDs of bias and gain between subjects, of their covariances in standard units."""
    turn = turn_of(axes)
    return np.asarray(np.sqrt(np.diagonal(turn @ between @ turn.T, axis1=-2, axis2=-1)))


def summary(subjects: tuple[str, ...], counts: FloatArray, known: LineMixture) -> Lines:
    """Return the lines of a mixture; `counts` has each subject's number of trials."""
    weights, spread = known.weights, known.spread
    bias, gain = (weights @ part.means for part in (known.bias, known.gain))
    bias_intervals, gain_intervals = (
        part.interval_95(weights) for part in (known.bias, known.gain)
    )
    # The subject's own share of the gain: 1 - posterior variance / variance between subjects.
    variance_ratio = (known.gain.sds[:, :-1] / spread[:, 1:]) ** 2
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
