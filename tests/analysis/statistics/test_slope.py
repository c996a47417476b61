"""The slope of responses on predicted contrasts, against permutations one by one."""

from itertools import permutations

import numpy as np
import pytest
from scipy import stats

from analysis.estimates import FloatArray, IntArray, NotEstimable
from analysis.statistics.slope import (
    MOST_CONDITIONS,
    LevelSlope,
    Slope,
    level_slope,
    own_gains,
    slope,
)

NAN = float("nan")


def made(rng: np.random.Generator, people: int, contrasts: FloatArray, gain: float) -> FloatArray:
    level, nature = rng.normal(size=(people, 1)), rng.normal(size=len(contrasts))
    return level + nature + gain * contrasts + rng.normal(size=(people, len(contrasts)))


def own_slope(responses: FloatArray, contrasts: FloatArray) -> float:
    """Return the least-squares slope with a level of each person, by a general solver."""
    person, condition = np.nonzero(~np.isnan(responses))
    design = np.column_stack([contrasts[condition], np.eye(len(responses))[person]])
    return float(np.linalg.lstsq(design, responses[person, condition])[0][0])


def known(found: Slope | NotEstimable) -> Slope:
    assert isinstance(found, Slope)
    return found


@pytest.mark.parametrize("seed", range(6))
def test_it_is_the_slope_that_least_squares_find(seed: int) -> None:
    rng = np.random.default_rng(seed)
    contrasts = rng.normal(size=5)
    responses = made(rng, 7, contrasts, 2.0)
    if seed % 2:  # cells that were never reached
        responses[[0, 3, 3], [1, 0, 4]] = NAN
    assert known(slope(responses, contrasts)).value == pytest.approx(
        own_slope(responses, contrasts)
    )


@pytest.mark.parametrize("seed", range(6))
def test_p_counts_the_orders_one_by_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    contrasts = rng.normal(size=5)
    responses = made(rng, 6, contrasts, 1.0)
    means = responses.mean(axis=0)
    found = known(slope(responses, contrasts))
    slopes = [stats.linregress(order, means).slope for order in permutations(contrasts)]
    extreme = np.abs(slopes) >= abs(found.value) - 1e-9
    assert (found.p, found.assignments, found.error) == (extreme.mean(), 120, 0.0)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("gap", [False, True])
def test_the_interval_has_the_slopes_that_the_test_does_not_reject(seed: int, gap: bool) -> None:
    rng = np.random.default_rng(seed)
    contrasts = np.round(rng.normal(size=5), 1) if seed % 3 else np.array([0.0, 1, 2, 3, 4])
    responses = made(rng, 6, contrasts, 1.5)
    if gap:
        responses[[0, 2], [1, 3]] = NAN
    ends = known(slope(responses, contrasts)).interval
    assert not isinstance(ends, NotEstimable)
    inside = np.linspace(*ends, 12)
    width = ends[1] - ends[0]
    beyond = width * np.geomspace(0.02, 3, 8)
    outside = np.concatenate([ends[0] - beyond, ends[1] + beyond])

    def p_less(value: float) -> float:
        return known(slope(responses - value * contrasts, contrasts)).p

    assert all(p_less(value) >= 0.05 for value in inside[1:-1])
    assert all(p_less(value) < 0.05 for value in outside)


def test_conditions_that_differ_are_no_evidence_for_a_slope() -> None:
    rng, contrasts = np.random.default_rng(1), np.array([0.1, 0.2, 0.3, 0.4, 0.5])
    rejected = 0
    by_people = 0
    for _ in range(300):
        responses = made(rng, 9, contrasts, 0.0)
        rejected += known(slope(responses, contrasts)).p < 0.05
        slopes = (responses - responses.mean(axis=1, keepdims=True)) @ (contrasts - 0.3)
        by_people += bool(stats.ttest_1samp(slopes, 0).pvalue < 0.05)
    assert rejected <= 0.05 * 300 + 2 * np.sqrt(300 * 0.05 * 0.95)
    # A t test over people holds the conditions fixed.
    assert by_people > 0.3 * 300


def test_a_mirrored_study_has_the_same_p_and_the_opposite_slope() -> None:
    rng, contrasts = np.random.default_rng(2), np.array([0.3, -0.1, 0.5, 0.2])
    responses = made(rng, 5, contrasts, 1.0)
    one, other = known(slope(responses, contrasts)), known(slope(responses, -contrasts))
    assert other.p == one.p
    assert other.value == pytest.approx(-one.value)


def test_many_conditions_take_random_orders_of_a_fixed_seed() -> None:
    rng, contrasts = np.random.default_rng(3), np.linspace(0, 1, MOST_CONDITIONS + 1)
    responses = made(rng, 8, contrasts, 3.0)
    one, again = slope(responses, contrasts), slope(responses, contrasts)
    assert one == again
    assert 0 < known(one).p < 1
    assert known(one).error > 0
    few = slope(responses[:, 1:], contrasts[1:])
    assert known(few).error == 0.0


def test_the_order_of_people_and_conditions_changes_nothing() -> None:
    rng, contrasts = np.random.default_rng(4), np.array([0.3, -0.1, 0.5, 0.2])
    responses = made(rng, 5, contrasts, 1.0)
    turned = known(slope(responses[::-1, ::-1], contrasts[::-1]))
    assert turned.p == known(slope(responses, contrasts)).p


def test_ties_of_whole_responses_are_ties_on_every_processor() -> None:
    # Sums that differ by rounding alone must count as equal: the reverse order is as extreme.
    contrasts = np.array([0.1, 0.2, 0.3])
    found = known(slope(np.array([[1.0, 2, 3], [2, 3, 4]]) / 10, contrasts))
    assert found.p == pytest.approx(2 / 6)
    assert found.least_p == pytest.approx(2 / 6)


