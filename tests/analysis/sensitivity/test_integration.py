"""Deterministic integration of known densities."""

import numpy as np
import pytest
from scipy import stats
from scipy.stats import qmc

from analysis.estimates import FloatArray
from analysis.sensitivity.integration import (
    REACH,
    Marginals,
    low_discrepancy,
    weighted_points,
    weighted_quantiles,
)


def test_a_correlated_normal_is_integrated() -> None:
    covariance = np.array([[1.0, 0.6, 0.0], [0.6, 0.5, 0.1], [0.0, 0.1, 2.0]])
    normal = stats.multivariate_normal(np.array([1.0, -2.0, 0.5]), covariance)
    found, _ = next(
        weighted_points(lambda points: np.atleast_1d(normal.logpdf(points)), np.zeros(3), 400)
    )
    mean = found.mean(found.points)
    spread = found.mean((found.points - mean)[:, :, None] * (found.points - mean)[:, None, :])
    assert mean == pytest.approx([1.0, -2.0, 0.5], abs=0.05)
    assert spread == pytest.approx(covariance, abs=0.15)


def test_a_skewed_density_is_integrated() -> None:
    # log of a gamma variable: mean digamma(3), the long tail to the left.
    def log_density(points: FloatArray) -> FloatArray:
        return np.asarray(3 * points[:, 0] - np.exp(points[:, 0]))

    found, _ = next(weighted_points(log_density, np.zeros(1), 200))
    assert found.mean(found.points)[0] == pytest.approx(0.92278, abs=0.01)
    assert found.mean(np.exp(found.points))[0] == pytest.approx(3.0, abs=0.03)


def test_points_fill_the_cube_evenly() -> None:
    chance = qmc.discrepancy(np.random.default_rng(1).random((512, 4)))
    assert qmc.discrepancy(low_discrepancy(512, 4)) < 0.4 * chance


def test_the_same_density_gives_the_same_points() -> None:
    def log_density(points: FloatArray) -> FloatArray:
        return np.asarray(-(points**2).sum(axis=1))

    one, two = (next(weighted_points(log_density, np.ones(2), 32))[0] for _ in range(2))
    assert one.points.tobytes() == two.points.tobytes()


def test_quantiles_of_a_mixture() -> None:
    weights = np.array([0.3, 0.7])
    means, sds = np.array([[0.0, 5.0], [4.0, 5.0]]), np.array([[1.0, 2.0], [0.5, 2.0]])
    (quantile,) = Marginals(means=means, sds=sds).quantiles(weights, 0.25)
    reached = 0.3 * stats.norm.cdf(quantile[0]) + 0.7 * stats.norm.cdf(quantile[0], 4.0, 0.5)
    assert reached == pytest.approx(0.25, abs=1e-8)
    assert Marginals(means=means, sds=sds).interval_95(weights)[1] == pytest.approx(
        (5 - 3.919928, 5 + 3.919928), abs=1e-5
    )


def test_the_median_of_weighted_values() -> None:
    values = np.array([3.0, 1.0, 2.0])
    assert weighted_quantiles(np.array([0.25, 0.25, 0.5]), values, 0.5) == [2.0]


def test_an_unbounded_density_is_evaluated_within_reach_only() -> None:
    asked = [0.0]

    def rising(points: FloatArray) -> FloatArray:
        asked.append(float(np.abs(points).max()))
        return np.asarray(5.0 * points[:, 0] - points[:, 1] ** 2)

    found, _ = next(weighted_points(rising, np.zeros(2), 50))
    assert max(asked) <= REACH
    assert np.abs(found.points).max() <= REACH
    assert found.mean(found.points)[0] > REACH - 1


def test_points_of_which_one_has_all_the_weight_are_refused_before_anything_is_made_of_them() -> (
    None
):
    """Their covariance is singular, and one half of them has no weight at all."""

    def spike(points: FloatArray) -> FloatArray:
        return np.where(np.arange(len(points)) == len(points) // 3, 1e4, 0.0)

    found, _ = next(weighted_points(spike, np.zeros(2), 50))
    refusal = found.refusal()
    assert refusal is not None
    assert refusal.reason.endswith(
        "reached fewer than 20 effective points, and intervals need at least 200"
    )
