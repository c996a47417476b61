"""Psychometric functions fitted to answers: published data, laws, recovery, messages."""

from typing import get_args

import numpy as np
import pytest
from scipy.special import ndtr
from scipy.stats import betabinom

from analysis.estimates import FloatArray
from analysis.thresholds import curve_posterior
from analysis.thresholds.answer_curve import Curve, Shape
from analysis.thresholds.psychometric import Threshold, fitted
from protocol.errors import BadInput
from protocol.study.track import GUESS_RATE, Task

LEVELS = np.array(
    [0.001, 0.0015, 0.002, 0.0025, 0.003, 0.0035, 0.004, 0.0045, 0.005, 0.006, 0.007, 0.008, 0.01]
)
CORRECT = np.array([45, 50, 44, 44, 52, 53, 62, 64, 76, 79, 88, 90, 90])
"""The example of psignifit: of 90 in each of 13 levels, in two intervals."""
EXAMPLE = LEVELS, np.full(13, 90), CORRECT
WICHMANN_AND_HILL = np.arange(0, 421, 60), np.full(8, 20)


def test_the_interval_of_psignifits_example() -> None:
    """MATLAB gives .00428 to .00496, Python .00425 to .00493."""
    found = fitted(*EXAMPLE, shape="normal")
    low, high = found.threshold_ci
    assert 0.00418 <= low <= 0.00433
    assert 0.00487 <= high <= 0.00502
    assert found.flags == ()
    assert found.threshold_at == 0.75


@pytest.mark.parametrize("shape", ["normal", "weibull"])
def test_one_lapse_does_not_move_the_threshold(shape: Shape) -> None:
    """Wichmann and Hill, Perception & Psychophysics 63, 2001: with a lapse rate of 0 it does."""
    without, with_one = (
        fitted(*WICHMANN_AND_HILL, [0, 0, 4, 18, 20, 20, right, 20], task="yes or no", shape=shape)
        for right in (20, 19)
    )
    moved = abs(with_one.threshold - without.threshold)
    assert moved < 0.05 * np.ptp(without.threshold_ci)
    assert with_one.slope == pytest.approx(without.slope, rel=0.06)
    blind = fitted(
        *WICHMANN_AND_HILL, [0, 0, 4, 18, 20, 20, 19, 20], task="yes or no", shape=shape, lapse=0.0
    )
    assert blind.slope < 0.9 * with_one.slope


@pytest.mark.parametrize("task", GUESS_RATE)
@pytest.mark.parametrize("shape", ["normal", "weibull"])
def test_known_curves_are_recovered(task: Task, shape: Shape) -> None:
    """From the answers that the curve predicts, so many that the prior has no weight."""
    levels = np.geomspace(1, 20, 9)
    trials = np.full(9, 100_000)
    if shape == "normal":
        curve, slope, jnd = ndtr((levels - 7) / 2.5), 1 / 2.5, 0.67449 * 2.5
    else:
        curve, slope = 1 - 2.0 ** -((levels / 7) ** 3), 3.0
        jnd = 7 * 2 ** (1 / 3) - 7
    guess = GUESS_RATE[task] or 0.04
    correct = np.round(trials * (guess + (1 - guess - 0.02) * curve))
    found = fitted(levels, trials, correct, task=task, shape=shape)
    assert found.threshold == pytest.approx(7, rel=0.003)
    assert found.slope == pytest.approx(slope, rel=0.01)
    assert found.lapse == pytest.approx(0.02, abs=0.001)
    assert found.guess == pytest.approx(guess, abs=0.001)
    if task == "yes or no":
        assert found.jnd == pytest.approx(jnd, rel=0.01)
    else:
        assert found.jnd is None


def test_no_rate_is_below_0() -> None:
    found = fitted([1, 2, 3, 4, 5], [40] * 5, [20, 28, 36, 40, 40], shape="normal")
    low, high = found.lapse_ci
    assert 0 < low < found.lapse < high < 0.1


