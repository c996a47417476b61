"""Deterministic integration over a few parameters, such as variance components."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.optimize import minimize
from scipy.special import gammaincinv, logsumexp, ndtr, ndtri

from analysis.estimates import FloatArray, Interval

# Maps points of shape (count, dimensions) to log densities of shape (count,).
LogDensity: TypeAlias = Callable[[FloatArray], FloatArray]

PROPOSAL_DF = 5.0
REACH, STEEPNESS = 6.0, 20.0
GRADIENT_STEP = 1e-3
CURVATURE_STEP = 0.1
# Limits to which the curvature of a direction at the mode is clipped.
LEAST_CURVATURE, MOST_CURVATURE = 0.1, 1e8
BISECTIONS = 36


@dataclass(frozen=True, kw_only=True, eq=False)
class WeightedPoints:
    """A discretised posterior: points (count, dimensions) and weights that sum to 1."""

    points: FloatArray
    weights: FloatArray

    def mean(self, values: FloatArray) -> FloatArray:
        """Return the posterior mean of values at the points, along the first axis."""
        return np.asarray(np.tensordot(self.weights, values, axes=1), dtype=np.float64)


def weighted_points(log_density: LogDensity, start: FloatArray, count: int) -> WeightedPoints:
    """Return `count` weighted points that represent the density.

    Importance sampling from a t distribution with 5 degrees of freedom about the mode, scaled by
    the curvature there. The points are those of an additive low-discrepancy sequence instead of
    random ones, so that the same input gives the same result.
    """
    log_density = _within_reach(log_density)
    mode = _mode(log_density, start)
    spread = _spread(log_density, mode)
    points, log_proposal = _t_points(mode, spread, count)
    log_weights = log_density(points) - log_proposal
    weights = np.exp(log_weights - logsumexp(log_weights))
    return WeightedPoints(points=np.clip(points, -REACH, REACH), weights=weights)


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


def _mode(log_density: LogDensity, start: FloatArray) -> FloatArray:
    shifts = np.vstack([np.zeros(len(start)), np.eye(len(start)) * GRADIENT_STEP])

    def cost(point: FloatArray) -> tuple[float, FloatArray]:
        values = log_density(point + shifts)
        return -float(values[0]), (values[0] - values[1:]) / GRADIENT_STEP

    found = minimize(
        cost, start, args=(), jac=True, method="BFGS", options={"gtol": 2e-2, "maxiter": 60}
    )
    return np.asarray(found.x, dtype=np.float64)


def _spread(log_density: LogDensity, mode: FloatArray) -> FloatArray:
    """Return a matrix whose columns are uncorrelated steps of one standard deviation."""
    size = len(mode)
    first, second = np.triu_indices(size, 1)
    axes = np.eye(size) * CURVATURE_STEP
    steps = np.vstack([axes, axes[first] + axes[second]])
    values = log_density(mode + np.vstack([np.zeros(size), steps, -steps]))
    # Second differences along each axis and each diagonal.
    ahead, behind = np.split(values[1:], 2)
    falls = (2 * values[0] - ahead - behind) / CURVATURE_STEP**2
    curvature = np.diag(falls[:size])
    curvature[first, second] = (falls[size:] - falls[first] - falls[second]) / 2
    curvature[second, first] = curvature[first, second]
    eigenvalues, vectors = np.linalg.eigh(curvature)
    return np.asarray(vectors / np.sqrt(np.clip(eigenvalues, LEAST_CURVATURE, MOST_CURVATURE)))


def _t_points(mode: FloatArray, spread: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    size = len(mode)
    cube = low_discrepancy(count, size + 1)
    normal = ndtri(cube[:, :size])
    chi_square = 2 * np.asarray(gammaincinv(PROPOSAL_DF / 2, cube[:, size]))
    scaled = normal * np.sqrt(PROPOSAL_DF / chi_square)[:, None]
    log_proposal = -(PROPOSAL_DF + size) / 2 * np.log1p((scaled**2).sum(axis=1) / PROPOSAL_DF)
    return mode + scaled @ spread.T, log_proposal


def mixture_quantile(
    weights: FloatArray, means: FloatArray, sds: FloatArray, probability: float
) -> FloatArray:
    """Return the quantile of each mixture of normal distributions, by bisection.

    Parameters:
        weights: shape (points,), sum 1.
        means, sds: shape (points, quantities).
        probability: in (0, 1).
    """
    low = (means - 9 * sds).min(axis=0)
    high = (means + 9 * sds).max(axis=0)
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        below = weights @ ndtr((middle - means) / sds) < probability
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.asarray((low + high) / 2)


def intervals_95(weights: FloatArray, means: FloatArray, sds: FloatArray) -> list[Interval]:
    """Return the central 95 % interval of each mixture."""
    low = mixture_quantile(weights, means, sds, 0.025)
    high = mixture_quantile(weights, means, sds, 0.975)
    return list(zip(low.tolist(), high.tolist(), strict=True))


def weighted_quantile(weights: FloatArray, values: FloatArray, probability: float) -> float:
    """Return the interpolated quantile of values at weighted points."""
    order = np.argsort(values)
    reached = np.cumsum(weights[order]) - weights[order] / 2
    return float(np.interp(probability, reached, values[order]))
