"""Means and intervals of a mixture of normal distributions."""

from typing import TypeAlias

import numpy as np
from scipy.special import ndtr

from analysis.scores import FloatArray

Interval: TypeAlias = tuple[float, float]

BISECTIONS = 36


def mixture_mean(weights: FloatArray, means: FloatArray) -> FloatArray:
    """Return the mean of each mixture; weights (points,), means (points, quantities)."""
    return np.asarray(weights @ means)


def mixture_quantile(
    weights: FloatArray, means: FloatArray, sds: FloatArray, probability: float
) -> FloatArray:
    """Return the quantile of each mixture by bisection.

    Parameters:
        weights: shape (points,), sum 1.
        means: shape (points, quantities).
        sds: shape (points, quantities), standard deviations.
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
    """Return the quantile of one quantity known at weighted points, interpolated."""
    order = np.argsort(values)
    reached = np.cumsum(weights[order]) - weights[order] / 2
    return float(np.interp(probability, reached, values[order]))
