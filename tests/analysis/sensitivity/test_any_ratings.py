"""Sensitivity models of arbitrary ratings: a finite result or a reason."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.estimates import NotEstimable
from analysis.sensitivity.linear_model import LinearSensitivity, linear_sensitivity
from analysis.sensitivity.lines import Lines, Ratings
from analysis.sensitivity.ordinal_model import OrdinalSensitivity, ordinal_sensitivity
from analysis.sensitivity.two_stage_model import AnsweredTrials, TwoStageSensitivity
from tests.analysis.sensitivity.noticing_people import two_stage_sensitivity


@st.composite
def any_ratings(draw: st.DrawFn) -> Ratings:
    subjects, trials = draw(st.integers(1, 4)), draw(st.integers(1, 24))
    conditions = draw(st.integers(1, 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    levels = draw(st.integers(1, 5))
    rating = rng.integers(0, draw(st.integers(1, 11)), trials).astype(np.float64)
    rating[rng.random(trials) < draw(st.sampled_from([0.0, 0.3]))] = np.nan
    return Ratings(
        subjects=tuple(f"s{number}" for number in range(subjects)),
        conditions=tuple(f"c{number}" for number in range(conditions)),
        subject=rng.integers(0, subjects, trials),
        condition=rng.integers(0, conditions, trials),
        contrast=rng.integers(-1, levels, trials).astype(np.float64) / 4,
        rating=rating,
    )


def is_sound(lines: Lines) -> bool:
    return all(
        np.isfinite([line.bias, line.gain, *line.bias_interval, *line.gain_interval]).all()
        and line.gain_interval[0] <= line.gain <= line.gain_interval[1]
        and 0 <= line.own_share <= 1
        and 0 < line.jnd_interval[0] <= line.jnd <= line.jnd_interval[1]
        for line in lines.subjects
        if line.trials or lines.group_known
    )


@settings(max_examples=30, deadline=None)
@given(any_ratings())
def test_lines_are_finite_or_not_estimable(ratings: Ratings) -> None:
    result = linear_sensitivity(ratings)
    assert isinstance(result, NotEstimable) or is_sound(result.lines)


@settings(max_examples=10, deadline=None)
@given(any_ratings())
def test_the_latent_scale_is_finite_or_not_estimable(ratings: Ratings) -> None:
    result = ordinal_sensitivity(ratings)
    assert isinstance(result, NotEstimable) or is_sound(result.lines)


@settings(max_examples=10, deadline=None)
@given(any_ratings(), st.integers(0, 2**32 - 1))
def test_detection_is_finite_or_not_estimable(ratings: Ratings, chance: int) -> None:
    rng = np.random.default_rng(chance)
    answer = rng.integers(-1, 2, len(ratings.rating))
    two_sided = (answer < 0) | (rng.random(len(answer)) < 0.5)
    trials = AnsweredTrials(ratings=ratings, answer=answer, two_sided=two_sided)
    result = two_stage_sensitivity(trials)
    if isinstance(result, NotEstimable):
        return
    assert is_sound(result.ratings.lines)
    assert np.isfinite([found.d_prime for found in result.detection]).all()


@pytest.mark.parametrize("repeats", [2, 4])
def test_some_ratings_have_a_result(repeats: int) -> None:
    ratings = Ratings(
        subjects=("a", "b"),
        conditions=("c",),
        subject=np.repeat([0, 1], 6 * repeats),
        condition=np.zeros(12 * repeats, dtype=np.int64),
        contrast=np.tile([0.0, 0.0, 0.5, 0.5, 1.0, 1.0], 2 * repeats),
        rating=np.tile([0.0, 2.0, 3.0, 4.0, 6.0, 9.0, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0], repeats),
    )
    assert isinstance(linear_sensitivity(ratings), LinearSensitivity)
    assert isinstance(ordinal_sensitivity(ratings), OrdinalSensitivity)
    answer = np.where(ratings.rating > 2, 1, 0)
    apart = AnsweredTrials(ratings=ratings, answer=answer, two_sided=answer == 1)
    found = two_stage_sensitivity(apart)
    assert isinstance(found, NotEstimable)
    assert "the skewness of a posterior is beyond the limit" in found.reason
    answer = np.where(np.isin(ratings.rating, [1.0, 4.0, 5.0, 6.0, 9.0, 10.0]), 1, 0)
    mixed = AnsweredTrials(ratings=ratings, answer=answer, two_sided=answer == 1)
    assert isinstance(two_stage_sensitivity(mixed), TwoStageSensitivity)
