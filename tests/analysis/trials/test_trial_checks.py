"""Drift, carry-over, proportions and discrimination against dense regressions and scipy."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from analysis.estimates import FloatArray, IntArray, NotEstimable
from analysis.sensitivity.lines import Ratings
from analysis.trials.trial_checks import (
    Discrimination,
    Drift,
    FTest,
    Proportion,
    carry_over,
    discrimination,
    drift,
    order_effect,
    proportion,
)

SUBJECTS, TRIALS, CONDITIONS = 10, 15, 5


def a_session(
    seed: int, *, per_trial: float = 0.0, after: float = 0.0
) -> tuple[Ratings, IntArray, IntArray]:
    """Ratings with a drift and, after condition 0, a carry-over; positions and predecessors."""
    rng = np.random.default_rng(seed)
    orders = [rng.permutation(np.arange(TRIALS) % CONDITIONS) for _ in range(SUBJECTS)]
    condition = np.concatenate(orders)
    position = np.tile(np.arange(1, TRIALS + 1), SUBJECTS)
    previous = np.where(position > 1, np.roll(condition, 1), -1)
    subject = np.repeat(np.arange(SUBJECTS), TRIALS)
    rating = rng.normal(5, 1, SUBJECTS)[subject] + condition + rng.normal(0, 1, len(subject))
    rating += per_trial * position + after * (previous == 0)
    ratings = Ratings(
        subjects=tuple(f"s{number}" for number in range(SUBJECTS)),
        conditions=tuple(f"c{number}" for number in range(CONDITIONS)),
        subject=subject,
        condition=condition,
        contrast=np.zeros(len(subject)),
        rating=rating,
    )
    return ratings, position, previous


def dummy_fit(
    y: FloatArray, *groups: IntArray, more: FloatArray | None = None
) -> tuple[float, int]:
    """Residual sum of squares and its degrees of freedom of a regression on dummy variables."""
    parts = [(group[:, None] == np.unique(group)).astype(np.float64) for group in groups]
    design = np.hstack(parts if more is None else [*parts, more[:, None]])
    fitted = design @ np.linalg.lstsq(design, y)[0]
    return float(((y - fitted) ** 2).sum()), len(y) - int(np.linalg.matrix_rank(design))


def expected_f(base: tuple[float, int], full: tuple[float, int]) -> float:
    added = base[1] - full[1]
    return (base[0] - full[0]) / added / (full[0] / full[1])


def test_a_drift_is_found_and_agrees_with_a_dense_regression() -> None:
    ratings, position, _ = a_session(1, per_trial=0.15)
    kept = np.arange(len(position)) % 11 > 0
    trials = ratings.where(kept)
    result = drift(replace(ratings, rating=np.where(kept, ratings.rating, np.nan)), position)
    assert isinstance(result, Drift)
    assert result.interval[0] < 0.15 < result.interval[1]
    people = (trials.subject[:, None] == np.arange(SUBJECTS)).astype(np.float64)
    conditions = (trials.condition[:, None] == np.arange(1, CONDITIONS)).astype(np.float64)
    design = np.hstack([people, conditions, people * position[kept][:, None]])
    slopes = np.linalg.lstsq(design, trials.rating)[0][-SUBJECTS:]
    expected = stats.ttest_1samp(slopes, 0.0)
    assert result.df == SUBJECTS - 1
    assert result.points_per_trial == pytest.approx(slopes.mean(), rel=1e-9)
    assert result.p == pytest.approx(float(expected.pvalue), rel=1e-8)
    ends = expected.confidence_interval()
    assert result.interval == pytest.approx((ends.low, ends.high), rel=1e-8)


def test_people_who_drift_apart_are_no_drift_of_all() -> None:
    values = []
    for seed in range(200):
        ratings, position, _ = a_session(seed)
        own = np.random.default_rng([7, seed]).normal(0, 0.1, SUBJECTS)[ratings.subject]
        result = drift(replace(ratings, rating=ratings.rating + own * position), position)
        assert isinstance(result, Drift)
        values.append(result.p)
    assert stats.kstest(values, "uniform").pvalue > 0.01


def test_p_is_uniform_without_a_drift() -> None:
    found = [drift(*a_session(seed)[:2]) for seed in range(200)]
    values = [result.p for result in found if isinstance(result, Drift)]
    assert stats.kstest(values, "uniform").pvalue > 0.01


def test_carry_over_is_found_and_agrees_with_dummy_variables() -> None:
    ratings, _, previous = a_session(2, after=1.5)
    result = carry_over(ratings, previous)
    assert isinstance(result, FTest)
    kept = previous >= 0
    trials = ratings.where(kept)
    base = dummy_fit(trials.rating, trials.subject, trials.condition)
    full = dummy_fit(trials.rating, trials.subject, trials.condition, previous[kept])
    assert result.df == (base[1] - full[1], full[1]) == (4, full[1])
    assert result.f == pytest.approx(expected_f(base, full), rel=1e-9)
    assert result.p < 1e-3


def test_place_in_the_session_agrees_with_dummy_variables_and_missing_ratings() -> None:
    ratings, position, _ = a_session(3, per_trial=0.2)
    rating = np.where(np.arange(len(position)) % 7 == 0, np.nan, ratings.rating)
    result = order_effect(replace(ratings, rating=rating), position)
    kept = ~np.isnan(rating)
    trials = ratings.where(kept)
    base = dummy_fit(trials.rating, trials.subject, trials.condition)
    full = dummy_fit(trials.rating, trials.subject, trials.condition, position[kept])
    assert isinstance(result, FTest)
    assert result.f == pytest.approx(expected_f(base, full), rel=1e-9)


def test_sessions_without_a_test_give_the_reason() -> None:
    ratings, position, previous = a_session(1)
    fixed = replace(ratings, condition=(position - 1) % CONDITIONS)
    alike = order_effect(fixed.where(position <= 5), position[position <= 5])
    assert isinstance(alike, NotEstimable)
    assert "subject and condition determine the effect" in alike.reason
    steady = drift(ratings, np.ones_like(position))
    assert isinstance(steady, NotEstimable)
    assert "fewer than 2 subjects have rated trials at different positions" in steady.reason
    same = drift(fixed.where(position <= 5), position[position <= 5])
    assert isinstance(same, NotEstimable)
    assert "drift cannot be separated" in same.reason
    first = carry_over(ratings.where(position == 1), previous[position == 1])
    assert first == NotEstimable("no rated trial follows another")
    unrated = replace(ratings, rating=np.full(len(position), np.nan))
    assert order_effect(unrated, position) == NotEstimable("no trial was rated")
    assert drift(unrated, position) == NotEstimable("no trial was rated")


@given(st.integers(1, 30).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_proportions_agree_with_scipy(counts: tuple[int, int]) -> None:
    result = proportion(*counts)
    assert isinstance(result, Proportion)
    expected = stats.binomtest(*counts).proportion_ci()
    assert result.interval == pytest.approx((expected.low, expected.high), rel=1e-8, abs=1e-12)


def test_impossible_counts_are_refused() -> None:
    with pytest.raises(ValueError, match=r"count must lie in \[0, 4\], got 5"):
        proportion(5, 4)
    assert proportion(0, 0) == NotEstimable("there were no such trials")


def test_discrimination_from_counts() -> None:
    result = discrimination((18, 20), (1, 4))
    assert isinstance(result, Discrimination)
    hit, alarm = stats.norm.ppf(18.5 / 21), stats.norm.ppf(1.5 / 5)
    assert result.d_prime == pytest.approx(hit - alarm, rel=1e-12)
    assert result.criterion == pytest.approx(-(hit + alarm) / 2, rel=1e-12)
    chance = discrimination((10, 20), (2, 4))
    assert isinstance(chance, Discrimination)
    assert (chance.d_prime, chance.criterion) == (0.0, 0.0)


def test_discrimination_needs_both_kinds_of_trial() -> None:
    assert discrimination((1, 2), (0, 0)) == NotEstimable("there were no catch trials")
    assert discrimination((0, 0), (0, 3)) == NotEstimable("there were no signal trials")