def test_the_share_that_defines_a_threshold() -> None:
    levels, trials = np.linspace(1, 13, 9), np.full(9, 100_000)
    correct = np.round(trials * (0.5 + 0.5 * ndtr((levels - 7) / 2.5)))
    for at, place in ((0.75, 7.0), (0.7937, 7 + 2.5 * 0.22196), (0.9, 7 + 2.5 * 0.84162)):
        found = fitted(levels, trials, correct, shape="normal", threshold_at=at)
        assert found.threshold == pytest.approx(place, rel=0.003)
        assert found.threshold_at == pytest.approx(at)
        assert found.threshold_ci[0] < place < found.threshold_ci[1]


def test_the_unit_of_the_levels_does_not_matter() -> None:
    one = fitted(*EXAMPLE, shape="normal")
    other = fitted(1000 * LEVELS + 3, *EXAMPLE[1:], shape="normal")
    assert other.threshold == pytest.approx(1000 * one.threshold + 3, rel=1e-9)
    assert other.slope == pytest.approx(one.slope / 1000, rel=1e-9)
    assert other.deviance_p == one.deviance_p
    ratios = [fitted(unit * LEVELS, *EXAMPLE[1:]) for unit in (1, 1000)]
    assert ratios[1].threshold == pytest.approx(1000 * ratios[0].threshold, rel=1e-9)
    assert ratios[1].slope == pytest.approx(ratios[0].slope, rel=1e-9)


def test_rows_in_any_order_or_one_per_trial_give_the_same() -> None:
    rng = np.random.default_rng(1)
    per_trial = np.repeat(LEVELS, 90)
    right = np.concatenate([np.arange(90) < number for number in CORRECT])
    order = rng.permutation(per_trial.size)
    single = fitted(per_trial[order], np.ones(per_trial.size), right[order])
    assert single == fitted(*EXAMPLE)


def test_nothing_felt_at_level_0_of_a_weibull_curve() -> None:
    """The catch trials tell the share of false alarms, and nothing else of the curve."""
    levels, trials = [0, 1, 2, 4, 8], [400, 40, 40, 40, 40]
    found = fitted(levels, trials, [40, 6, 12, 30, 40], task="yes or no")
    assert found.guess == pytest.approx(0.1, abs=0.02)
    assert 1.5 < found.threshold < 4


def poor_fits() -> dict[str, Threshold]:
    levels, trials = [1, 2, 3, 4, 5], [20] * 5
    return {
        "all answers at one level": fitted([1, 1], [20, 20], [10, 12]),
        "all right: the threshold may be lower than any level": fitted(levels, trials, trials),
        "all wrong: the threshold may be higher than any level": fitted(levels, trials, [0] * 5),
        "too few levels": fitted([1, 2], [20, 20], [10, 19]),
        "does not rise with the level": fitted(levels, trials, [12, 9, 11, 8, 10]),
        "worse than chance: 35 of 100 right": fitted(levels, trials, [10, 9, 7, 6, 3]),
        "below chance at low levels": fitted(levels, trials, [0, 3, 9, 17, 20]),
        "interval beyond the levels": fitted(levels, trials, [10, 11, 10, 12, 17]),
        "poor fit": fitted(levels, trials, [19, 8, 20, 9, 20], task="yes or no"),
    }


@pytest.mark.parametrize(("flag", "found"), poor_fits().items())
def test_flags(flag: str, found: Threshold) -> None:
    assert flag in found.flags


def test_answers_near_chance_or_that_do_not_rise_are_not_taken_for_yes_and_no() -> None:
    flag, levels, trials = "below chance at low levels", [1, 2, 3, 4, 5], [20] * 5
    assert flag not in fitted(levels, trials, [6, 9, 12, 17, 20]).flags
    assert flag not in fitted(levels, trials, [2, 3, 3, 2, 3]).flags
    assert flag not in fitted(levels, trials, [0, 1, 3, 5, 8]).flags
    assert flag not in fitted(levels, trials, [0, 3, 9, 17, 20], task="yes or no").flags
    assert flag in fitted([1, 2, 3, 4, 5], trials, [0, 2, 9, 17, 20], task="3AFC").flags


