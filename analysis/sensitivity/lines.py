"""Bias and gain of each subject with intervals, the result of every sensitivity model.

Numbers of equations are those of docs/mathematics/sensitivity.md.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import expit

from analysis.estimates import ENDS, LEVEL, BoolArray, FloatArray, IntArray, Interval, NotEstimable
from analysis.sensitivity.integration import Marginals, WeightedPoints

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


SMALL_SPREAD = 0.25
"""A spread of gains that is small, as a share of the gain: skin alone spreads them by as much."""
LEVELS = (0.5, *ENDS, 1 - LEVEL)
"""Quantiles of an SD between subjects that a fit says."""
UNEQUAL = 0.025
"""Below this probability of equal gains, gains differ."""


@dataclass(frozen=True, kw_only=True)
class SubjectLine:
    """One subject's bias (rating at contrast 0) and gain (rating points per unit of contrast).

    They are posterior medians: where few ratings do not exclude a large gain, the mean is too high.
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

    `equal_gains` is the probability that all subjects have the same gain, if that was as probable
    as not before the study; `small_gain_sd` that of an SD below `SMALL_SPREAD` of the population's
    gain, equal gains included. The other statements on SDs are for gains that differ, but for
    the lower limit `gain_sd_interval`, which is 0 unless `equal_gains` is below `UNEQUAL`.
    The values of the population are NaN with a single subject, which tells nothing about others.
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
    gain_sd_upper: float
    small_gain_sd: float
    equal_gains: float
    jnd: float
    jnd_interval: Interval

    @property
    def group_known(self) -> bool:
        """Whether there are several subjects, who tell about others."""
        return not math.isnan(self.gain)

    @property
    def middle(self) -> tuple[float, float]:
        """Bias and gain of the population's line, or the line of the only subject with trials."""
        if self.group_known:
            return self.bias, self.gain
        only = max(self.subjects, key=lambda line: line.trials)
        return only.bias, only.gain


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
    """Return (2), L of T = L L' at points (log τ_bias, log τ_gain, artanh ρ), (points, 2, 2)."""
    bias, gain = np.exp(points[:, :2]).T
    rows = [[bias, 0 * bias], [gain * np.tanh(points[:, 2]), gain / np.cosh(points[:, 2])]]
    return np.moveaxis(np.array(rows), -1, 0)


def covariance_matrices(points: FloatArray) -> FloatArray:
    """Return T of points (log τ_bias, log τ_gain, artanh ρ), shape (points, 2, 2)."""
    root = roots_of_covariances(points)
    return np.asarray(root @ np.swapaxes(root, -1, -2))


@dataclass(frozen=True, kw_only=True, eq=False)
class LineMixture:
    """Posteriors of the lines in rating points, one per weighted point.

    `points` are variance components, log τ_bias, log τ_gain and artanh ρ in columns 1 to 3;
    `bias` and `gain` of each subject and, last, of the population; `relative` gain of each subject;
    `own_variance` (points, subjects), that of the departure from the population's gain over the
    variance between subjects; `residual_sd` (points,); `log_evidence_of_equal` integrates the same
    model with equal gains; `counts` (subjects,), the number of each one's trials.
    """

    points: WeightedPoints
    axes: Axes
    bias: Marginals
    gain: Marginals
    relative: Marginals
    own_variance: FloatArray
    residual_sd: FloatArray
    log_evidence_of_equal: Callable[[], float]
    counts: FloatArray

    @property
    def alone(self) -> bool:
        """Whether at most one subject has trials."""
        return bool((self.counts > 0).sum() < 2)

    @cached_property
    def equal_gains(self) -> float:
        """Posterior probability that all gains are equal, (4), which is 1/2 before the study.

        The first look takes a second integral, which nobody needs who asks for lines alone.
        """
        return float(expit(self.log_evidence_of_equal() - self.points.log_evidence))

    @cached_property
    def refusal(self) -> NotEstimable | None:
        """Why the points do not represent the posterior, or None if they do."""
        people = np.flatnonzero(np.append(self.counts > 0, not self.alone))
        return self.points.refusal(
            *(
                (part.part(people), [limits[row] for row in people])
                for part, limits in zip((self.bias, self.gain), self.intervals, strict=True)
            )
        )

    @cached_property
    def intervals(self) -> tuple[list[Interval], list[Interval]]:
        """The 95% intervals of bias and gain."""
        weights = self.points.weights
        return self.bias.interval_95(weights), self.gain.interval_95(weights)


def turn_of(axes: Axes) -> FloatArray:
    """Return (1), the matrix that maps (intercept, slope) in standard units to (bias, gain).

    Bias is the line's value at contrast 0, less the mean rating; the intercept is its value at the
    mean contrast.
    """
    turn = np.array([[1.0, -axes.x_mean / axes.x_sd], [0.0, 1 / axes.x_sd]])
    return turn * axes.y_sd


