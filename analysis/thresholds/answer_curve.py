"""The curve of a psychometric function, the answers that it predicts, and the prior."""

import math
from collections.abc import Sequence
from typing import Final, Literal, NamedTuple, TypeAlias

import numpy as np
from scipy.special import ndtr, ndtri

from analysis.estimates import FloatArray

Shape: TypeAlias = Literal["normal", "weibull"]
Box: TypeAlias = tuple[tuple[float, float], ...]
Cells: TypeAlias = tuple[int, ...]
AT_ONCE = 2**14
"""Numbers in a step: they fit into a processor's cache, and many levels into the memory."""
MIDPOINTS: Final = (-0.5, 1.5)
MOST_WIDTH = 3.0
MOST_RATE = 0.5
RATE_PRIOR = 9.0
"""Lapse and guess rates have the prior (1 - rate)^9: Beta(1, 10)."""
LEAST_SHARE = 1e-9
TAIL = 0.05
"""A curve's width reaches from this share to its complement."""


class Curve(NamedTuple):
    """A curve from 0 to 1, (2), and the share of it that defines the threshold."""

    shape: Shape
    share: float

    def place(self, share: float) -> float:
        """Return the y at which the curve has this share.

        >>> Curve("normal", 0.5).place(0.5)
        0.0
        """
        return float(ndtri(share)) if self.shape == "normal" else math.log(-math.log1p(-share))

    @property
    def width(self) -> float:
        """How far y goes from 5% to 95% of the curve."""
        return self.place(1 - TAIL) - self.place(TAIL)

    @property
    def below(self) -> float:
        """How many widths the midpoint lies below the threshold."""
        return (self.place(self.share) - self.place(0.5)) / self.width

    def height(self, y: FloatArray) -> FloatArray:
        """Return F(y) of (2)."""
        if self.shape == "normal":
            return np.asarray(ndtr(y))
        return np.asarray(-np.expm1(-np.exp(np.minimum(y, 700.0))))

    def slopes(self, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the first and the second derivative of F at y."""
        if self.shape == "normal":
            rise = np.exp(-(y**2) / 2) / math.sqrt(2 * math.pi)
            return rise, -y * rise
        rise = np.exp(y - np.exp(y))
        return rise, rise * (1 - np.exp(y))

    def share_correct(self, at: FloatArray, parameters: Sequence[FloatArray]) -> FloatArray:
        """Return the share correct at levels, (1): threshold, log width, lapse and guess rate.

        It keeps away from 0 and 1, so that an answer against a rate that is known to be 0 is
        unlikely, and not impossible.
        """
        threshold, log_width, lapse, guess = parameters
        y = self.width * (at - threshold) / np.exp(log_width) + self.place(self.share)
        p = guess + (1 - guess - lapse) * self.height(y)
        return np.asarray(np.minimum(np.maximum(p, LEAST_SHARE), 1 - LEAST_SHARE))


class LevelAnswers(NamedTuple):
    """Answers at levels on an axis whose range that could be asked is [0, 1].

    `at` has shape (levels,), -inf for no stimulus on a logarithmic axis; `step` is the smallest
    distance of two levels, for the prior of the width. `lapse` and `guess` are rates that are
    known, None if they are to be estimated.
    """

    at: FloatArray
    trials: FloatArray
    correct: FloatArray
    step: float
    lapse: float | None
    guess: float | None

    @property
    def limits(self) -> Box:
        """The ends of midpoint, log width, lapse and guess rate; equal ones if it is known."""
        return (
            MIDPOINTS,
            (math.log(self.step), math.log(MOST_WIDTH)),
            *((0.0, MOST_RATE) if rate is None else (rate, rate) for rate in self[-2:]),
        )


def log_density(
    parameters: Sequence[FloatArray], answers: LevelAnswers, curve: Curve
) -> FloatArray:
    """Return log prior plus log likelihood, (4) and (5), in the cells of a grid.

    The parameters are threshold, log width, lapse and guess rate, each of four axes of which the
    first is whole in the threshold.
    """
    threshold, log_width, lapse, guess = parameters
    middle = threshold - curve.below * np.exp(log_width)
    total = log_prior((middle, log_width, lapse, guess), answers.step)
    at = answers.at.reshape(-1, 1, 1, 1, 1)
    wrong = answers.trials - answers.correct
    at_once = max(1, AT_ONCE * len(threshold) // (at.size * total.size))
    for first in range(0, len(threshold), at_once):
        part = slice(first, first + at_once)
        p = curve.share_correct(at, [one[part] if len(one) > 1 else one for one in parameters])
        total[part] += np.tensordot(answers.correct, np.log(p), 1)
        total[part] += np.tensordot(wrong, np.log1p(-p), 1)
    return total


def log_prior(parameters: Sequence[FloatArray], step: float) -> FloatArray:
    """Return the logarithm of (4) at midpoints, log widths, lapse and guess rates."""
    middle, log_width, lapse, guess = parameters
    with np.errstate(divide="ignore"):
        flat = np.log(_flat_within(middle, 0.0, 1.0, 0.5, 0.5)) + np.log(
            _flat_within(np.exp(log_width), 2 * step, 1.0, step, MOST_WIDTH - 1)
        )
    return np.asarray(flat + RATE_PRIOR * (np.log1p(-lapse) + np.log1p(-guess)))


def prior_gradient(parameters: FloatArray, step: float) -> FloatArray:
    """Return the gradient of `log_prior` at places, shape (places, 4)."""
    middle, log_width, *_ = parameters.T
    width = np.exp(log_width)
    found = -RATE_PRIOR / (1 - parameters)
    found[:, 0] = _slope_within(middle, 0.0, 1.0, 0.5, 0.5)
    found[:, 1] = width * _slope_within(width, 2 * step, 1.0, step, MOST_WIDTH - 1)
    return np.asarray(found)


def _flat_within(
    values: FloatArray, low: float, high: float, rise: float, fall: float
) -> FloatArray:
    """Return (4): 1 in [low, high], half a cosine to 0 over `rise` below and `fall` above it."""
    below = np.minimum(np.maximum((low - values) / rise, 0.0), 1.0)
    above = np.minimum(np.maximum((values - high) / fall, 0.0), 1.0)
    return np.asarray((1 + np.cos(np.pi * below)) * (1 + np.cos(np.pi * above)) / 4)


def _slope_within(
    values: FloatArray, low: float, high: float, rise: float, fall: float
) -> FloatArray:
    """Return the derivative of the logarithm of (4)."""
    below = np.minimum(np.maximum((low - values) / rise, 0.0), 1.0)
    above = np.minimum(np.maximum((values - high) / fall, 0.0), 1.0)
    return np.asarray(np.pi * (np.tan(np.pi * below / 2) / rise - np.tan(np.pi * above / 2) / fall))
