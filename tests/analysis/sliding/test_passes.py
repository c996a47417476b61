"""Passes by place: bins, groups of repeated passes, and their mean curve."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.sliding.rig_model import BIN_M, Pass, binned_pass, grouped, mean_curve


def made(speed_m_s: float = 0.01, mu: float = 0.4, **changed: object) -> Pass:
    t_s = 1e-3 * np.arange(2000, dtype=np.float64)
    one = Pass(
        voltage_v=100.0,
        frequency_hz=24_000.0,
        direction="right",
        load_n=0.56,
        contact_m=0.01,
        t_s=5 + t_s,
        x_m=0.02 + speed_m_s * t_s,
        mu=np.full(t_s.size, mu) + t_s,
    )
    return replace(one, **changed)  # type: ignore[arg-type]


def test_bins_hold_means_of_place_time_and_friction() -> None:
    one = binned_pass(made())
    assert one.x_m.size == 40
    assert one.count == pytest.approx(np.full(40, 50.0))
    assert one.x_m == pytest.approx(0.02 + BIN_M * (np.arange(40) + 0.5) - 5e-6)
    assert one.t_s == pytest.approx((one.x_m - 0.02) / 0.01)
    assert one.mu == pytest.approx(0.4 + one.t_s)
    assert one.setting.speed_m_s == pytest.approx(0.01)
    assert one.spacing_s == pytest.approx(1e-3)


def test_the_speed_of_a_pass_to_the_left_is_positive() -> None:
    right = made()
    left = binned_pass(replace(right, x_m=right.x_m[::-1], direction="left"))
    assert left.setting.speed_m_s == pytest.approx(0.01)
    assert left.t_s[0] > left.t_s[-1]


def test_bins_at_the_ends_with_few_samples_are_left_out() -> None:
    x_m = made().x_m.copy()
    x_m[0], x_m[-1] = 0.015, 0.045
    one = binned_pass(made(x_m=x_m))
    assert one.x_m.min() > 0.0199
    assert one.x_m.max() < 0.0401


def test_a_block_that_did_not_move_is_refused() -> None:
    with pytest.raises(ValueError, match="must move by more than 1 mm, got 2000 samples"):
        binned_pass(made(speed_m_s=1e-4))


def test_repeated_passes_share_a_curve_unless_drive_direction_or_speed_differ() -> None:
    binned = [
        binned_pass(made()),
        binned_pass(made(speed_m_s=0.011)),
        binned_pass(made(speed_m_s=0.02)),
        binned_pass(made(frequency_hz=24_100.0)),
        binned_pass(made(direction="left")),
    ]
    groups = grouped(binned)
    assert sorted(len(group) for _, group in groups) == [1, 1, 1, 2]
    assert sum(len(group) for _, group in groups) == len(binned)


def test_a_mean_curve_weights_passes_by_their_variance() -> None:
    binned = [binned_pass(made(mu=0.4)), binned_pass(made(mu=0.5))]
    [group] = grouped(binned)
    low, high = (np.full(40, variance) for variance in (1e-4, 3e-4))
    curve = mean_curve(group, [low, high])
    assert curve.passes == 2
    assert curve.mu == pytest.approx(0.425 + binned[0].t_s)
    assert curve.error == pytest.approx(np.full(40, (1e4 + 1e4 / 3) ** -0.5))
