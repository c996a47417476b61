"""What a fit says of subjects beside their lines: relative gains, JND, own share and spread."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from analysis.estimates import Interval, NotEstimable
from analysis.sensitivity.linear_model import LinearSensitivity, linear_sensitivity
from analysis.sensitivity.lines import UNEQUAL, Lines, Ratings
from analysis.sensitivity.ordinal_model import OrdinalSensitivity, ordinal_sensitivity
from tests.analysis.sensitivity.calibration import drawn, measured

Fit = Callable[[Ratings], LinearSensitivity | OrdinalSensitivity | NotEstimable]
MODELS = pytest.mark.parametrize("fit", [linear_sensitivity, ordinal_sensitivity])


def lines_of(fit: Fit, ratings: Ratings) -> Lines:
    found = fit(ratings)
    assert isinstance(found, LinearSensitivity | OrdinalSensitivity)
    return found.lines


def width(interval: Interval) -> float:
    return interval[1] - interval[0]


@MODELS
def test_relative_gains_are_sharper_and_have_the_mean_0(fit: Fit) -> None:
    lines = lines_of(fit, drawn("off the line", "9x5x4", 3).ratings)
    mean = np.mean([line.gain for line in lines.subjects])
    for line in lines.subjects:
        assert line.relative_gain == pytest.approx(line.gain - mean, abs=0.01)
        assert line.relative_gain_interval[0] < line.relative_gain < line.relative_gain_interval[1]
    if fit is ordinal_sensitivity:
        sharper = [
            width(line.gain_interval) / width(line.relative_gain_interval)
            for line in lines.subjects
        ]
        assert min(sharper) > 1.2


@MODELS
def test_a_subject_without_trials_is_not_in_the_mean_and_has_no_own_share(fit: Fit) -> None:
    ratings = drawn("middle", "9x5x4", 3).ratings
    without = lines_of(fit, ratings.where(ratings.subject != 4)).subjects
    rated = [line.gain for line in without if line.trials]
    assert len(rated) == 8
    assert without[4].own_share < 1e-9
    assert without[4].relative_gain == pytest.approx(without[4].gain - np.mean(rated), abs=0.01)
    assert without[0].relative_gain == pytest.approx(without[0].gain - np.mean(rated), abs=0.01)


@MODELS
def test_a_single_subject_has_no_relative_gain(fit: Fit) -> None:
    ratings = drawn("middle", "9x5x4", 3).ratings
    alone = replace(ratings.where(ratings.subject == 0), subjects=("v1",))
    (line,) = lines_of(fit, alone).subjects
    assert np.isnan([line.relative_gain, *line.relative_gain_interval]).all()
    assert line.gain_interval[0] < line.gain < line.gain_interval[1]


@MODELS
def test_the_jnd_is_unbounded_exactly_where_the_gain_may_be_0(fit: Fit) -> None:
    ends = set()
    for name in ("middle", "off the line"):
        for line in lines_of(fit, drawn(name, "9x5x4", 5).ratings).subjects:
            unbounded = np.isinf(line.jnd_interval[1])
            assert unbounded == (line.gain_interval[0] <= 0)
            assert line.jnd_interval[0] <= line.jnd <= line.jnd_interval[1]
            ends.add(bool(unbounded))
    if fit is ordinal_sensitivity:
        assert ends == {False, True}


def test_the_jnd_is_the_noise_over_the_gain() -> None:
    found = ordinal_sensitivity(drawn("middle", "20x5x8", 1).ratings)
    assert isinstance(found, OrdinalSensitivity)
    assert found.lines.jnd == pytest.approx(found.residual_sd / found.lines.gain, rel=0.05)
    assert found.lines.jnd_interval[0] < 1 / 6 < found.lines.jnd_interval[1]


def test_the_own_share_does_not_count_the_groups_uncertainty() -> None:
    """Conditions off the line leave the group's gain unknown, but not who departs from it."""
    found = measured("off the line", "20x5x8", 0)
    assert not isinstance(found, NotEstimable)
    assert found.gain_width > 10
    assert 0.6 < found.own_share < 0.9


@MODELS
def test_only_the_only_subject_has_a_line(fit: Fit) -> None:
    """One person tells nothing about a group: its interval was [-189, 199]."""
    ratings = drawn("middle", "9x5x4", 3).ratings
    lines = lines_of(fit, ratings.where(ratings.subject == 0))
    assert not lines.group_known
    assert np.isnan([lines.gain, lines.bias, *lines.gain_interval, lines.equal_gains]).all()
    assert lines.middle == (lines.subjects[0].bias, lines.subjects[0].gain)


@MODELS
def test_contrasts_of_the_other_sign_only_turn_the_gains(fit: Fit) -> None:
    ratings = drawn("middle", "9x5x4", 3).ratings
    one, other = lines_of(fit, ratings), lines_of(fit, replace(ratings, contrast=-ratings.contrast))
    assert other.gain == pytest.approx(-one.gain, rel=0.02)
    assert other.small_gain_sd == pytest.approx(one.small_gain_sd, abs=0.02)
    assert other.equal_gains == pytest.approx(one.equal_gains, abs=0.02)


@MODELS
def test_gains_differ_only_where_they_do(fit: Fit) -> None:
    alike, different = (
        lines_of(fit, drawn(name, "20x5x8", 2).ratings) for name in ("no differences", "middle")
    )
    assert alike.equal_gains > 0.5
    assert alike.gain_sd_interval[0] == 0
    assert different.equal_gains < UNEQUAL
    assert different.gain_sd_interval[0] > 0


@MODELS
def test_a_small_spread_is_probable_only_if_there_is_one(fit: Fit) -> None:
    alike, different = (
        lines_of(fit, drawn(name, "20x5x8", 2).ratings) for name in ("no differences", "middle")
    )
    assert alike.small_gain_sd > 0.95
    assert different.small_gain_sd < 0.4
    for lines in (alike, different):
        assert lines.gain_sd < lines.gain_sd_upper < lines.gain_sd_interval[1]
    assert alike.gain_sd_upper < 1.5 < different.gain_sd_upper


@MODELS
def test_a_fit_with_too_few_effective_points_is_withheld(
    fit: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    ratings = drawn("middle", "9x5x1", 0).ratings
    found = fit(ratings)
    assert isinstance(found, LinearSensitivity | OrdinalSensitivity)
    assert found.effective_points >= 200
    monkeypatch.setattr("analysis.sensitivity.integration.LEAST_EFFECTIVE", 1e9)
    found = fit(ratings)
    assert isinstance(found, NotEstimable)
    assert "effective points, and intervals need at least 1000000000" in found.reason


@MODELS
def test_the_only_subject_with_trials_has_no_relative_gain(fit: Fit) -> None:
    ratings = drawn("middle", "9x5x4", 3).ratings
    lines = lines_of(fit, ratings.where(ratings.subject == 0)).subjects
    assert len(lines) == 9
    assert not any(line.relative_gain_known for line in lines)
