"""Deterministic integration over a few parameters, such as variance components."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from scipy.special import gammaincinv, logsumexp, ndtr, ndtri

from analysis.estimates import FloatArray, Interval, NotEstimable

# Maps points of shape (count, dimensions) to log densities of shape (count,).
LogDensity: TypeAlias = Callable[[FloatArray], FloatArray]

PROPOSAL_DF = 5.0
PILOT, LEAST_EFFECTIVE = 100, 200.0
REACH, STEEPNESS = 6.0, 20.0
CURVATURE_STEP = 0.2
MODE_STEPS, MODE_RISE, LONGEST_STEP = 30, 0.05, 1.0
# Limits to which the curvature of a direction at the mode is clipped.
LEAST_CURVATURE, MOST_CURVATURE = 0.1, 1e8
QUANTILE_STEPS, QUANTILE_TOLERANCE = 60, 1e-9
# Quantiles that are sought together, until all of them are found; their arrays fit into the cache.
AT_ONCE = 64
# A smaller skewness is taken for this one, for which the distribution still can be computed.
LEAST_SKEW = 1e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class WeightedPoints:
    """A discretised posterior: points (count, dimensions) and weights that sum to 1.

    It represents the density if at least `least` points are effective.
    """

    points: FloatArray
    weights: FloatArray
    least: float

    @property
    def effective(self) -> float:
        """Effective sample size: the number of equally weighted points that tell as much."""
        return float(1 / (self.weights**2).sum())

    @property
    def refusal(self) -> NotEstimable | None:
        """Why the points do not represent the density, or None if they do."""
        if self.effective >= self.least:
            return None
        return NotEstimable(
            "the integration over the differences between people reached "
            f"{self.effective:.0f} effective points, and intervals need at least "
            f"{self.least:.0f}"
        )

    def mean(self, values: FloatArray) -> FloatArray:
        """Return the posterior mean of values at the points, along the first axis."""
        return np.asarray(np.tensordot(self.weights, values, axes=1), dtype=np.float64)

    def interval_95(self, values: FloatArray) -> Interval:
        """Return the central 95% interval of values at the points."""
        low, high = (weighted_quantile(self.weights, values, p) for p in (0.025, 0.975))
        return low, high


def weighted_points(
    log_density: LogDensity, start: FloatArray, count: int, least: float | None = None
) -> WeightedPoints:
    """Return at least `count` weighted points that represent the density.

    Importance sampling from a t distribution with 5 degrees of freedom, first about the mode and
    scaled by the curvature there, then with the mean and covariance of the points so far, until
    the effective sample size is at least `least` (None for 200) or four times as many points do not
    reach it. The points are those of an additive low-discrepancy sequence instead of random ones,
    so that the same input gives the same result.
    """
    least = LEAST_EFFECTIVE if least is None else least
    log_density = _within_reach(log_density)
    centre, spread = mode_of(log_density, start)
    for number in (PILOT, count, 2 * count, 4 * count):
        points, log_proposal = _t_points(centre, spread, number)
        log_weights = log_density(points) - log_proposal
        weights = np.exp(log_weights - logsumexp(log_weights))
        found = WeightedPoints(points=points, weights=weights, least=least)
        if number >= count and found.effective >= least:
            break
        centre, spread = _adapted(found, spread)
    return replace(found, points=np.clip(points, -REACH, REACH))


def _adapted(found: WeightedPoints, spread: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return mean and spread of the points; few effective ones change the spread little."""
    mean = found.mean(found.points)
    away = found.points - mean
    size, known = len(mean), found.effective
    covariance = known * (found.weights * away.T) @ away + size * spread @ spread.T
    return mean, np.asarray(np.linalg.cholesky(covariance / (known + size)), dtype=np.float64)


def _within_reach(log_density: LogDensity) -> LogDensity:
    # Densities may overflow far out: beyond REACH, the value at the boundary falls off steeply.
    def bounded(points: FloatArray) -> FloatArray:
        inside = np.clip(points, -REACH, REACH)
        return np.asarray(log_density(inside) - STEEPNESS * ((points - inside) ** 2).sum(axis=1))

    return bounded


