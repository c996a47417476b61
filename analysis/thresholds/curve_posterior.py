"""The posterior of a psychometric function on a grid that closes in on it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple, TypeAlias

import numpy as np
from scipy.special import ndtr, ndtri

from analysis.estimates import FloatArray

Shape: TypeAlias = Literal["normal", "weibull"]
COARSE: Final = (13, 11, 7, 5)
FINE: Final = (36, 30, 14, 1), (22, 18, 9, 9)
"""Cells for threshold, log width, lapse rate and guess rate; the second where the last is free."""
NEGLIGIBLE = 12.0
"""Cells whose log density lies so far below the highest are left out."""
SAME_BOX = 0.8
"""A box that shrinks to more than this share of itself on all axes is as small as it becomes."""
MOST_PASSES = 8
AROUND = (7, 7, 5, 5)
"""Cells in which the mode is looked for, each time around the highest one."""
MODE_PASSES = 14
SHRINKING = 0.6
"""Of the box in each pass: slow enough to follow a ridge of the density."""
AT_ONCE = 2**14
"""Numbers in a step: they fit into a processor's cache, and many levels into the memory."""
MOST_RATE = 0.5
RATE_PRIOR = 9.0
"""Lapse and guess rates have the prior (1 - rate)^9: Beta(1, 10)."""
LEAST_SHARE = 1e-9
TAIL = 0.05
"""A curve's width reaches from this share to its complement."""

Box: TypeAlias = tuple[tuple[float, float], ...]
Cells: TypeAlias = tuple[int, ...]


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

    def share_correct(self, at: FloatArray, parameters: Sequence[FloatArray]) -> FloatArray:
        """Return the share correct at levels, (1): threshold, log width, lapse and guess rate.

        It keeps away from 0 and 1, so that an answer against a rate that is known to be 0 is
        unlikely, and not impossible.
        """
        threshold, log_width, lapse, guess = parameters
        y = self.width * (at - threshold) / np.exp(log_width) + self.place(self.share)
        curve = ndtr(y) if self.shape == "normal" else -np.expm1(-np.exp(np.minimum(y, 700.0)))
        p = guess + (1 - guess - lapse) * curve
        return np.asarray(np.clip(p, LEAST_SHARE, 1 - LEAST_SHARE))


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


@dataclass(frozen=True)
class Posterior:
    """The posterior's mass in the cells of a grid: threshold, log width, lapse and guess rate.

    `mode` is where the density of threshold, width and rates is highest.
    """

    axes: tuple[FloatArray, ...]
    mass: FloatArray
    box: Box
    mode: tuple[float, ...]

    def quantiles(self, axis: int, parts: FloatArray) -> FloatArray:
        """Return the quantiles of one parameter: (6), linear within a cell."""
        others = tuple(other for other in range(self.mass.ndim) if other != axis)
        below = np.append(0.0, np.cumsum(self.mass.sum(axis=others)))
        return np.interp(parts, below, np.linspace(*self.box[axis], below.size))

    def draws(self, number: int, rng: np.random.Generator) -> FloatArray:
        """Return draws of the four parameters, shape (4, number): the middles of cells."""
        below = np.cumsum(self.mass)
        cells = np.searchsorted(below, rng.random(number) * below[-1])
        index = np.unravel_index(cells, self.mass.shape)
        return np.array([axis[place] for axis, place in zip(self.axes, index, strict=True)])


def posterior(answers: LevelAnswers, curve: Curve) -> Posterior:
    """Return the posterior on the smallest grid that holds all of it but a negligible part."""
    rates = answers.lapse, answers.guess
    widths = (answers.step, 3.0)
    beyond = [curve.below * width for width in widths]
    box: Box = (
        (-0.5 + min(beyond), 1.5 + max(beyond)),
        (math.log(widths[0]), math.log(widths[1])),
        *((0.0, MOST_RATE) if rate is None else (rate, rate) for rate in rates),
    )

    def density(box: Box, cells: Cells) -> FloatArray:
        return _log_density(_axes(box, cells), answers, curve)

    free = (True, True, *(rate is None for rate in rates))
    coarse, fine, around = (
        tuple(np.where(free, cells, 1)) for cells in (COARSE, FINE[all(free)], AROUND)
    )
    for _ in range(MOST_PASSES):
        before, box = box, _closer(box, _by_log_width(density(box, coarse), box))
        if (np.diff(box) >= SAME_BOX * np.diff(before)).all():
            break
    log_density = density(box, fine)
    mass = np.exp(_by_log_width(log_density, box))
    mode = _highest(box, log_density, box)
    for _ in range(MODE_PASSES):
        mode = _highest(mode, density(mode, around), box)
    return Posterior(
        _axes(box, fine), mass / mass.sum(), box, tuple((low + high) / 2 for low, high in mode)
    )


