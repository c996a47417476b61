"""The posterior of a psychometric function on a grid around its mode."""

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from analysis.estimates import BoolArray, FloatArray
from analysis.thresholds.answer_curve import MOST_RATE, Cells, Curve, LevelAnswers, log_density
from analysis.thresholds.curve_mode import highest_density

COARSE: Final = (13, 11, 7, 5)
FINE: Final = (36, 30, 14, 1), (22, 18, 7, 7)
"""Cells for threshold, log width, lapse rate and guess rate; the second where the last is free."""
NEGLIGIBLE = 12.0
"""Cells whose log density lies so far below the highest are left out."""
REACH = 6.0
"""Standard deviations from the mode to the ends of the first box."""
LONGER = 0.3
"""So much of itself an axis grows at an end where the density is not negligible."""
SAME_BOX = 0.8
"""A box whose axes keep more than this share of themselves is as small as it becomes."""
MOST_PASSES = 12
ENOUGH = 30.0
"""Cells that share the mass: from fewer, mean and covariance are not known."""
RATES = (2, 3)
EDGES = 1001
"""Places at which the distribution of a parameter is computed."""


@dataclass(frozen=True)
class Posterior:
    """The posterior's mass in cells: threshold, log width, lapse and guess rate.

    `middles` has shape (4, cells), without negligible ones, and `sizes` is how far a cell reaches
    along each parameter; `mode` is where the density of threshold, width and rates is highest.
    """

    middles: FloatArray
    sizes: FloatArray
    mass: FloatArray
    mode: tuple[float, ...]

    def quantiles(self, axis: int, parts: FloatArray) -> FloatArray:
        """Return the quantiles of one parameter: (6), a cell's mass spread evenly along it."""
        if not (size := self.sizes[axis]):
            return np.full(np.shape(parts), self.mode[axis])
        order = np.argsort(self.middles[axis], kind="stable")
        middles, mass = self.middles[axis][order], self.mass[order]
        below, moment = (np.append(0.0, np.cumsum(sums)) for sums in (mass, mass * middles))

        def summed(places: FloatArray) -> FloatArray:
            """Return the integral of the mass of the middles below each place."""
            count = np.searchsorted(middles, places)
            return np.asarray(places * below[count] - moment[count])

        def share(places: FloatArray) -> FloatArray:
            """Return how much of the mass lies below each place."""
            within = summed(places + size / 2) - summed(places - size / 2)
            return np.asarray(within / size)

        edges = np.linspace(middles[0] - size / 2, middles[-1] + size / 2, EDGES)
        if axis not in RATES:
            return np.asarray(np.interp(parts, share(edges), edges))
        # No rate is below 0: what was spread there belongs above it.
        edges = np.maximum(edges, 0.0)
        return np.asarray(np.interp(parts, share(edges) - share(-edges), edges))

    def draws(self, number: int, rng: np.random.Generator) -> FloatArray:
        """Return draws of the four parameters, shape (4, number): the middles of cells."""
        below = np.cumsum(self.mass)
        return self.middles[:, np.searchsorted(below, rng.random(number) * below[-1])]


class _Grid(NamedTuple):
    """A box along the axes of a covariance, which many answers make narrow and oblique.

    `factor` is the covariance's lower triangular one: a parameter's axis is standard normal for
    given values of those before it. Rates end at their limits, wherever the box does.
    """

    centre: FloatArray
    factor: FloatArray
    low: FloatArray
    high: FloatArray
    free: BoolArray

    def lattice(self, cells: Cells) -> "_Lattice":
        """Return the cells of the grid."""
        parameters: list[FloatArray] = []
        places: list[FloatArray] = []
        sizes: list[FloatArray] = []
        volume = np.ones((1, 1, 1, 1))
        for axis, number in enumerate(cells):
            before = zip(self.factor[axis], places, strict=False)
            middle = self.centre[axis] + sum((by * place for by, place in before), 0 * volume)
            own = self.factor[axis, axis] * self.free[axis]
            start, end = middle + own * self.low[axis], middle + own * self.high[axis]
            if axis in RATES:
                start, end = np.clip(start, 0.0, MOST_RATE), np.clip(end, 0.0, MOST_RATE)
            size = (end - start) / number
            along = np.arange(number).reshape([-1 if one == axis else 1 for one in range(4)])
            parameters.append(start + size * (along + 0.5))
            places.append((parameters[axis] - middle) / self.factor[axis, axis])
            sizes.append(size / self.factor[axis, axis])
            volume = volume * (size if own else 1)
        return _Lattice(parameters, places, sizes, volume)


