"""The posterior of a psychometric function on grids around its mode."""

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from analysis.estimates import FloatArray
from analysis.thresholds.answer_curve import (
    MOST_SCATTER,
    Cells,
    Curve,
    LevelAnswers,
    log_density,
)
from analysis.thresholds.curve_mode import highest_density

COARSE: Final = (10, 8, 5, 4)
FINE: Final = (20, 16, 8, 1), (16, 14, 7, 7)
"""Cells for threshold, log width, lapse and guess rate; the second where the last is free."""
FEW_NODES, NODES = 40, 100
"""Shares of a level, from its least to its largest, at which its likelihood is computed."""
REACH = 6.0
"""Standard deviations from the mean to the ends of a box; in fewer, long tails would be lost."""
LONGER, FEW = 2.0, 50.0
LEFT_OUT = 2e-4
OF_RATES: Final = np.array([2e-4, 1 - 1e-3])
"""Of the mass, at each end of the last box's axes; and the quantiles of rates in which it lies."""
PASSES = 5
"""Boxes, each around the mass in the one before: it may grow or shrink threefold each time."""
APART = 1.8, 3.0
"""So many times as large is the next scatter: in the last grids, and in those before."""
MISFITS: Final = (1.1, 300.0)
"""A smaller scatter counts as none: answers deviate so many times as much as binomial ones. The
largest is one by which they deviate so many times as much as these."""
RATES = (2, 3)
NOTHING = 1e-300
EDGES, ENDS, CLOSER = 201, 4.0, 5.0
"""Places at which the distribution of a parameter is computed, up to 5.5 standard deviations from
the mean, and closer to each other near it."""


@dataclass(frozen=True)
class Posterior:
    """The posterior's mass in cells, for each scatter in a grid of its own.

    `middles` of threshold, log width, lapse and guess rate have the shape (4, cells, scatters),
    `mass` that of (cells, scatters); `sizes`, (4, scatters), is how far a cell reaches along each
    parameter, 0 if it is known; `edges` are those of the scatters.
    """

    middles: FloatArray
    sizes: FloatArray
    mass: FloatArray
    edges: FloatArray

    def below(self, axis: int, places: FloatArray) -> FloatArray:
        """Return how much of the mass lies below: (6), a cell's mass spread evenly along it."""
        total = np.zeros(np.shape(places))
        for middles, mass, size in zip(
            self.middles[axis].T, self.mass.T, self.sizes[axis], strict=True
        ):
            order = np.argsort(middles, kind="stable")
            at, of = middles[order], mass[order]
            sums, moment = (np.append(0.0, np.cumsum(each)) for each in (of, of * at))
            ends = [places + size / 2, places - size / 2]
            if axis in RATES:
                # No rate is below 0: what was spread there belongs above it.
                ends += [size / 2 - places, -size / 2 - places]
            for end, sign in zip(ends, (1, -1, -1, 1), strict=False):
                count = np.searchsorted(at, end)
                total += sign * (end * sums[count] - moment[count]) / size
        return total

    def quantiles(self, axis: int, parts: FloatArray) -> FloatArray:
        """Return the quantiles of one parameter."""
        if not self.sizes[axis].any():
            return np.full(np.shape(parts), self.middles[axis, 0, 0])
        mean = (self.middles[axis] * self.mass).sum()
        within = self.sizes[axis] ** 2 / 12
        sd = np.sqrt((((self.middles[axis] - mean) ** 2 + within) * self.mass).sum())
        edges = mean + sd * np.sinh(np.linspace(-ENDS, ENDS, EDGES)) / CLOSER
        if axis in RATES:
            edges = np.maximum(edges, 0.0)
        return np.asarray(np.interp(parts, self.below(axis, edges), edges))

    @property
    def scatter(self) -> float:
        """The median of the scatter."""
        below = np.append(0.0, np.cumsum(self.mass.sum(axis=0)))
        return float(np.interp(0.5, below, self.edges))

    def draws(self, number: int, rng: np.random.Generator) -> FloatArray:
        """Return draws of threshold, log width and rates, (4, number): the middles of cells."""
        below = np.cumsum(self.mass)
        cells = np.searchsorted(below, rng.random(number) * below[-1])
        return self.middles.reshape(4, -1)[:, cells]


