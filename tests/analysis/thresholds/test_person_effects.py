"""The cohort's threshold by a model with person effects."""

import numpy as np
import pytest

from analysis.estimates import FloatArray
from analysis.thresholds.psychometric import mixed

GRID = np.geomspace(1, 100, 161)


def known_as(log_thresholds: FloatArray, sd: float) -> FloatArray:
    """Return likelihoods of people whose log thresholds are known up to this SD."""
    return np.exp(-(((np.log(GRID) - log_thresholds[:, None]) / sd) ** 2) / 2)


def test_thresholds_that_are_known_have_their_own_mean_and_sd() -> None:
    logs = np.log(10) + 0.4 * np.random.default_rng(3).standard_normal(40)
    found = mixed(known_as(logs, 0.01), GRID)
    assert found.threshold == pytest.approx(np.exp(logs.mean()), rel=0.01)
    assert found.sd == pytest.approx(logs.std(ddof=1), rel=0.1)
    low, high = found.threshold_interval
    assert np.log(high / low) == pytest.approx(2 * 2.02 * logs.std(ddof=1) / 40**0.5, rel=0.1)


def test_who_tells_nothing_moves_nothing_and_who_tells_little_counts_less() -> None:
    logs = np.log([8.0, 9.0, 10.0, 11.0, 12.0])
    sure = known_as(logs, 0.1)
    alone = mixed(sure, GRID)
    flat = np.ones((1, GRID.size))
    # A flat person is only less likely near the ends of the grid.
    assert mixed(np.vstack([sure, flat]), GRID).threshold == pytest.approx(
        alone.threshold, rel=0.01
    )
    vague = known_as(np.log([60.0]), 1.5)
    told = mixed(np.vstack([sure, vague]), GRID)
    assert abs(np.log(told.threshold / alone.threshold)) < 0.1
    plain = np.exp(np.append(logs, np.log(60)).mean())
    assert told.threshold < plain / 1.2


def test_the_size_of_a_likelihood_does_not_matter() -> None:
    rows = known_as(np.log([8.0, 12.0, 15.0]), 0.3)
    scaled = mixed(rows * np.array([[1e-9], [1.0], [7.0]]), GRID)
    assert scaled.threshold == pytest.approx(mixed(rows, GRID).threshold)
    assert scaled.sd == pytest.approx(mixed(rows, GRID).sd)