@pytest.mark.parametrize("guess", [0.25, 0.4])
def test_a_free_guess_rate_is_found_where_there_are_enough_answers(guess: float) -> None:
    """Of few the prior, psignifit's Beta(1, 10), draws it towards 0."""
    rng = np.random.default_rng(3)
    levels = np.array([0.3, 0.5, 0.7, 1, 1.5, 2, 3, 4, 6, 8])
    share = guess + (0.98 - guess) * -np.expm1(-np.log(2) * (levels / 3) ** 3)
    many, few = (
        [fitted(levels, [n] * 10, rng.binomial(n, share), guess="free").guess for _ in range(6)]
        for n in (1000, 20)
    )
    assert np.mean(many) == pytest.approx(guess, abs=0.02)
    assert np.mean(few) < np.mean(many) - 0.01


def test_without_a_range_of_levels_nothing_is_estimated_but_with_one_something_is() -> None:
    alone = fitted([2.0], [4], [3])
    assert np.isnan([alone.threshold, *alone.threshold_ci, alone.slope, alone.lapse]).all()
    among = fitted([2.0], [4], [3], span=(1.0, 8.0))
    assert 0 < among.threshold_ci[0] < among.threshold < among.threshold_ci[1]


@pytest.mark.parametrize(
    ("correct", "reason"),
    [([10, 11, 9, 11, 12], "above 5"), ([10, 9, 8, 6, 3], "above 5"), ([20] * 5, "below 1")],
)
def test_a_threshold_beyond_the_levels_is_no_number(correct: list[int], reason: str) -> None:
    found = fitted([1, 2, 3, 4, 5], [20] * 5, correct)
    assert found.reason == reason
    assert np.isnan([found.threshold, *found.threshold_ci]).all()
    assert np.isfinite([found.slope, *found.slope_ci, found.lapse]).all()
    said_no = fitted([1, 2, 3, 4, 5], [20] * 5, [0, 1, 0, 0, 1], task="yes or no")
    assert (said_no.reason, said_no.jnd) == ("above 5", None)


def test_a_threshold_lies_in_its_interval_where_no_level_tells_the_curve() -> None:
    """The most probable curve, a step at 47.6, does not: the answers leave open where it is."""
    found = fitted([1, 2, 5, 10, 20, 50], [20] * 6, [0, 0, 0, 0, 0, 18], task="yes or no")
    low, high = found.threshold_ci
    assert 20 < low < found.threshold < high < 50
    assert found.slope_ci[0] < found.slope < found.slope_ci[1]


def test_answers_that_scatter_give_a_longer_interval() -> None:
    """The same shares by and large, but those of one level with the next go up and down."""
    levels, trials = np.arange(1, 10), [100] * 9
    even = fitted(levels, trials, [50, 51, 54, 62, 75, 88, 96, 99, 100], shape="normal")
    uneven = fitted(levels, trials, [58, 43, 62, 54, 75, 96, 88, 99, 92], shape="normal")
    assert even.scatter < 0.05
    assert 0.12 < uneven.scatter < 0.25
    assert np.ptp(uneven.threshold_ci) > 1.5 * np.ptp(even.threshold_ci)
    assert "poor fit" in uneven.flags


def middle_and_ends(values: FloatArray, weight: FloatArray) -> FloatArray:
    """Return the quantiles at 2.5%, 50% and 97.5% of weighted values."""
    order = np.argsort(values)
    return np.interp([0.025, 0.5, 0.975], np.cumsum(weight[order]), values[order])


