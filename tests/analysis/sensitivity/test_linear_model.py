"""The linear model (M1): exact likelihood, recovery and coverage."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from analysis.estimates import FloatArray, Interval, NotEstimable
from analysis.sensitivity.linear_model import (
    LinearSensitivity,
    line_posterior,
    line_sums,
    linear_sensitivity,
)
from analysis.sensitivity.lines import Lines, Ratings
from tests.analysis.sensitivity.simulated_raters import (
    VirtualPopulation,
    VirtualStudy,
    virtual_study,
)

StudyOf = Callable[..., VirtualStudy]
OPEN = VirtualPopulation(bias=3.0, bias_sd=1.0, gain=9.0, gain_sd=3.0, noise_sd=1.2, scale=None)


def fit(ratings: Ratings) -> LinearSensitivity:
    result = linear_sensitivity(ratings)
    assert isinstance(result, LinearSensitivity)
    return result


def width(interval: Interval) -> float:
    return interval[1] - interval[0]


def gain_errors(lines: Lines, study: VirtualStudy) -> FloatArray:
    return np.array([line.gain for line in lines.subjects]) - study.gain


def coverage(lines: Lines, study: VirtualStudy) -> list[float]:
    """The shares of subjects whose intervals hold the true bias and the true gain."""
    bias = np.array([line.bias_interval for line in lines.subjects])
    gain = np.array([line.gain_interval for line in lines.subjects])
    return [
        float(((pair[:, 0] <= truth) & (truth <= pair[:, 1])).mean())
        for pair, truth in ((bias, study.bias), (gain, study.gain))
    ]


def test_the_likelihood_is_that_of_a_multivariate_normal() -> None:
    rng = np.random.default_rng(3)
    subject = np.array([0, 0, 0, 1, 1, 2, 2, 2, 2])
    x, y = rng.normal(size=9), rng.normal(size=9)
    between = np.array([[0.7, 0.2], [0.2, 0.4]])
    design = np.stack([np.ones(9), x], axis=1)
    same = subject[:, None] == subject
    covariance = same * (design @ between @ design.T) + 0.8**2 * np.eye(9)
    inverse = np.linalg.inv(covariance)
    precision = design.T @ inverse @ design
    population = np.linalg.solve(precision, design.T @ inverse @ y)
    best = stats.multivariate_normal(design @ population, covariance).logpdf(y)

    known = line_posterior(line_sums(subject, 4, x, y), np.array([0.8]), between[None])
    assert known.population[0] == pytest.approx(population, rel=1e-10)
    restricted = best - np.linalg.slogdet(precision)[1] / 2
    assert known.log_likelihood[0] == pytest.approx(restricted, rel=1e-12)
    # Best linear unbiased prediction: u = T Z' V^-1 (y - X b); the fourth subject has no trials.
    departures = y - design @ population
    for number in range(4):
        own = np.where(subject == number, 1.0, 0.0)[:, None] * design
        expected = population + between @ own.T @ inverse @ departures
        assert known.means[0, number] == pytest.approx(expected, rel=1e-10)
    unseen = between + np.linalg.inv(precision)
    assert known.covariances[0, 3] == pytest.approx(unseen, rel=1e-10)
    # The joint posterior of two subjects' lines: their covariance comes from the population alone.
    one, other = (np.where(subject == number, 1.0, 0.0)[:, None] * design for number in (0, 2))
    projected = inverse - inverse @ design @ np.linalg.solve(precision, design.T @ inverse)
    shared = np.linalg.inv(precision)
    lost = [between @ own.T @ inverse @ design @ shared for own in (one, other)]
    expected = shared - lost[0] - lost[1].T - between @ one.T @ projected @ other @ between
    kept = known.kept[0]
    found = kept[0] @ known.population_covariance[0] @ kept[2].T
    assert found == pytest.approx(expected, rel=1e-9)


def test_one_subject_is_ordinary_regression(extended_study: StudyOf) -> None:
    ratings = extended_study(OPEN, seed=5, subjects=1).ratings
    line = fit(ratings).lines.subjects[0]
    expected = stats.linregress(ratings.contrast, ratings.rating)
    half = float(stats.t.ppf(0.975, 18)) * expected.stderr
    assert line.gain == pytest.approx(expected.slope, abs=0.03 * half)
    assert line.gain_interval == pytest.approx(
        (expected.slope - half, expected.slope + half), abs=0.06 * half
    )
    assert line.bias == pytest.approx(expected.intercept, abs=0.05)


def test_known_bias_and_gain_are_recovered_and_covered(extended_study: StudyOf) -> None:
    covered, pooled, unpooled = [], [], []
    for seed in range(60):
        study = extended_study(OPEN, seed=seed)
        lines = fit(study.ratings).lines
        covered.append(coverage(lines, study))
        pooled.append(gain_errors(lines, study))
        for number, gain in enumerate(study.gain):
            own = study.ratings.where(study.ratings.subject == number)
            unpooled.append(np.polyfit(own.contrast, own.rating, 1)[0] - gain)
    bias, gain = np.mean(covered, axis=0)
    assert 0.92 < bias < 0.98
    assert 0.92 < gain < 0.98
    assert abs(np.mean(pooled)) < 0.15
    assert np.std(pooled) < np.std(unpooled)


def test_components_are_recovered_in_a_large_study(extended_study: StudyOf) -> None:
    result = fit(extended_study(OPEN, seed=1, subjects=400).ratings)
    assert result.residual_sd == pytest.approx(1.2, abs=0.03)
    assert result.lines.bias_sd == pytest.approx(1.0, abs=0.15)
    assert result.lines.gain_sd == pytest.approx(3.0, abs=0.5)
    assert result.lines.gain == pytest.approx(9.0, abs=0.5)


def test_a_subject_with_few_trials_borrows_more(extended_study: StudyOf) -> None:
    ratings = extended_study(OPEN, seed=2).ratings
    scored = ratings.rating.copy()
    scored[(ratings.subject == 0) & (np.arange(len(scored)) % 5 > 0)] = np.nan
    scored[ratings.subject == 1] = np.nan
    lines = fit(replace(ratings, rating=scored)).lines.subjects
    assert [line.trials for line in lines[:3]] == [4, 0, 20]
    assert lines[1].own_share < 0.05 < lines[0].own_share < lines[2].own_share < 1
    assert width(lines[1].gain_interval) > width(lines[2].gain_interval)


def test_one_rating_per_cell_is_not_enough() -> None:
    """With the paper's one trial per condition gains are the group's more than the person's."""
    widths, shares = {}, {}
    for repeats in (1, 4):
        study = virtual_study(
            VirtualPopulation(gain=9.0, gain_sd=1.5, scale=None),
            subjects=9,
            condition=np.repeat(np.arange(5), repeats),
            contrast=np.repeat([0.05, 0.04, 0.13, 0.33, 0.015], repeats),
            rng=np.random.default_rng(11),
        )
        lines = fit(study.ratings).lines.subjects
        widths[repeats] = np.mean([width(line.gain_interval) for line in lines])
        shares[repeats] = np.mean([line.own_share for line in lines])
    assert shares[1] < 0.6
    assert shares[1] < shares[4]
    assert widths[1] > 1.2 * widths[4]


