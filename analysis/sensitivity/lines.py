"""Bias and gain of each subject with intervals, the result of every sensitivity model."""

import math
from dataclasses import dataclass

import numpy as np

from analysis.estimates import FloatArray, Interval, NotEstimable
from analysis.sensitivity.integration import Marginals, weighted_quantile
from analysis.sensitivity.ratings import Ratings

SMALL_SPREAD = 0.25
"""A spread of gains that is small, as a share of the gain: skin alone spreads them by as much."""


@dataclass(frozen=True, kw_only=True)
class SubjectLine:
    """One subject's bias (rating at contrast 0) and gain (rating points per unit of contrast).

    `relative_gain` is the gain minus the mean gain of the subjects with trials, NaN for a single
    one. `jnd` is the contrast that moves a rating by the SD of its noise, infinite where the gain
    need not be positive. `own_share` is the share of the subject's departure from the group's gain
    that comes from the subject's own trials, 0 to 1. `trials` is the number of rated trials.
    """

    subject: str
    bias: float
    bias_interval: Interval
    gain: float
    gain_interval: Interval
    relative_gain: float
    relative_gain_interval: Interval
    jnd: float
    jnd_interval: Interval
    own_share: float
    trials: int

    @property
    def relative_gain_known(self) -> bool:
        """Whether there are other subjects to compare with."""
        return not math.isnan(self.relative_gain)


@dataclass(frozen=True, kw_only=True)
class Lines:
    """Lines of all subjects and of the population, and the SDs between subjects; 95% intervals.

    The prior of an SD has no mass at 0, so that its interval never includes 0: beside it stand the
    prior's interval, the value that the SD is below with 95% probability, and the probability
    `small_gain_sd` that it is less than `SMALL_SPREAD` of the population's gain.
    """

    subjects: tuple[SubjectLine, ...]
    bias: float
    bias_interval: Interval
    gain: float
    gain_interval: Interval
    bias_sd: float
    bias_sd_interval: Interval
    gain_sd: float
    gain_sd_interval: Interval
    gain_sd_prior_interval: Interval
    gain_sd_upper: float
    small_gain_sd: float
    jnd: float
    jnd_interval: Interval


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

    `weights` (points,); `bias` and `gain` of each subject and, last, of the population; `relative`
    gain of each subject; `own_variance` (points, subjects), that of the departure from the
    population's gain over the variance between subjects; `spread` (points, 2), the SDs of bias and
    gain between subjects; `residual_sd` (points,); `gain_unit`, one standard unit of a gain.
    """

    weights: FloatArray
    bias: Marginals
    gain: Marginals
    relative: Marginals
    own_variance: FloatArray
    spread: FloatArray
    residual_sd: FloatArray
    gain_unit: float


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
    relative = weights @ known.relative.means
    relative_intervals = known.relative.interval_95(weights)
    if (counts > 0).sum() < 2:
        relative = np.full(len(relative), np.nan)
        relative_intervals = [(np.nan, np.nan)] * len(relative)
    jnd = _jnd(known)
    # A variance that no trial reduces may exceed that between subjects by rounding.
    own = np.maximum(1 - weights @ known.own_variance, 0.0)
    small = known.gain.part(slice(-1, None)).plus(-spread[:, 1:] / SMALL_SPREAD)
    prior = [known.gain_unit * _prior_quantile_of_spread(p) for p in (0.025, 0.975)]
    return Lines(
        subjects=tuple(
            SubjectLine(
                subject=name,
                bias=float(bias[row]),
                bias_interval=bias_intervals[row],
                gain=float(gain[row]),
                gain_interval=gain_intervals[row],
                relative_gain=float(relative[row]),
                relative_gain_interval=relative_intervals[row],
                jnd=jnd[row][1],
                jnd_interval=(jnd[row][0], jnd[row][2]),
                own_share=float(own[row]),
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
        gain_sd_prior_interval=(prior[0], prior[1]),
        gain_sd_upper=weighted_quantile(weights, spread[:, 1], 0.95),
        small_gain_sd=float(small.above_zero(weights)[0]),
        jnd=jnd[-1][1],
        jnd_interval=(jnd[-1][0], jnd[-1][2]),
    )


def _jnd(known: LineMixture) -> list[list[float]]:
    """Return lower limit, median and upper limit of each JND, infinite without a positive gain."""
    in_noise = known.gain.over(known.residual_sd)
    steepest_first = [in_noise.quantile(known.weights, p) for p in (0.975, 0.5, 0.025)]
    rows = np.transpose(steepest_first).tolist()
    return [[1 / gain if gain > 0 else math.inf for gain in row] for row in rows]


def log_prior_of_spread(log_sd: FloatArray) -> FloatArray:
    """Return the log prior density of the logarithm of a standard deviation between subjects.

    The density of s is s / (1 + s²)^(3/2), in standard units. It is flat in the variance where
    this is small relative to that of the ratings, so that intervals of single subjects have their
    nominal coverage (Morris and Tang, Statistical Science 26, 2011, 271-287), and proper because
    it falls off beyond.
    """
    return np.asarray(2 * log_sd - 1.5 * np.log1p(np.exp(2 * log_sd)))


def _prior_quantile_of_spread(probability: float) -> float:
    """Return the quantile of that prior, in standard units: P(s' < s) = 1 - 1 / √(1 + s²)."""
    return float(np.sqrt((1 - probability) ** -2 - 1))


def _interval(weights: FloatArray, values: FloatArray) -> Interval:
    return (weighted_quantile(weights, values, 0.025), weighted_quantile(weights, values, 0.975))