class _Grid(NamedTuple):
    """Boxes along the axes of a covariance, which many answers make narrow and oblique.

    `factor` is the covariance's lower triangular one: a parameter's axis is standard normal for
    given values of those before it. A box reaches from `low` to `high` along them, which are 0 if
    the parameter is known; `rates` are limits of both rates, wherever a box ends. `edges` are
    those of the scatters, and `scale` is how many times as long the box of each one is.
    """

    centre: FloatArray
    factor: FloatArray
    low: FloatArray
    high: FloatArray
    rates: FloatArray
    edges: FloatArray
    scale: FloatArray

    @property
    def scatters(self) -> FloatArray:
        """Return the scatter of each cell, in the middle of its logarithms but for the first."""
        return np.append(self.edges[1] / 2, np.sqrt(self.edges[1:-1] * self.edges[2:]))

    def mass(self, cells: Cells, answers: LevelAnswers, curve: Curve, nodes: int) -> Posterior:
        """Return the mass in the cells, from the likelihood at so many shares of each level."""
        middles: list[FloatArray] = []
        places: list[FloatArray] = []
        volume = np.diff(self.edges).reshape(1, 1, 1, 1, -1)
        for axis, number in enumerate(cells):
            before = zip(self.factor[axis], places, strict=False)
            middle = self.centre[axis] + sum((by * place for by, place in before), 0 * volume)
            own, free = self.factor[axis, axis] * self.scale, self.high[axis] > self.low[axis]
            start, end = middle + own * self.low[axis], middle + own * self.high[axis]
            if axis in RATES and free:
                start, end = (np.clip(each, *self.rates[axis - RATES[0]]) for each in (start, end))
            size = (end - start) / number
            along = np.arange(number).reshape([-1 if one == axis else 1 for one in range(5)])
            middles.append(start + size * (along + 0.5))
            places.append((middles[axis] - middle) / self.factor[axis, axis])
            volume = volume * (size if free else 1)
        found = log_density(middles, self.scatters, answers, curve, nodes)
        # Beyond the limits of a rate a cell has no volume, however likely it would be.
        found += np.log(np.maximum(volume, NOTHING))
        mass = np.exp(found - found.max())
        points = [
            np.broadcast_to(each, found.shape).reshape(-1, self.scale.size) for each in middles
        ]
        length = self.high - self.low
        along = np.sqrt(((self.factor * (length / cells)) ** 2).sum(axis=1)) * (length > 0)
        sizes = along[:, None] * self.scale
        mass = mass.reshape(-1, self.scale.size) / mass.sum()
        return Posterior(np.array(points), sizes, mass, self.edges)

    def around(self, cells: Cells, found: Posterior) -> "_Grid":
        """Return boxes around the mass, with some of its own cell where that is in one."""
        free = self.high > self.low
        mean = np.where(free, np.tensordot(found.middles, found.mass, 2), self.centre)
        off = ((found.middles - mean[:, None, None]) / self.scale).reshape(4, -1)
        within = self.factor * ((self.high - self.low) / cells / np.sqrt(12))
        covariance = (off * found.mass.ravel()) @ off.T + within @ within.T
        both = free & free[:, None]
        factor = np.linalg.cholesky(np.where(both, covariance, np.eye(4)))
        return self._replace(centre=mean, factor=factor)

    def trimmed(self, cells: Cells, found: Posterior) -> "_Grid":
        """Return boxes without the ends in which there is next to nothing of the mass."""
        mass = found.mass.sum(axis=1).reshape(cells)
        low, high = self.low.copy(), self.high.copy()
        for axis in (0, 1):
            below = np.cumsum(mass.sum(axis=tuple({0, 1, 2, 3} - {axis})))
            edges = np.linspace(low[axis], high[axis], cells[axis] + 1)
            ends = np.interp([LEFT_OUT, 1 - LEFT_OUT], np.append(0.0, below), edges)
            low[axis], high[axis] = ends
        rates = [
            np.clip(found.quantiles(axis, OF_RATES), *limits) if free else limits
            for axis, free, limits in zip(RATES, (high > low)[2:], self.rates, strict=True)
        ]
        return self._replace(low=low, high=high, rates=np.array(rates))


def posterior(answers: LevelAnswers, curve: Curve) -> Posterior:
    """Return the posterior on grids that hold all of it but a negligible part."""
    limits = np.array(answers.limits)
    free = limits[:, 0] < limits[:, 1]
    coarse, fine = (
        tuple(np.where(free, cells, 1).tolist()) for cells in (COARSE, FINE[int(free[3])])
    )
    mode = highest_density(answers, curve, coarse)
    # From the midpoint to the threshold.
    above = curve.below * np.exp(mode.place[1])
    turned = np.eye(4)
    turned[0, 1] = above
    place = mode.place + np.array([above, 0, 0, 0])
    # Of few answers the posterior has longer tails than a normal distribution of its curvature.
    longer = 1 + LONGER / (1 + answers.trials.mean() / FEW)
    factor = longer * np.asarray(np.linalg.cholesky(turned @ mode.covariance @ turned.T))
    reach = np.where(free, REACH, 0.0)
    many, few = (_scatters(answers, curve, place, apart) for apart in APART)
    grid = _Grid(place, factor, -reach, reach, limits[2:], few, _scale(answers, few))
    for _ in range(PASSES):
        grid = grid.around(coarse, grid.mass(coarse, answers, curve, FEW_NODES))
    grid = grid.trimmed(coarse, grid.mass(coarse, answers, curve, FEW_NODES))
    grid = grid._replace(edges=many, scale=_scale(answers, many))
    return grid.mass(fine, answers, curve, NODES)


def _scatters(answers: LevelAnswers, curve: Curve, place: FloatArray, apart: float) -> FloatArray:
    """Return the edges of cells of the scatter, in equal ratios but for the first, from 0.

    They hold the scatters by which answers are about as likely as these are of the curve at a
    place.
    """
    p = curve.share_correct(answers.at, list(place))
    off = (answers.correct - answers.trials * p) ** 2 / (answers.trials * p * (1 - p))
    least, most = MISFITS
    high = np.sqrt(most * max(float(off.mean()), 1.0) / answers.trials.mean())
    high = min(high, MOST_SCATTER)
    low = min(np.sqrt((least - 1) / answers.trials.max()), high / 2)
    number = 1 + math.ceil(math.log(high / low) / math.log(apart))
    return np.append(0.0, np.geomspace(low, high, number))


def _scale(answers: LevelAnswers, edges: FloatArray) -> FloatArray:
    """Return how many times as long as without a scatter intervals are by it."""
    return np.asarray(np.sqrt(1 + (answers.trials.mean() - 1) * edges[1:] ** 2))