def test_a_ceiling_makes_gains_too_small_and_intervals_miss(extended_study: StudyOf) -> None:
    population = replace(OPEN, bias=5.0, gain=12.0, scale=(0.0, 10.0))
    covered, errors = [], []
    for seed in range(20):
        study = extended_study(population, seed=seed)
        lines = fit(study.ratings).lines
        covered.append(coverage(lines, study)[1])
        errors.append(lines.gain - study.gain.mean())
    assert np.mean(errors) < -2.0
    assert np.mean(covered) < 0.7


def test_lapses_cost_some_precision(extended_study: StudyOf) -> None:
    population = replace(OPEN, bias=2.0, gain=6.0, gain_sd=2.0, scale=(0.0, 10.0))
    error = {}
    for rate in (0.0, 0.05):
        studies = [extended_study(replace(population, lapse_rate=rate), seed=s) for s in range(10)]
        errors = [gain_errors(fit(study.ratings).lines, study) for study in studies]
        error[rate] = np.sqrt(np.mean(np.square(errors)))
    assert error[0.0] < error[0.05] < 1.7 * error[0.0]


def test_units_of_contrast_and_rating_only_rescale(extended_study: StudyOf) -> None:
    ratings = extended_study(OPEN, seed=4).ratings
    scaled = replace(ratings, contrast=ratings.contrast * 100, rating=ratings.rating * 10 + 7)
    one, other = fit(ratings).lines.subjects[3], fit(scaled).lines.subjects[3]
    assert other.bias == pytest.approx(one.bias * 10 + 7, rel=1e-6)
    assert other.gain == pytest.approx(one.gain / 10, rel=1e-6)
    assert width(other.gain_interval) == pytest.approx(width(one.gain_interval) / 10, rel=1e-6)


@pytest.mark.parametrize(
    ("contrast", "rating", "reason"),
    [
        ([0.1, 0.2], [1.0, 2.0], "at least 3 ratings with a predicted contrast, got 2"),
        ([0.1, 0.1, 0.1], [1.0, 2.0, 3.0], "all predicted contrasts are equal"),
        ([0.1, 0.2, 0.3], [7.0, 7.0, 7.0], "all ratings are equal (7)"),
        ([0.1, 0.2, 0.3], [1.0, 2.0, 3.0], "lie exactly on a line"),
        (
            [0.1, 0.2, 0.3],
            [1.0, 2.0, np.nan],
            "at least 3 ratings with a predicted contrast, got 2",
        ),
    ],
)
def test_ratings_without_a_line_give_the_reason(
    contrast: list[float], rating: list[float], reason: str
) -> None:
    trials = len(rating)
    result = linear_sensitivity(
        Ratings(
            subjects=("a",),
            conditions=("c",),
            subject=np.zeros(trials, dtype=np.int64),
            condition=np.zeros(trials, dtype=np.int64),
            contrast=np.array(contrast),
            rating=np.array(rating),
        )
    )
    assert isinstance(result, NotEstimable)
    assert reason in result.reason
