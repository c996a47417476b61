"""QUEST+ against recorded choices of questplus, and each method against what it promises."""

import json
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from device.tracks.expected import expected
from device.tracks.next_level import Answer, levels_of, next_level
from device.tracks.posterior import choices, correct_share, estimate, lattice, report_lattice
from protocol.study.track import GUESS_RATE, Track
from protocol.tracks.procedure import constant_order

CHOICES = json.loads((Path(__file__).parent / "questplus_choices.json").read_text())
"""Made with questplus 2023.1: task, shape, lowest and highest level, their number, range of slopes,
largest lapse rate, answers as (level, correct), and the level that it chose."""


def track(**keys: Any) -> Track:
    usual: dict[str, Any] = {
        "name": "a threshold",
        "task": "two intervals",
        "method": "quest+",
        "axis": "voltage",
        "levels": {"from": 4, "to": 160, "count": 41},
        "standard": {"place": "path", "voltage_v": 0},
        "comparison": {"place": "path"},
        "trials": 40,
    }
    return Track.model_validate({**usual, **keys})


@pytest.mark.parametrize("row", CHOICES, ids=map(str, range(len(CHOICES))))
def test_questplus_chose_the_same_level(row: Any) -> None:
    task, shape, first, last, count, slope, lapse, answers, theirs = row
    chance = GUESS_RATE[task]
    # Its thresholds are Weibull's scale and the normal curve's mean.
    at = 1 - np.exp(-1) if shape == "weibull" else 0.5
    asked = track(
        task=task,
        shape=shape,
        levels={"from": first, "to": last, "count": count},
        slope=slope,
        lapse=[0.0, lapse],
        threshold_at=float(chance + (1 - chance) * at),
        false_alarms=[0.02, 0.02],
    )
    told = [Answer(level, bool(correct)) for level, correct in answers]
    assert next_level(asked, told) == theirs


def test_the_order_of_sums_does_not_change_a_choice() -> None:
    asked, random = track(), np.random.default_rng(5)
    grid = lattice(asked)
    for _ in range(50):
        many = random.integers(0, 60)
        told = [Answer(*pair) for pair in random.integers(0, [41, 2], (many, 2)).tolist()]
        weights = grid.weights(told)
        shuffled = random.permutation(weights.size)
        told_more = grid.right[:, shuffled] @ weights[shuffled]
        information = grid.information[:, shuffled] @ weights[shuffled]
        wrong = 1 - told_more
        entropy = told_more * np.log(told_more) + wrong * np.log(wrong) - information
        assert int(entropy.round(10).argmin()) == choices(asked, weights[np.newaxis])[0]


def test_the_curve_has_its_share_at_the_threshold() -> None:
    for shape, slope in (("weibull", 2.7), ("normal", 0.1)):
        for task in GUESS_RATE:
            asked = track(shape=shape, task=task, threshold_at=0.8)
            at, steep, none = (np.array(value) for value in (30.0, slope, 0.0))
            guess = GUESS_RATE[task] or 0.02
            share = (0.8 - GUESS_RATE[task]) / (1 - GUESS_RATE[task])
            found = correct_share(asked, at, at, steep, none, np.array(0.02))
            assert found == pytest.approx(guess + (1 - guess) * share, abs=1e-12)


def simulated(
    asked: Track, threshold: float, seed: str, slope: float = 3.0, lapse: float = 0.02
) -> list[Answer]:
    """Return the answers of somebody with this threshold, slope and lapse rate."""
    random, told = Random(seed), list[Answer]()
    order = constant_order(asked, 1, seed)
    while (level := next_level(asked, told, order)) is not None:
        distance = asked.distances[level]
        share = correct_share(asked, *map(np.array, (distance, threshold, slope, lapse, 0.1)))
        told.append(Answer(level, bool(random.random() < share)))
    return told


@pytest.mark.parametrize(
    "keys",
    [
        {},
        {"mercy": 2},
        {"method": "constant", "levels": {"from": 8, "to": 80, "count": 8}, "trials": 80},
        {"method": "staircase", "rule": "3 down 1 up", "step_levels": [5, 5, 1], "trials": 80},
        {"method": "staircase", "rule": "1 down 1 up", "step_levels": [2], "up_step_levels": [6]},
        {"task": "three intervals"},
        {"task": "yes or no"},
        {"task": "yes or no", "method": "limits", "trials": 120},
    ],
)
def test_a_threshold_is_recovered(keys: dict[str, Any]) -> None:
    asked = track(**keys)
    inside = errors = 0.0
    for number in range(40):
        found = estimate(asked, simulated(asked, 25.0, f"recovered {number}"))
        inside += found.threshold_ci[0] <= 25 <= found.threshold_ci[1]
        errors += (20 * np.log10(found.threshold / 25)) ** 2 / 40
    assert inside >= 36
    assert np.sqrt(errors) < 4


