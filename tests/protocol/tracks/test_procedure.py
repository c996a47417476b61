"""Staircases and limits against PsychoPy's, published convergence, and their bounds."""

import json
from pathlib import Path
from random import Random
from typing import Any

import pytest

from protocol.study.track import Track
from protocol.tracks import procedure
from protocol.tracks.procedure import Answer, Staircase, converges_at


def track(**keys: Any) -> Track:
    """Return a checked track of `keys`; without any a staircase of 31 levels, 1 dB apart."""
    usual: dict[str, Any] = {
        "name": "a threshold",
        "task": "two intervals",
        "method": "staircase",
        "axis": "voltage",
        "levels": {"from": 5, "to": 158.11, "count": 31},
        "standard": {"place": "path", "voltage_v": 0},
        "comparison": {"place": "path"},
        "rule": "3 down 1 up",
        "step_db": [4, 4, 1],
        "trials": 60,
    }
    return Track.model_validate({**usual, **keys})


def levels_asked(asked: Track, answers: list[bool]) -> list[int]:
    """Return the level of each answer's trial."""
    place, found = procedure.start(asked), list[int]()
    for correct in answers:
        found.append(place.level)
        place = procedure.moved(asked, place, correct)
    return found


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of PsychoPy's own imports
@pytest.mark.parametrize("first", ["by the rule", "1 down 1 up"])
def test_plain_staircases_are_those_of_psychopy(first: str) -> None:
    from psychopy.data import StairHandler

    random = Random(f"psychopy, {first}")
    for _ in range(150):
        down, up, top = random.randint(1, 4), random.randint(1, 3), random.randint(5, 40)
        steps = [random.randint(1, 6) for _ in range(random.randint(1, 4))]
        begin = random.randint(0, top)
        theirs = StairHandler(
            begin,
            nReversals=10**6,
            stepSizes=steps,
            nTrials=80,
            nUp=up,
            nDown=down,
            stepType="lin",
            minVal=0,
            maxVal=top,
            applyInitialRule=first == "1 down 1 up",
            autoLog=False,
            originPath=-1,  # no search for the experiment's file among all that is called
        )
        ours = track(
            levels={"values": list(range(1, top + 2))},
            start=begin + 1,
            rule=f"{down} down {up} up",
            step_db=(),
            step_levels=steps,
            first_reversal=first,
        )
        answers = [random.random() < 0.7 for _ in range(80)]
        for correct in answers:
            next(theirs)
            theirs.addResponse(int(correct))
        assert levels_asked(ours, answers) == theirs.intensities
        place = procedure.place_after(ours, map(Answer, theirs.intensities, answers))
        assert list(place.turned_at) == theirs.reversalIntensities


WEIGHTED = json.loads((Path(__file__).parent / "sweetspot_sequences.json").read_text())
"""Made with SweetSpot 1.15: highest level, steps down and up, first level, answers, levels."""


@pytest.mark.parametrize("row", WEIGHTED, ids=map(str, range(len(WEIGHTED))))
def test_weighted_staircases_are_those_of_sweetspot(row: Any) -> None:
    top, down, up, begin, answers, theirs = row
    ours = track(
        levels={"values": list(range(1, top + 2))},
        start=begin + 1,
        rule="1 down 1 up",
        step_db=(),
        step_levels=[down],
        up_step_levels=[up],
    )
    assert levels_asked(ours, [answer == "1" for answer in answers]) == theirs


def staircase(rule: str, streak: str = "consecutive", **steps: Any) -> Staircase:
    return procedure.staircase(track(rule=rule, streak=streak, **steps))


@pytest.mark.parametrize(
    ("rule", "streak", "share"),
    [
        # Levitt 1971, table I; the last is the mean of a count that errors do not reset.
        ("1 down 1 up", "consecutive", 0.5),
        ("2 down 1 up", "consecutive", 0.7071),
        ("3 down 1 up", "consecutive", 0.7937),
        ("4 down 1 up", "consecutive", 0.8409),
        ("1 down 2 up", "consecutive", 0.2929),
        ("3 down 1 up", "cumulative", 0.75),
    ],
)
def test_a_rule_converges_to_the_published_share(rule: str, streak: str, share: float) -> None:
    assert converges_at(staircase(rule, streak)) == pytest.approx(share, abs=5e-5)


def test_a_weighted_staircase_converges_where_its_steps_balance() -> None:
    # Kaernbach 1991: p x (step down) = (1 - p) x (step up).
    weighted = staircase("1 down 1 up", step_db=[1], up_step_db=[3])
    assert converges_at(weighted) == pytest.approx(0.75, abs=5e-5)


@pytest.mark.parametrize("rule", ["1 down 1 up", "3 down 1 up", "2 down 3 up"])
@pytest.mark.parametrize("first", ["by the rule", "1 down 1 up"])
def test_no_answers_give_more_reversals_than_are_said_to_be_possible(rule: str, first: str) -> None:
    from itertools import product

    asked = track(
        rule=rule,
        first_reversal=first,
        trials=9,
        start=28.12,
        levels={"from": 5, "to": 158.11, "count": 31, "spaced": "equal ratios"},
    )
    asked = asked.model_copy(update={"start": asked.values[15]})
    found = max(
        len(procedure.place_after(asked, map(Answer, [15] * 9, answers)).turned_at)
        for answers in product([True, False], repeat=9)
    )
    assert found == procedure.most_reversals(asked)


def test_limits_go_on_until_the_answer_changes_and_then_from_the_other_end() -> None:
    asked = track(method="limits", task="yes or no", levels={"values": [1, 2, 3, 4, 5]})
    answers = [True, True, False, False, False, False, True, True, True, True, True, True, False]
    # Descending to 2, ascending to 3, descending to the end without a change, ascending.
    assert levels_asked(asked, answers) == [4, 3, 2, 0, 1, 2, 3, 4, 3, 2, 1, 0, 0]
    place = procedure.place_after(asked, map(Answer, levels_asked(asked, answers), answers))
    assert place.turned_at == (2, 3)
    assert place.level == 1


def test_constant_stimuli_come_once_each_before_one_comes_again() -> None:
    asked = track(method="constant", levels={"values": [1, 2, 3, 4, 5]}, trials=20)
    order = procedure.constant_order(asked, 7, "slot", 0)
    for begin in range(0, 20, 5):
        assert sorted(order[begin : begin + 5]) == [0, 1, 2, 3, 4]
    assert order != procedure.constant_order(asked, 7, "slot", 1)


def test_no_level_beyond_the_grid_is_named() -> None:
    random = Random("levels")
    for _ in range(3000):
        top = random.randint(2, 30)
        asked = track(
            method=random.choice(["staircase", "limits"]),
            levels={"values": list(range(1, top + 1))},
            step_db=(),
            step_levels=[random.randint(1, 50) for _ in range(random.randint(1, 3))],
            up_step_levels=[random.randint(1, 50)],
            streak=random.choice(["consecutive", "cumulative"]),
            rule=f"{random.randint(1, 4)} down {random.randint(1, 4)} up",
        )
        place = procedure.start(asked)
        for _ in range(30):
            assert 0 <= place.level < top
            assert 0 <= asked.at(place.level).voltage_v <= top
            place = procedure.moved(asked, place, random.random() < 0.6)


def test_a_level_that_is_not_there_cannot_be_asked_for() -> None:
    with pytest.raises(IndexError, match="level 31 of 31"):
        track().at(31)