@pytest.mark.parametrize(
    ("levels", "correct", "task"),
    [
        ([1.0, 2, 4, 8], [10, 13, 18, 20], "two intervals"),
        ([1.0, 2, 3, 4, 6, 8], [10, 12, 13, 17, 20, 19], "two intervals"),
        ([1.0, 2, 5, 10, 20, 50], [0, 0, 1, 4, 12, 18], "yes or no"),
    ],
)
def test_the_posterior_is_that_of_weighted_draws_from_the_prior(
    levels: list[float], correct: list[int], task: Task
) -> None:
    """The prior in other words, and SciPy's beta-binomial distribution."""
    rng, number = np.random.default_rng(4), 200_000
    outside = rng.uniform(-0.5, 1.5, 2 * number)
    beyond = np.abs(outside - np.clip(outside, 0, 1)) / 0.5
    midpoint = outside[rng.random(outside.size) < (1 + np.cos(np.pi * beyond)) / 2][:number]
    width = 0.4 * np.exp(np.arctanh(rng.uniform(-1, 1, midpoint.size)).clip(-3, 3))
    lapse, alarm, scatter = rng.beta(1, 10, (3, midpoint.size)).clip(1e-4, 0.5)
    guess = GUESS_RATE[task] or alarm
    at = np.log(levels)
    log_likelihood = np.zeros(midpoint.size)
    for place, right in zip((at - at[0]) / np.ptp(at), correct, strict=True):
        curve = 1 - 0.5 ** np.exp(4.06738 * (place - midpoint) / width)
        p = (guess + (1 - guess - lapse) * curve).clip(1e-9, 1 - 1e-9)
        size = 1 / scatter**2 - 1
        log_likelihood += betabinom.logpmf(right, 20, size * p, size * (1 - p))
    weight = np.exp(log_likelihood - log_likelihood.max())
    weight /= weight.sum()
    low, threshold, high = np.exp(middle_and_ends(midpoint, weight) * np.ptp(at))
    found = fitted(levels, [20] * len(levels), correct, task=task)
    near = 0.03 * (high - low)
    assert (*found.threshold_ci, found.threshold) == pytest.approx((low, high, threshold), abs=near)
    slope = middle_and_ends(4.06738 / (width * np.ptp(at)), weight)[1]
    assert found.slope == pytest.approx(slope, rel=0.05)
    assert found.lapse == pytest.approx(middle_and_ends(lapse, weight)[1], abs=0.005)
    assert found.scatter == pytest.approx(middle_and_ends(scatter, weight)[1], abs=0.01)


def test_more_trials_give_a_shorter_interval() -> None:
    share = 0.5 + 0.49 * ndtr((LEVELS - 0.0046) / 0.001)
    widths = []
    for trials in (90, 360, 1440, 5760):
        answers = LEVELS, np.full(13, trials), np.round(trials * share)
        widths.append(np.ptp(fitted(*answers, shape="normal").threshold_ci))
    ratios = np.divide(widths[:-1], widths[1:])
    assert ((ratios > 1.5) & (ratios < 2.5)).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"levels": [1.0]}, r"lists of the same length, got \(1,\), \(2,\) and \(2,\)"),
        ({"levels": [1.0, np.nan]}, "level nan with 3 of 4"),
        ({"correct": [1, 5]}, "got level 2 with 5 of 4"),
        ({"correct": [1, 2.5]}, "got level 2 with 2.5 of 4"),
        ({"levels": [-1.0, 2.0]}, "must be at least 0 for the shape weibull, got -1; use normal"),
        ({"trials": [0, 0], "correct": [0, 0]}, "at least one answer, got none"),
        ({"threshold_at": 0.5}, "must lie above 0.5, which is chance in two intervals, .* got 0.5"),
        ({"threshold_at": 1.0}, "below 1, got 1"),
        ({"lapse": 0.5}, r"must lie in \[0, 0.5\), got 0.5"),
        ({"task": "four"}, "task must be one of yes or no, .* got 'four'"),
        ({"shape": "logistic"}, "shape must be one of normal, weibull, got 'logistic'"),
    ],
)
def test_wrong_answers(change: dict[str, object], message: str) -> None:
    given: dict[str, object] = {"levels": [1.0, 2.0], "trials": [4, 4], "correct": [1, 3]}
    with pytest.raises(BadInput, match=message):
        fitted(**{**given, **change})  # type: ignore[arg-type]


def test_too_many_levels() -> None:
    many = np.linspace(1, 2, 1001)
    with pytest.raises(BadInput, match="at most 1000 different levels, got 1001; round them"):
        fitted(many, np.ones(1001), np.ones(1001))