def spread_at(points: FloatArray, axes: Axes) -> FloatArray:
    """Return the SDs of bias and gain between subjects, (points, 2), as a mixture's points say."""
    turned = turn_of(axes) @ roots_of_covariances(points[:, 1:4])
    return np.asarray(np.sqrt((turned**2).sum(axis=-1)))


Medians = tuple[FloatArray, list[Interval]]
"""Posterior medians and their intervals."""


def medians(known: LineMixture) -> tuple[Medians, Medians, Medians]:
    """Return bias, gain and relative gain of each subject; the population's bias and gain last."""
    weights = known.points.weights
    bias, gain = (
        (part.quantiles(weights, 0.5)[0], intervals)
        for part, intervals in zip((known.bias, known.gain), known.intervals, strict=True)
    )
    relative = gain[0][:-1] - gain[0][:-1][known.counts > 0].mean()
    return bias, gain, (relative, known.relative.interval_95(weights))


def summary(subjects: tuple[str, ...], known: LineMixture) -> Lines:
    bias, gain, relative = medians(known)
    quantities = {"bias": bias, "gain": gain, "relative_gain": relative, "jnd": _jnd(known)}

    def of(row: int, *names: str) -> dict[str, Any]:
        told: dict[str, Any] = {}
        for name in names:
            values, intervals = quantities[name]
            told |= {name: float(values[row]), f"{name}_interval": intervals[row]}
        return told

    def spread(column: int) -> list[float]:
        return known.points.quantiles(
            lambda points: spread_at(points, known.axes)[:, column], *LEVELS
        )

    equal, bias_sd, gain_sd = known.equal_gains, spread(0), spread(1)
    # A variance that no trial reduces may exceed that between subjects by rounding.
    own = np.maximum(1 - known.points.weights @ known.own_variance, 0.0)
    lines = Lines(
        subjects=tuple(
            SubjectLine(
                subject=name,
                **of(row, *quantities),
                own_share=float(own[row]),
                trials=int(known.counts[row]),
            )
            for row, name in enumerate(subjects)
        ),
        **of(-1, "bias", "gain", "jnd"),
        bias_sd=bias_sd[0],
        bias_sd_interval=(bias_sd[1], bias_sd[2]),
        gain_sd=gain_sd[0],
        gain_sd_interval=(0.0 if equal >= UNEQUAL else gain_sd[1], gain_sd[2]),
        gain_sd_upper=gain_sd[3],
        small_gain_sd=equal + (1 - equal) * _small_gain_sd(known),
        equal_gains=equal,
    )
    return _of_one_subject(lines) if known.alone else lines


def _of_one_subject(lines: Lines) -> Lines:
    """Return the lines without what compares the subject with others."""
    nothing = math.nan, math.nan
    group: dict[str, Any] = {
        part.name: nothing if part.name.endswith("interval") else math.nan
        for part in fields(Lines)
        if part.name != "subjects"
    }
    subjects = tuple(
        replace(line, relative_gain=math.nan, relative_gain_interval=nothing)
        for line in lines.subjects
    )
    return replace(lines, subjects=subjects, **group)


def _small_gain_sd(known: LineMixture) -> float:
    """Return the probability that the SD of gains is a small share of the size of the gain."""
    gain, weights = known.gain.part(slice(-1, None)), known.points.weights
    least = spread_at(known.points.points, known.axes)[:, 1:] / SMALL_SPREAD
    steep = gain.plus(-least).above_zero(weights) + 1 - gain.plus(least).above_zero(weights)
    return float(steep[0])


def _jnd(known: LineMixture) -> Medians:
    """Return the JNDs, infinite without a positive gain; the steepest line has the smallest."""
    in_noise, weights = known.gain.over(known.residual_sd), known.points.weights
    low, middle, high = (
        [1 / gain if gain > 0 else math.inf for gain in limits.tolist()]
        for limits in in_noise.quantiles(weights, ENDS[1], 0.5, ENDS[0])
    )
    return np.array(middle), list(zip(low, high, strict=True))


def log_prior_of_spread(log_sd: FloatArray) -> FloatArray:
    """Return the log prior density of the logarithm of a standard deviation between subjects.

    The density of s is s / (1 + s²)^(3/2), in standard units. It is flat in the variance where
    this is small relative to that of the ratings, so that intervals of single subjects have their
    nominal coverage (Morris and Tang, Statistical Science 26, 2011, 271-287), and proper because
    it falls off beyond.
    """
    # (3)
    return np.asarray(2 * log_sd - 1.5 * np.log1p(np.exp(2 * log_sd)))