def _axes(box: Box, cells: Cells) -> tuple[FloatArray, ...]:
    """Return the middles of the cells along each axis."""
    pairs = zip(box, cells, strict=True)
    return tuple(low + (high - low) * (np.arange(n) + 0.5) / n for (low, high), n in pairs)


def _by_log_width(log_density: FloatArray, box: Box) -> FloatArray:
    """Return the density as one of log width, relative to the highest."""
    log_width = _axes(box, log_density.shape)[1].reshape(1, -1, 1, 1)
    by_log_width = log_density + log_width
    return np.asarray(by_log_width - by_log_width.max())


def _highest(box: Box, log_density: FloatArray, within: Box) -> Box:
    """Return a smaller box around the highest cell, which may reach out of the box."""
    index = np.unravel_index(log_density.argmax(), log_density.shape)
    found = []
    for (low, high), (least, most), place, cells in zip(
        box, within, index, log_density.shape, strict=True
    ):
        middle, reach = low + (place + 0.5) * (high - low) / cells, SHRINKING / 2 * (high - low)
        found.append((max(least, middle - reach), min(most, middle + reach)))
    return tuple(found)


def _closer(box: Box, log_density: FloatArray) -> Box:
    """Return the box without cells that are negligible, but with one cell around the others."""
    kept = log_density > -NEGLIGIBLE
    found = []
    for axis, (low, high) in enumerate(box):
        others = tuple(other for other in range(4) if other != axis)
        inside = np.flatnonzero(kept.any(axis=others))
        cells = log_density.shape[axis]
        first, last = max(inside[0] - 1, 0), min(inside[-1] + 2, cells)
        edge = (high - low) / cells
        found.append((float(low + first * edge), float(low + last * edge)))
    return tuple(found)


def _log_density(axes: Sequence[FloatArray], answers: LevelAnswers, curve: Curve) -> FloatArray:
    """Return log prior plus log likelihood, (4) and (5), at the points of a grid."""
    threshold, log_width, lapse, guess = np.ix_(*axes)
    width = np.exp(log_width)
    with np.errstate(divide="ignore"):
        prior = np.log(_flat_within(threshold - curve.below * width, 0.0, 1.0, 0.5, 0.5)) + np.log(
            _flat_within(width, 2 * answers.step, 1.0, answers.step, 2.0)
        )
    total: FloatArray = prior + RATE_PRIOR * (np.log1p(-lapse) + np.log1p(-guess))
    at = answers.at.reshape(-1, 1, 1, 1, 1)
    wrong = answers.trials - answers.correct
    at_once = max(1, AT_ONCE * len(threshold) // (at.size * total.size))
    for first in range(0, len(threshold), at_once):
        part = slice(first, first + at_once)
        p = curve.share_correct(at, (threshold[part], log_width, lapse, guess))
        total[part] += np.tensordot(answers.correct, np.log(p), 1)
        total[part] += np.tensordot(wrong, np.log1p(-p), 1)
    return total


def _flat_within(
    values: FloatArray, low: float, high: float, rise: float, fall: float
) -> FloatArray:
    """Return (4): 1 in [low, high], half a cosine to 0 over `rise` below and `fall` above it."""
    below = np.clip((low - values) / rise, 0.0, 1.0)
    above = np.clip((values - high) / fall, 0.0, 1.0)
    return np.asarray((1 + np.cos(np.pi * below)) * (1 + np.cos(np.pi * above)) / 4)