def test_a_curve_without_lapses_is_that_of_a_probit_regression() -> None:
    found = fitted(
        [1, 3, 5, 7, 9], [40] * 5, [2, 6, 20, 34, 38], task="yes or no", lapse=0.0, shape="normal"
    )
    assert found.threshold == pytest.approx(5, abs=1e-3)
    assert (found.lapse, found.guess) == (0, 0)


def test_many_answers_do_not_lead_to_another_curve() -> None:
    """The best curve is that of scipy's searches from 40 places, at 1.17986; a steep one between
    two levels, at 0.749, is the best on a coarse grid. Seven levels leave open how much answers
    scatter, so that the interval is not as short as of binomial ones, 1.155 to 1.201."""
    levels = [0.264, 0.466, 0.563, 0.714, 2.127, 2.318, 5.283]
    said_yes = [98, 452, 733, 1406, 9139, 9215, 9340]
    found = fitted(levels, [10_000] * 7, said_yes, task="yes or no")
    assert found.threshold == pytest.approx(1.17986, abs=4e-3)
    assert found.threshold_ci == pytest.approx((1.068, 1.217), abs=0.01)
    assert found.flags == ()


def answers_of_a_person(
    rng: np.random.Generator, trials: int, task: Task, shape: Shape
) -> tuple[list[FloatArray], float]:
    """Return levels, trials and correct answers at 5 to 9 levels, and the true threshold."""
    at = np.sort(rng.uniform(0, np.log(rng.uniform(3, 40)), int(rng.integers(5, 10))))
    span = at[-1] - at[0]
    threshold, width = at[0] + span * rng.uniform(0.2, 0.8), span * rng.uniform(0.2, 1.2)
    curve = Curve(shape, 0.5)
    guess = GUESS_RATE[task] or float(rng.uniform(0, 0.1))
    parameters = threshold, np.log(width), rng.uniform(0, 0.08), guess
    p = curve.share_correct(at, [np.array(one) for one in parameters])
    number = np.full(at.size, float(trials))
    levels = np.exp(at) if shape == "weibull" else at
    truth = float(np.exp(threshold) if shape == "weibull" else threshold)
    return [levels, number, np.asarray(rng.binomial(trials, p), dtype=np.float64)], truth


@pytest.mark.parametrize("trials", [100, 100_000])
def test_intervals_hold_the_truth_however_many_the_answers(trials: int) -> None:
    """Of 150 people in all tasks and shapes; a 95% interval misses more than 14 of 150 in 1%."""
    rng = np.random.default_rng(2027)
    missed = 0
    for task in GUESS_RATE:
        for shape in get_args(Shape):
            for _ in range(25):
                answers, truth = answers_of_a_person(rng, trials, task, shape)
                low, high = fitted(*answers, task=task, shape=shape).threshold_ci
                missed += not low < truth < high
    assert missed <= 14


@pytest.mark.parametrize("beyond_chance", [None, 0.9])
@pytest.mark.parametrize("task", GUESS_RATE)
def test_finer_cells_give_the_same_intervals(
    monkeypatch: pytest.MonkeyPatch, task: Task, beyond_chance: float | None
) -> None:
    """To 5% of them, where the threshold is far up the curve, too."""
    rng, chance = np.random.default_rng(9), GUESS_RATE[task]
    at = beyond_chance and chance + (1 - chance) * beyond_chance
    for shape in get_args(Shape):
        for trials in (40, 40_000):
            answers, _ = answers_of_a_person(rng, trials, task, shape)
            ends = []
            for cells in (curve_posterior.FINE, ((32, 28, 12, 1), (24, 20, 8, 8))):
                monkeypatch.setattr(curve_posterior, "FINE", cells)
                found = fitted(*answers, task=task, shape=shape, threshold_at=at)
                ends.append(found.threshold_ci)
            assert ends[0] == pytest.approx(ends[1], abs=0.05 * np.ptp(ends[1]))
            monkeypatch.undo()