def test_the_steepest_curve_is_a_step_and_no_warning() -> None:
    found = estimate(track(slope=[1e6, 1e6]), [Answer(30, True), Answer(3, False)])
    assert 3 < found.threshold < 100


def test_what_is_expected_is_what_single_tracks_give() -> None:
    # People with slopes and lapse rates that the track assumes and beyond, one by one.
    asked = track(trials=30, slope=[2, 3], lapse=[0.02, 0.02])
    told = expected(asked)
    random = Random("observers")
    grid, squares = report_lattice(asked), []
    for number in range(120):
        threshold = 4 * 40 ** random.uniform(0.1, 0.9)
        slope, lapse = random.uniform(2, 4.8), random.uniform(0.02, 0.15)
        answers = simulated(asked, threshold, f"expected {number}", slope, lapse)
        middle = grid.interval(grid.weights(answers)[np.newaxis])[0, 0].clip(4, 160)
        squares.append((20 * np.log10(middle / threshold)) ** 2)
    assert told.trials == 30
    assert told.rmse_db == pytest.approx(np.sqrt(np.mean(squares)), rel=0.3)
    assert expected(asked) == told


@pytest.mark.parametrize("shape", ["weibull", "normal"])
@pytest.mark.parametrize("task", GUESS_RATE)
def test_the_prior_of_a_report_is_not_that_of_the_track(task: Any, shape: Any) -> None:
    """The same answers are told alike, whatever slopes and lapse rates the track assumes."""
    wide = track(task=task, shape=shape)
    narrow = track(task=task, shape=shape, slope=[0.5, 0.5], lapse=[0.0, 0.0])
    counted = np.zeros((1, 2, 41))
    counted[0, 1, 10:] = 2
    counted[0, 0, :25] = 2
    told = [each.interval(each.posterior(counted)) for each in map(report_lattice, (wide, narrow))]
    assert told[0] == pytest.approx(told[1])
    # Without an answer anything within the levels and somewhat beyond is possible.
    middle, low, high = report_lattice(wide).interval(report_lattice(wide).posterior(0 * counted))
    assert low < 8 < middle < high
    assert high > 150


def test_more_trials_and_a_stop_change_what_is_expected() -> None:
    short, long = expected(track(trials=20)), expected(track(trials=80))
    assert long.rmse_db < short.rmse_db
    assert long.interval_db < short.interval_db
    stopped = expected(track(trials=80, stop={"interval_db": 9}))
    assert 20 < stopped.trials < 80
    turned = track(method="staircase", rule="2 down 1 up", step_levels=[1], trials=80)
    assert expected(turned.model_copy(update={"trials": 40})).trials == 40


def test_a_track_ends_at_its_stop_and_never_later() -> None:
    asked = track(stop={"interval_db": 8}, trials=100)
    told = simulated(asked, 25.0, "stop")
    assert len(told) < 100
    before, after = lattice(asked), told[:-1]
    widths = []
    for some in (after, told):
        _, low, high = before.interval(before.weights(some)[np.newaxis])[:, 0]
        widths.append(20 * np.log10(high / low))
    assert widths[0] > 8 >= widths[1]
    turned = track(
        method="staircase", rule="1 down 1 up", step_levels=[1], stop={"reversals": 3}, start=25.3
    )
    answers = [True, False, True, False, True, False]
    assert len(levels_of(turned, answers)) == 4


def test_after_an_error_mercy_asks_nothing_harder() -> None:
    asked, random = track(mercy=2, trials=60), Random("mercy")
    told: list[Answer] = []
    while (level := next_level(asked, told)) is not None:
        missed = [answer.level for answer in told[-2:] if not answer.correct]
        assert level >= max(missed, default=0)
        told.append(Answer(level, random.random() < 0.8))


def test_no_method_names_a_level_beyond_the_grid() -> None:
    random = Random("all methods")
    for _ in range(400):
        count, first = random.randint(2, 12), random.uniform(0.5, 50)
        method = random.choice(["quest+", "staircase", "limits", "constant"])
        asked = track(
            method=method,
            task="yes or no" if method == "limits" else random.choice(list(GUESS_RATE)),
            levels={"from": first, "to": first * random.uniform(1.5, 40), "count": count},
            shape=random.choice(["weibull", "normal"]),
            trials=random.randint(1, 15),
            mercy=random.randint(0, 2),
            rule="2 down 1 up",
            step_levels=[random.randint(1, 20)],
        )
        order = constant_order(asked, 1)
        told = levels_of(asked, [random.random() < 0.6 for _ in range(20)], order)
        assert len(told) == asked.trials
        for answer in told:
            assert 0 <= answer.level < count
            assert asked.at(answer.level).voltage_v <= max(asked.values)