@pytest.mark.parametrize(
    ("responses", "contrasts", "why"),
    [
        ([[0.0] * 3, [5.0] * 3], [0.1, 0.2, 0.3], "everybody's responses are the same in all"),
        ([[1.0, 2.0]], [0.1, 0.2], "at least 3 conditions with a predicted contrast are needed"),
        ([[1.0, 2.0, 3.0]], [0.1, 0.2, NAN], "at least 3 conditions"),
        ([[1.0, 2.0, NAN]], [0.1, 0.2, 0.3], "at least 3 conditions"),
        ([[1.0, 2.0, 3.0]], [0.1, 0.1, 0.1], "the same contrast is predicted of all conditions"),
        ([[1.0, NAN, NAN], [NAN, 1.0, NAN], [NAN, NAN, 1.0]], [1.0, 2.0, 3.0], "nobody answered"),
    ],
)
def test_where_there_is_none_it_says_why(
    responses: list[list[float]], contrasts: list[float], why: str
) -> None:
    found = slope(np.array(responses), np.array(contrasts))
    assert isinstance(found, NotEstimable)
    assert why in found.reason


def test_few_orders_have_no_interval() -> None:
    found = known(slope(np.array([[1.0, 2, 4], [0, 2, 3]]), np.array([0.1, 0.2, 0.3])))
    assert isinstance(found.interval, NotEstimable)
    assert "too few orders" in found.interval.reason


@pytest.mark.parametrize(
    ("contrasts", "least"),
    [((0.1, 0.2, 0.3, 0.4), 2 / 24), ((0.0, 0.0, 0.3, 0.3, 0.3), 12 / 120), ((0, 1, 3, 7), 1 / 24)],
)
def test_the_least_p_is_that_of_perfect_responses(
    contrasts: tuple[float, ...], least: float
) -> None:
    x = np.array(contrasts)
    found = known(slope(np.array([5.0 + 2 * x, 1.0 + 3 * x]), x))
    assert found.least_p == pytest.approx(least)
    assert found.p == pytest.approx(least)


def test_interval_and_p_agree_at_the_very_limit() -> None:
    rng, contrasts = np.random.default_rng(6), np.array([0.05, 0.2, 0.22, 0.4, 0.5])
    at_limit = 0
    for _ in range(600):
        found = known(slope(made(rng, 5, contrasts, 4.0), contrasts))
        assert not isinstance(found.interval, NotEstimable)
        low, high = found.interval
        assert (low <= 0 <= high) == (found.p >= 0.05)
        at_limit += found.p == pytest.approx(6 / 120)
    assert at_limit > 5


def within(people: int, seed: int) -> tuple[FloatArray, FloatArray, IntArray, IntArray]:
    """Responses, contrasts, people and conditions of three trials of two conditions each."""
    rng = np.random.default_rng(seed)
    person, condition = np.repeat(np.arange(people), 6), np.tile(np.repeat([0, 1], 3), people)
    contrast = np.tile(rng.normal(size=6), people)
    response = 2.0 * contrast + 5.0 * condition + person + rng.normal(size=6 * people)
    return response, contrast, person, condition


def slopes_of(
    response: FloatArray, contrast: FloatArray, person: IntArray, condition: IntArray
) -> list[float]:
    """Return each person's slope, with a level of each condition, by a general solver."""
    designs = (
        (np.column_stack([contrast[own], np.eye(2)[condition[own]]]), response[own])
        for own in (person == who for who in np.unique(person))
    )
    return [float(np.linalg.lstsq(*design)[0][0]) for design in designs]


def test_within_conditions_it_is_the_t_test_of_peoples_slopes_where_contrasts_are_alike() -> None:
    arrays = within(4, 5)
    found, slopes = level_slope(*arrays), slopes_of(*arrays)
    assert isinstance(found, LevelSlope)
    assert found.value == pytest.approx(np.mean(slopes))
    test = stats.ttest_1samp(slopes, 0)
    assert found.p == pytest.approx(test.pvalue)
    assert found.interval == pytest.approx(tuple(test.confidence_interval()))
    assert found.people == 4


def test_who_left_after_two_trials_hardly_moves_it() -> None:
    response, contrast, person, condition = within(8, 6)
    near = np.array([0.01, 0.012]), np.array([3.0, -9.0])
    more = level_slope(
        np.append(response, near[1]),
        np.append(contrast, near[0]),
        np.append(person, [8, 8]),
        np.append(condition, [0, 0]),
    )
    found = level_slope(response, contrast, person, condition)
    assert isinstance(found, LevelSlope)
    assert isinstance(more, LevelSlope)
    assert more.value == pytest.approx(found.value, abs=0.01)
    assert max(more.p, found.p) < 1e-5


def test_levels_of_one_person_tell_nothing_of_others() -> None:
    alone = level_slope(
        np.array([1.0, 2.0]), np.array([0.1, 0.2]), np.array([0, 0]), np.array([0, 0])
    )
    assert isinstance(alone, NotEstimable)
    assert "at least 2 people" in alone.reason


def test_own_gains_are_each_persons_regression() -> None:
    rng = np.random.default_rng(6)
    person = np.repeat(np.arange(4), [6, 2, 1, 5])
    contrasts, responses = rng.uniform(0, 0.6, 14), rng.normal(size=14)
    contrasts[-5:] = 0.3  # the last one felt the same contrast again and again
    found = own_gains(responses, contrasts, person, people=5)
    for who in (0, 1):
        own = person == who
        expected = stats.linregress(contrasts[own], responses[own]).slope
        assert found[who] == pytest.approx(expected, rel=1e-9)
    assert np.isnan(found[2:]).all()
