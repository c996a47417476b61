"""Precision of a sensitivity: Student's t against scipy, the laws, and recovery by simulation."""

from math import inf, isinf

import numpy as np
import pytest
from scipy.stats import t

from protocol.alternatives import Alternative
from protocol.precision import RESIDUAL_SD, half_width, purchases, squared_spread, t_quantile


@pytest.mark.parametrize("df", [1, 2, 3, 4, 5, 7, 18, 31, 200])
def test_quantiles_of_t(df: int) -> None:
    assert t_quantile(0.975, df) == pytest.approx(float(t.ppf(0.975, df)), rel=1e-9)


def test_spreading_contrasts_is_worth_four_times_the_repetitions() -> None:
    contrasts = [0.1, 0.2, 0.3, 0.4] * 50
    wide = [2 * contrast for contrast in contrasts]
    narrow, spread = (half_width(squared_spread(x), 200) for x in (contrasts * 4, wide))
    assert narrow == pytest.approx(spread)


def test_the_interval_holds_the_true_gain_as_often_as_it_says() -> None:
    rng = np.random.default_rng(1)
    x = np.linspace(0, 0.6, 20)
    y = 3 + 5 * x + rng.normal(0, RESIDUAL_SD, (4_000, 20))
    slopes = (y - y.mean(axis=1, keepdims=True)) @ (x - x.mean()) / squared_spread(list(x))
    width = half_width(squared_spread(list(x)), 20)
    by_normal = width / t_quantile(0.975, 18) * 1.959964
    assert np.mean(np.abs(slopes - 5) < by_normal) == pytest.approx(0.95, abs=0.01)


def test_longer_sessions_buy_narrower_intervals() -> None:
    sessions = [
        Alternative(repeats=n, duration_s=100 + 200 * n, whole=True) for n in (1, 2, 4, 5, 8, 16)
    ]
    bought = purchases([0.1, 0.2, 0.3, 0.4] * 5, 4, sessions)
    assert [b.repeats for b in bought] == [1, 2, 4, 5, 8, 16]
    assert [b.duration_s for b in bought][2] == 900
    widths = [b.half_width for b in bought]
    assert widths == sorted(widths, reverse=True)
    assert bought[2].trials == 20


def test_contrasts_that_do_not_differ_tell_nothing() -> None:
    bought = purchases([0.3] * 5, 1, [Alternative(repeats=1, duration_s=60, whole=True)])
    assert all(isinf(b.half_width) and b.relative == inf for b in bought)
    assert half_width(1.0, 2) == inf