class _Lattice(NamedTuple):
    """Middles of cells: the four parameters, and places and sizes along the axes of the grid."""

    parameters: list[FloatArray]
    places: list[FloatArray]
    sizes: list[FloatArray]
    volume: FloatArray

    def log_mass(self, answers: LevelAnswers, curve: Curve) -> FloatArray:
        """Return the logarithm of the cells' mass, relative to the highest."""
        with np.errstate(divide="ignore"):
            # Cells are equal in the width's logarithm, of which the density is not.
            log_size = np.log(self.volume) + self.parameters[1]
        found = log_density(self.parameters, answers, curve) + log_size
        return np.asarray(found - found.max())

    @staticmethod
    def some(arrays: list[FloatArray], kept: BoolArray) -> FloatArray:
        """Return what the kept cells have, shape (4, cells)."""
        return np.array([np.broadcast_to(values, kept.shape)[kept] for values in arrays])


def posterior(answers: LevelAnswers, curve: Curve) -> Posterior:
    """Return the posterior on the smallest grid that holds all of it but a negligible part."""
    limits = np.array(answers.limits)
    free = limits[:, 0] < limits[:, 1]
    coarse, fine = (
        tuple(np.where(free, cells, 1).tolist()) for cells in (COARSE, FINE[int(free.all())])
    )
    mode = highest_density(answers, curve, coarse)
    # From the midpoint to the threshold.
    above = curve.below * np.exp(mode.place[1])
    turned = np.eye(4)
    turned[0, 1] = above
    place = mode.place + np.array([above, 0, 0, 0])
    factor = np.asarray(np.linalg.cholesky(turned @ mode.covariance @ turned.T), dtype=np.float64)
    ends: FloatArray = np.full(4, REACH)
    grid = _Grid(place, factor, -ends, ends, free)
    for _ in range(MOST_PASSES):
        lattice = grid.lattice(coarse)
        before, (grid, cut) = grid, _closer(grid, lattice, lattice.log_mass(answers, curve))
        old, new = ((np.diag(one.factor) * (one.high - one.low))[free] for one in (before, grid))
        if not cut and (abs(new - old) <= (1 - SAME_BOX) * old).all():
            break
    lattice = grid.lattice(fine)
    log_mass = lattice.log_mass(answers, curve)
    kept = log_mass > -NEGLIGIBLE
    mass = np.exp(log_mass[kept])
    reach = grid.factor * ((grid.high - grid.low) * free / fine)
    return Posterior(
        lattice.some(lattice.parameters, kept),
        np.sqrt((reach**2).sum(axis=1)),
        mass / mass.sum(),
        tuple(place.tolist()),
    )


def _closer(grid: _Grid, lattice: _Lattice, log_mass: FloatArray) -> tuple[_Grid, bool]:
    """Return a grid along the mass without negligible cells, and whether the box cut some off.

    One cell is left around the others. Where none is negligible up to the end of an axis, the box
    becomes longer there.
    """
    kept = log_mass > -NEGLIGIBLE
    points, places, sizes = (lattice.some(arrays, kept) for arrays in lattice[:3])
    near = 1e-6 * (grid.high - grid.low)
    cut_low = ((places - sizes / 2).min(axis=1) < grid.low + near) & grid.free
    cut_high = ((places + sizes / 2).max(axis=1) > grid.high - near) & grid.free
    mass = np.exp(log_mass[kept])
    mass /= mass.sum()
    centre, factor = grid.centre, grid.factor
    if 1 / (mass @ mass) > ENOUGH:
        # The curvature at the mode is not that of a bent ridge, or of a plateau.
        centre = np.where(grid.free, points @ mass, centre)
        off = points - centre[:, None]
        within = factor * np.sqrt(sizes**2 @ mass / 12)
        covariance = (off * mass) @ off.T + within @ within.T
        both = grid.free & grid.free[:, None]
        factor = np.linalg.cholesky(np.where(both, covariance, np.eye(4)))
    there = np.linalg.inv(factor) @ (points - centre[:, None])
    low, high = there.min(axis=1), there.max(axis=1)
    scaled = sizes.min(axis=1) * np.diag(grid.factor) / np.diag(factor)
    cell = np.maximum((high - low) / np.maximum(np.array(kept.shape) - 1, 1), scaled)
    longer = np.maximum(LONGER * (high - low), 1.5 * cell)
    low -= np.where(cut_low, longer, 1.5 * cell)
    high += np.where(cut_high, longer, 1.5 * cell)
    return _Grid(centre, factor, low, high, grid.free), bool((cut_low | cut_high).any())
