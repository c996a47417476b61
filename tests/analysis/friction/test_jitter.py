"""Jitter of friction: autocovariances of blocks, and the variance of averages of them."""

import numpy as np
import pytest

from analysis.estimates import FloatArray, NotEstimable
from analysis.friction.recorded import Jitter, TouchForces, jitter_of


def touch(tangential_n: FloatArray, noise_n2: float = 0.0) -> TouchForces:
    """A touch of blocks of 25 ms at one place with a normal force of 1 N."""
    one = np.ones(len(tangential_n))
    return TouchForces(
        t_s=np.linspace(0.0125, 0.025 * len(one) - 0.0125, len(one)),
        position_m=0.04 * one,
        tangential_n=tangential_n,
        normal_n=one,
        vector_n=np.hypot(tangential_n, one),
        moved_s=0.025 * len(one),
        noise_n2=noise_n2,
        tare_n2=0.0,
        zero_n=0.0,
        zero_s=0.0,
        touched_s=3.0,
        stick_slip=0.0,
        saturated=0,
    )


def jittering(count: int, rng: np.random.Generator) -> list[TouchForces]:
    """Touches of 2 s at levels of their own, jitter .05 · moving average (1, .5) / √1.25."""
    touches = []
    for _ in range(count):
        steps = rng.normal(0, 0.05 / np.sqrt(1.25), 81)
        touches.append(touch(rng.uniform(0.2, 0.4) * np.exp(steps[1:] + 0.5 * steps[:-1])))
    return touches


def test_autocovariances_are_recovered_from_short_touches() -> None:
    found = jitter_of(jittering(300, np.random.default_rng(1)))
    assert isinstance(found, Jitter)
    expected = 0.0025 * np.array([1.0, 0.4, 0.0, 0.0])
    assert found.autocovariances[:4] == pytest.approx(expected, abs=1e-4)


def test_the_variance_of_a_mean_counts_the_autocorrelation() -> None:
    rng = np.random.default_rng(2)
    found = jitter_of(jittering(300, rng))
    assert isinstance(found, Jitter)
    means = [(it.friction - np.log(np.median(it.tangential_n))).mean() for it in jittering(1, rng)]
    weights = np.full((1, 80), 1 / 80)
    assert len(means) == 1
    expected = 0.0025 * (1 + 2 * 0.4 * 79 / 80) / 80
    assert found.covariance(weights, np.zeros(80))[0, 0] == pytest.approx(expected, rel=0.1)


def test_noise_is_not_counted_as_jitter() -> None:
    rng = np.random.default_rng(3)
    noisy = [touch(0.2 + rng.normal(0, 0.002, 80), noise_n2=4e-6) for _ in range(50)]
    found = jitter_of(noisy)
    assert isinstance(found, Jitter)
    assert found.autocovariances[0] < 1e-5
    weights = np.full((1, 80), 1 / 80)
    variance = found.covariance(weights, np.full(80, 1e-4))[0, 0]
    assert variance == pytest.approx(1e-4 / 80, rel=0.2)


def test_a_covariance_has_no_negative_variance() -> None:
    # Touches that swing in the opposite way from block to block: means are known very well.
    swing = touch(0.3 * np.exp(0.05 * (-1.0) ** np.arange(80)))
    found = jitter_of([swing])
    assert isinstance(found, Jitter)
    assert np.linalg.eigvalsh(found.covariance(np.eye(200), np.zeros(200))).min() > 0


def test_a_few_blocks_show_no_jitter() -> None:
    assert isinstance(jitter_of([touch(np.full(20, 0.2))]), NotEstimable)
    assert isinstance(jitter_of([]), NotEstimable)
