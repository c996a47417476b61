"""The curve of a psychometric function, the answers that it predicts, and the prior."""

import math
from collections.abc import Sequence
from typing import Final, Literal, NamedTuple, TypeAlias

import numpy as np
from scipy.special import gammaln, ndtr, ndtri

from analysis.estimates import FloatArray

Shape: TypeAlias = Literal["normal", "weibull"]
Box: TypeAlias = tuple[tuple[float, float], ...]
Cells: TypeAlias = tuple[int, ...]
MIDPOINTS_BEYOND = 0.5
"""A midpoint lies at most so far beyond the levels, in their range."""
USUAL_WIDTH = 0.4
"""Of a curve, in the range of the levels: wider and narrower ones are less likely before, (4)."""
WIDTHS: Final = (1e-3, 1e2)
MOST_RATE = 0.5
MOST_SCATTER = 0.8
RATE_PRIOR = 9.0
"""Lapse and guess rates and the scatter have the prior (1 - rate)^9: Beta(1, 10)."""
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

    `at` has shape (levels,), -inf for no stimulus on a logarithmic axis. `lapse` and `guess` are
    rates that are known, None if they are to be estimated.
    """

    at: FloatArray
    trials: FloatArray
    correct: FloatArray
    lapse: float | None
    guess: float | None

    @property
    def limits(self) -> Box:
        """The ends of midpoint, log width, lapse and guess rate; equal ones if it is known.

        Together the rates are at most 1: the curve never falls.
        """
        return (
            (-MIDPOINTS_BEYOND, 1 + MIDPOINTS_BEYOND),
            (math.log(WIDTHS[0]), math.log(WIDTHS[1])),
            *(
                (0.0, min(MOST_RATE, 1 - (other or 0))) if rate is None else (rate, rate)
                for rate, other in ((self.lapse, self.guess), (self.guess, self.lapse))
            ),
        )


def log_density(
    parameters: Sequence[FloatArray],
    scatter: FloatArray,
    answers: LevelAnswers,
    curve: Curve,
    nodes: int,
) -> FloatArray:
    """Return log prior plus log likelihood, (4) and (5), in the cells of a grid.

    The parameters are threshold, log width, lapse and guess rate, each of five axes, of which the
    last is that of `scatter`, shape (n,). Beta functions of all cells would take long: those of a
    level are computed at `nodes` places between its least and its largest share.
    """
    threshold, log_width, lapse, guess = parameters
    within = np.clip(log_width, *np.log(WIDTHS))
    middle = threshold - curve.below * np.exp(within)
    total = log_prior((middle, log_width, lapse, guess)) + RATE_PRIOR * np.log1p(-scatter)
    parameters = threshold, within, lapse, guess
    flat = total.reshape(-1, scatter.size)
    along, row = np.linspace(0.0, 1.0, nodes), nodes * np.arange(scatter.size)
    for at, number, right in zip(answers.at, answers.trials, answers.correct, strict=True):
        share = curve.share_correct(at, parameters)
        # Evenly over the arcsine, on which all shares are known equally well.
        place = np.arcsin(np.sqrt(np.broadcast_to(share, total.shape).reshape(flat.shape)))
        least, most = place.min(axis=0), place.max(axis=0)
        length = np.maximum(most - least, 1e-12)
        shares = np.sin(least[:, np.newaxis] + length[:, np.newaxis] * along) ** 2
        told = answered(shares, scatter[:, np.newaxis], number, right)
        place -= least
        place *= (nodes - 1) / length
        below = np.minimum(place.astype(np.intp), nodes - 2)
        place -= below
        below += row
        flat += np.take(told, below)
        place *= np.take(np.diff(told, axis=1, append=0.0), below)
        flat += place
    return total


def answered(share: FloatArray, scatter: FloatArray, number: float, right: float) -> FloatArray:
    """Return the log likelihood of `right` of `number` answers, (5): beta-binomial."""
    share = np.minimum(np.maximum(share, LEAST_SHARE), 1 - LEAST_SHARE)
    size = 1 / scatter**2 - 1
    a, b = size * share, size * (1 - share)
    of_these = gammaln(a + right) + gammaln(b + number - right) - gammaln(size + number)
    return np.asarray(of_these - gammaln(a) - gammaln(b) + gammaln(size))


def log_prior(parameters: Sequence[FloatArray]) -> FloatArray:
    """Return the logarithm of (4) at midpoints, log widths, lapse and guess rates."""
    middle, log_width, lapse, guess = parameters
    flat = np.log(np.maximum((1 + np.cos(np.pi * _beyond(middle))) / 2, 1e-300))
    of_width = np.log(np.cosh(log_width - math.log(USUAL_WIDTH)))
    return np.asarray(flat - 2 * of_width + RATE_PRIOR * (np.log1p(-lapse) + np.log1p(-guess)))


def prior_gradient(parameters: FloatArray) -> FloatArray:
    """Return the gradient of `log_prior` at places, shape (places, 4)."""
    middle, log_width, *rates = parameters.T
    steep = np.tan(np.pi * _beyond(middle) / 2) * np.sign(middle - 0.5)
    of_width = -2 * np.tanh(log_width - math.log(USUAL_WIDTH))
    of_rates = (-RATE_PRIOR / (1 - rate) for rate in rates)
    return np.stack([-np.pi / MIDPOINTS_BEYOND * steep, of_width, *of_rates], axis=1)


def _beyond(middle: FloatArray) -> FloatArray:
    """Return how far midpoints lie beyond the levels: 1 where none is expected."""
    outside = np.maximum(np.maximum(-middle, middle - 1), 0.0)
    return np.asarray(np.minimum(outside / MIDPOINTS_BEYOND, 1.0))
