"""The noise of a pass: its covariance, and recovery of jitter and its correlation time."""

import numpy as np
import pytest
from scipy.signal import lfilter

from analysis.sliding.rig_model import (
    DRIFT_N_PER_S,
    ZERO_N,
    BinnedPass,
    Noise,
    Pass,
    binned_pass,
    fitted_noise,
    whitened,
)

LOAD_N = 0.56


def noisy(seed: int, jitter: float = 0.05, correlation_s: float = 0.02) -> BinnedPass:
    draw = np.random.default_rng(seed)
    count = 8000
    decay = np.exp(-1e-3 / correlation_s)
    steps = draw.normal(0, jitter * np.sqrt(1 - decay**2), count)
    stuck = lfilter([1.0], [1.0, -decay], steps, zi=[decay * jitter * draw.normal()])[0]
    t_s = 1e-3 * np.arange(count, dtype=np.float64)
    made = Pass(
        voltage_v=0.0,
        frequency_hz=24_000.0,
        direction="right",
        load_n=LOAD_N,
        contact_m=0.01,
        t_s=t_s,
        x_m=0.01 + 0.009 * t_s,
        mu=0.4 * (1 + stuck) + draw.normal(0, 0.02, count),
    )
    return binned_pass(made)


def test_the_covariance_is_that_of_bins_of_correlated_jitter() -> None:
    binned = [noisy(seed) for seed in range(300)]
    one = binned[0]
    middle = slice(20, 50)
    seen = np.cov(np.array([each.mu for each in binned])[:, middle], rowvar=False)
    due = Noise(jitter=0.05, correlation_s=0.02, sensor=0.02).covariance(
        one, np.full(one.mu.size, 0.4)
    )[middle, middle]
    due = due - (ZERO_N / LOAD_N) ** 2
    due -= (DRIFT_N_PER_S / LOAD_N) ** 2 * np.outer(one.t_s, one.t_s)[middle, middle]
    for apart in range(3):
        lag = np.diagonal(seen, apart).mean()
        assert lag == pytest.approx(np.diagonal(due, apart).mean(), abs=0.05 * due[0, 0])


def test_whitened_noise_is_independent() -> None:
    noise = Noise(jitter=0.05, correlation_s=0.02, sensor=0.02)
    binned = [noisy(seed) for seed in range(60)]
    white = np.array(
        [whitened(noise.factor(one, np.full(one.mu.size, 0.4)), one.mu - 0.4) for one in binned]
    )
    assert white.std() == pytest.approx(1, abs=0.03)
    neighbours = np.mean(white[:, 1:] * white[:, :-1])
    assert neighbours == pytest.approx(0, abs=0.03)


@pytest.mark.parametrize(("jitter", "correlation_s"), [(0.05, 0.02), (0.1, 0.05)])
def test_jitter_and_its_correlation_are_recovered(jitter: float, correlation_s: float) -> None:
    binned = [noisy(seed, jitter, correlation_s) for seed in range(8)]
    found = fitted_noise(binned, [np.full(one.mu.size, 0.4) for one in binned])
    # A mean over a long time depends on this product alone.
    power = found.jitter**2 * found.correlation_s
    assert power == pytest.approx(jitter**2 * correlation_s, rel=0.25)


def test_what_a_mean_leaves_unexplained_counts_as_noise() -> None:
    binned = [noisy(seed) for seed in range(4)]
    wrong = [0.4 + 0.1 * np.sin(one.x_m / 0.003) for one in binned]
    found = fitted_noise(binned, wrong)
    assert found.jitter**2 * found.correlation_s > 4 * 0.05**2 * 0.02
