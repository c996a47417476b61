"""Troughs and peaks: their places and intervals, and a reason where there is too little swing."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.estimates import FloatArray, NotEstimable
from analysis.sliding.comparison import Kind, extremes, turning_places
from analysis.sliding.rig_model import Noise, binned_pass, grouped
from tests.analysis.sliding.rigs import PATH_M, Rig, Setting, paper_rig, passes, quiet, rig

FINE_M = np.arange(*PATH_M, 1e-5).astype(np.float64)


def true_places(own: Rig, setting: Setting, kind: Kind) -> FloatArray:
    mu = own.friction(setting, FINE_M)
    return turning_places(FINE_M, mu, kind)


def test_a_curve_turns_where_it_turns() -> None:
    x_m = np.linspace(0, 1, 101).astype(np.float64)
    wave = np.cos(4 * np.pi * x_m)
    assert turning_places(x_m, wave, "trough") == pytest.approx([0.25, 0.75])
    assert turning_places(x_m, wave, "peak") == pytest.approx([0.5])


@pytest.mark.parametrize("direction", ["right", "left"])
def test_passes_without_noise_turn_where_friction_does(direction: str) -> None:
    own = paper_rig()
    setting = Setting(
        frequency_hz=own.measured_hz, direction="left" if direction == "left" else "right"
    )
    [group] = grouped([binned_pass(one) for one in quiet(own, [setting])])
    found = extremes(group, own.true, Noise())
    assert [one.kind for one in found] in (
        ["peak", "trough"] * 4,
        ["trough", "peak"] * 4,
        (["peak", "trough"] * 4)[:7],
        (["trough", "peak"] * 4)[:7],
    )
    for one in found:
        assert isinstance(one.place_m, float)
        nearest = np.abs(true_places(own, setting, one.kind) - one.place_m).min()
        assert nearest < 5e-5
        assert one.interval_m is not None
        assert one.interval_m[0] < one.place_m < one.interval_m[1]


def test_a_shape_from_another_rig_is_moved_to_where_the_passes_turn() -> None:
    own = paper_rig()
    setting = Setting(frequency_hz=0.99 * own.measured_hz)
    wrong = replace(own.true, resonance_hz=1.01 * own.true.resonance_hz, gain=1.2)
    [group] = grouped([binned_pass(one) for one in quiet(own, [setting])])
    for one in extremes(group, wrong, Noise()):
        true_m = true_places(own, setting, one.kind)
        assert isinstance(one.place_m, float)
        nearest = np.abs(true_m - one.place_m).min()
        assert nearest < 0.1e-3
        assert nearest < 0.5 * np.abs(true_m - one.expected_m).min()


def test_intervals_of_noisy_passes_contain_the_places() -> None:
    inside = []
    for seed in range(4):
        own = rig(seed)
        plan = [Setting(frequency_hz=part * own.measured_hz) for part in (0.98, 1.0, 1.01)]
        for group in grouped([binned_pass(one) for one in passes(own, plan, seed)]):
            setting = Setting(frequency_hz=group[0].frequency_hz)
            for one in extremes(group, own.true, Noise()):
                if one.interval_m is not None:
                    true_m = true_places(own, setting, one.kind)
                    nearest = true_m[np.abs(true_m - one.expected_m).argmin()]
                    inside.append(one.interval_m[0] <= nearest <= one.interval_m[1])
    assert len(inside) > 70
    assert np.mean(inside) >= 0.9


def test_too_little_swing_gives_a_reason() -> None:
    own = paper_rig()
    setting = Setting(voltage_v=2.0, frequency_hz=23_200.0, speed_m_s=0.04)
    [group] = grouped([binned_pass(one) for one in passes(own, [setting], 1)])
    found = [one.place_m for one in extremes(group, own.true, Noise())]
    reasons = [place.reason for place in found if isinstance(place, NotEstimable)]
    assert reasons
    assert "within more than 4 mm: too little swing" in reasons[0]