def low_discrepancy(count: int, dimensions: int) -> FloatArray:
    """Return evenly spread points in the unit cube, shape (count, dimensions).

    Multiples, modulo 1, of the powers of the root of g^(d+1) = g + 1.
    """
    root = 2.0
    for _ in range(60):
        root = (1 + root) ** (1 / (dimensions + 1))
    steps = root ** -np.arange(1.0, dimensions + 1)
    return np.asarray((0.5 + np.arange(1.0, count + 1)[:, None] * steps) % 1.0)


def mode_of(log_density: LogDensity, start: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the mode, and a matrix whose columns are uncorrelated steps of one SD there.

    Found by Newton's method with differences over steps so long that small errors of the density
    do not matter; the mode need not be exact, as the points adapt.
    """
    mode = start
    for _ in range(MODE_STEPS):
        gradient, spread = _parabola(log_density, mode)
        step = spread @ (spread.T @ gradient)
        mode = mode + step / max(1.0, float(np.abs(step).max()) / LONGEST_STEP)
        if gradient @ step < MODE_RISE:
            break
    return mode, spread


def _parabola(log_density: LogDensity, centre: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the gradient and the spread of the parabola through values about the centre."""
    size = len(centre)
    first, second = np.triu_indices(size, 1)
    axes = np.eye(size) * CURVATURE_STEP
    steps = np.vstack([axes, axes[first] + axes[second]])
    values = log_density(centre + np.vstack([np.zeros(size), steps, -steps]))
    # Second differences along each axis and each diagonal.
    ahead, behind = np.split(values[1:], 2)
    falls = (2 * values[0] - ahead - behind) / CURVATURE_STEP**2
    curvature = np.diag(falls[:size])
    curvature[first, second] = (falls[size:] - falls[first] - falls[second]) / 2
    curvature[second, first] = curvature[first, second]
    eigenvalues, vectors = np.linalg.eigh(curvature)
    spread = vectors / np.sqrt(np.clip(eigenvalues, LEAST_CURVATURE, MOST_CURVATURE))
    return (ahead - behind)[:size] / (2 * CURVATURE_STEP), np.asarray(spread)


def _t_points(mode: FloatArray, spread: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    size = len(mode)
    cube = low_discrepancy(count, size + 1)
    normal = ndtri(cube[:, :size])
    chi_square = 2 * np.asarray(gammaincinv(PROPOSAL_DF / 2, cube[:, size]))
    scaled = normal * np.sqrt(PROPOSAL_DF / chi_square)[:, None]
    log_proposal = -(PROPOSAL_DF + size) / 2 * np.log1p((scaled**2).sum(axis=1) / PROPOSAL_DF)
    return mode + scaled @ spread.T, log_proposal


@dataclass(frozen=True, kw_only=True, eq=False)
class Marginals:
    """Mean, SD and skewness of quantities at each weighted point, shape (points, quantities).

    Without skewness the quantities are normal.
    """

    means: FloatArray
    sds: FloatArray
    skews: FloatArray | None = None

    def plus(self, constant: float | FloatArray) -> "Marginals":
        """Return the marginals of the quantities plus a constant, or one per point (points, 1)."""
        return replace(self, means=self.means + constant)

    def over(self, divisors: FloatArray) -> "Marginals":
        """Return the marginals of the quantities over a positive number per point."""
        return replace(self, means=self.means / divisors[:, None], sds=self.sds / divisors[:, None])

    def part(self, quantities: slice) -> "Marginals":
        """Return the marginals of some of the quantities."""
        return Marginals(
            means=self.means[:, quantities],
            sds=self.sds[:, quantities],
            skews=None if self.skews is None else self.skews[:, quantities],
        )

    def interval_95(self, weights: FloatArray) -> list[Interval]:
        """Return the central 95% interval of each quantity over all points."""
        return intervals_95(weights, self.means, self.sds, self.skews)

    def quantile(self, weights: FloatArray, probability: float) -> FloatArray:
        """Return the quantile of each quantity over all points."""
        return mixture_quantile(weights, self.means, self.sds, probability, self.skews)

    def above_zero(self, weights: FloatArray) -> FloatArray:
        """Return the probability that each quantity is positive."""
        score, _ = _normal_scores(self.means, self.sds, self.skews)(np.zeros(1))
        return np.asarray(weights @ ndtr(-score))


def mixture_quantile(
    weights: FloatArray,
    means: FloatArray,
    sds: FloatArray,
    probability: float,
    skews: FloatArray | None = None,
) -> FloatArray:
    """Return the quantile of each mixture of normal or of shifted log-normal distributions.

    It is found by Newton's method, within an interval that shrinks by bisection where that fails.

    Parameters:
        weights: shape (points,), sum 1.
        means, sds, skews: shape (points, quantities).
        probability: in (0, 1).
    """
    parts = [slice(first, first + AT_ONCE) for first in range(0, means.shape[1], AT_ONCE)]
    found = [
        _quantile(
            weights,
            means[:, part],
            sds[:, part],
            probability,
            None if skews is None else skews[:, part],
        )
        for part in parts
    ]
    return np.concatenate([np.zeros(0), *found])


def _quantile(
    weights: FloatArray,
    means: FloatArray,
    sds: FloatArray,
    probability: float,
    skews: FloatArray | None,
) -> FloatArray:
    low, high = (means - 9 * sds).min(axis=0), (means + 9 * sds).max(axis=0)
    centre = weights @ means
    sd = np.sqrt(weights @ (sds**2 + (means - centre) ** 2))
    value = np.clip(centre + sd * ndtri(probability), low, high)
    normal_of = _normal_scores(means, sds, skews)
    for _ in range(QUANTILE_STEPS):
        score, slope = normal_of(value)
        excess = weights @ ndtr(score) - probability
        if (np.abs(excess) < QUANTILE_TOLERANCE).all():
            break
        low, high = np.where(excess < 0, value, low), np.where(excess < 0, high, value)
        density = weights @ (np.exp(-(score**2) / 2) * slope) / np.sqrt(2 * np.pi)
        step = value - excess / np.maximum(density, 1e-300)
        value = np.where((step > low) & (step < high), step, (low + high) / 2)
    return np.asarray(value)


def _normal_scores(
    means: FloatArray, sds: FloatArray, skews: FloatArray | None
) -> Callable[[FloatArray], tuple[FloatArray, FloatArray]]:
    """Return the function that maps values to standard normal scores, and their slopes."""
    if skews is None:
        return lambda value: ((value - means) / sds, 1 / sds)
    # A shifted log-normal variable (exp(s y - s²/2) - 1) / k, k² = exp(s²) - 1, has the skewness
    # k³ + 3k.
    skewed = np.where(np.abs(skews) < LEAST_SKEW, LEAST_SKEW, skews)
    k = 2 * np.sinh(np.arcsinh(skewed / 2) / 3)
    s = np.sign(k) * np.sqrt(np.log1p(k * k))
    gradient, offset = k / sds, 1 - k * means / sds

    def scores(value: FloatArray) -> tuple[FloatArray, FloatArray]:
        inside = np.maximum(gradient * value + offset, 1e-300)
        return np.log(inside) / s + s / 2, gradient / (s * inside)

    return scores


def intervals_95(
    weights: FloatArray, means: FloatArray, sds: FloatArray, skews: FloatArray | None = None
) -> list[Interval]:
    """Return the central 95% interval of each mixture."""
    low = mixture_quantile(weights, means, sds, 0.025, skews)
    high = mixture_quantile(weights, means, sds, 0.975, skews)
    return list(zip(low.tolist(), high.tolist(), strict=True))


def weighted_quantile(weights: FloatArray, values: FloatArray, probability: float) -> float:
    """Return the interpolated quantile of values at weighted points."""
    order = np.argsort(values)
    reached = np.cumsum(weights[order]) - weights[order] / 2
    return float(np.interp(probability, reached, values[order]))
