"""Virtual participants: answers and scores follow from the friction they feel."""

import math
import subprocess
import sys
from dataclasses import dataclass, field, replace
from typing import Any

import pytest

from device.people.person import Person
from protocol.study.rules import PAPERS_SCALE, Rating
from protocol.study.study_question import ANSWERS, Question, StudyQuestion
from protocol.study_file.loading import parsed_study, template
from runner.people.virtual_participant import VirtualParticipant, VirtualParticipantLeft
from runner.screens import Ask, Instruction, Notice, Pacing, ask_change, ask_rating, ask_score
from tests.protocol.studies import OWN_QUESTIONS
from tests.runner.fakes import FakeClock

EXACT = Person(
    bias=2.0, gain=5.0, felt_noise=0.0, rating_noise=0.0, criterion=0.01, criterion_less=0.01
)


class FakeHand:
    """A hand that feels the friction of `feels`, a function of the share of a touch of 1 s."""

    def __init__(self) -> None:
        self.clock = FakeClock()
        self.began_s = 0.0
        self.feels: Any = lambda fraction: 0.4

    def touch(
        self, force_n: float, position_m: float, direction: str, speed_m_s: float = 0.0
    ) -> float:
        return float(self.feels(self.clock.monotonic_s() - self.began_s))

    def lift(self) -> None: ...


def participant(control: Any, person: Person = EXACT, seed: int = 1) -> VirtualParticipant:
    name = f"{seed}/P01/1"
    return VirtualParticipant(control=control, clock=control.clock, person=person, name=name)


def felt(
    touches: list[Any],
    question: Question,
    resting: float = 0.4,
    scale: Rating = PAPERS_SCALE,
    person: Person = EXACT,
    seed: int = 1,
) -> tuple[str, int]:
    """Let a participant feel the resting beam, then `touches`, then ask."""
    control = FakeHand()
    virtual = participant(control, person, seed)
    _touch(virtual, control, lambda _: resting)
    virtual.show(Instruction(text="remember"))
    assert virtual.poll() is not None
    for touch in touches:
        _touch(virtual, control, touch)
    virtual.show(ask_change(question))
    change = virtual.poll()
    virtual.show(ask_score(scale))
    score = virtual.poll()
    assert change is not None
    assert score is not None
    assert change.answer in ANSWERS[question]
    return change.answer, int(score.answer)


RIGHT = Pacing(
    start_m=0.01, end_m=0.08, duration_s=1.0, force_n=0.5, direction="right", harder=False
)
LEFT = replace(RIGHT, start_m=0.08, end_m=0.01, direction="left")
HELD = replace(RIGHT, start_m=0.04, end_m=0.04)


def _touch(
    virtual: VirtualParticipant, control: FakeHand, feels: Any, pacing: Pacing = HELD
) -> None:
    control.feels, control.began_s = feels, control.clock.monotonic_s()
    virtual.show(pacing)
    for _ in range(20):
        control.clock.sleep(0.05)
        assert virtual.poll() is None
    virtual.show(Notice(text="touch.end"))
    assert virtual.poll() is None


@pytest.mark.parametrize(
    ("touches", "question", "answer", "contrast"),
    [
        ([lambda _: 0.3], "roughness", "smoother", math.log(0.4 / 0.3)),
        ([lambda _: 0.5], "roughness", "rougher", math.log(0.4 / 0.5)),
        ([lambda _: 0.4], "roughness", "same", 0.0),
        ([lambda x: 0.4 - 0.1 * x], "roughness", "smoother", math.log(0.4 / 0.3)),
        ([lambda x: 0.3 + 0.1 * x], "roughness", "rougher", math.log(0.3 / 0.4)),
        ([lambda _: 0.3, lambda _: 0.2], "roughness", "smoother", math.log(0.3 / 0.2)),
        ([lambda _: 0.38, lambda _: 0.3], "strength", "stronger", math.log(0.38 / 0.3)),
        ([lambda _: 0.3, lambda _: 0.38], "strength", "weaker", -math.log(0.38 / 0.3)),
        ([lambda _: 0.3, lambda _: 0.3], "places", "not swapped", 0.0),
        ([lambda _: 0.3, lambda _: 0.6], "places", "swapped", math.log(2)),
    ],
)
def test_the_answer_and_the_score_follow_the_felt_friction(
    touches: list[Any], question: Question, answer: str, contrast: float
) -> None:
    assert felt(touches, question) == (answer, round(2 + 5 * abs(contrast)))


def test_a_ramp_is_felt_to_its_end_although_ticks_are_rounded() -> None:
    control = FakeHand()
    virtual = participant(control)
    _touch(virtual, control, lambda _: 0.4)
    virtual.show(Instruction(text="remember"))
    virtual.poll()
    control.feels = lambda part: 0.4 - 0.1 * part
    control.clock.passed_s = control.began_s = 0.0
    virtual.show(HELD)
    for _ in range(10):
        control.clock.sleep(0.1)
        virtual.poll()
    assert control.clock.monotonic_s() - control.began_s < HELD.duration_s, "ticks are rounded"
    virtual.show(Notice(text="touch.end"))
    virtual.show(ask_change("roughness"))
    change = virtual.poll()
    assert change is not None
    assert change.answer == "smoother"


def test_a_score_stays_on_the_scale() -> None:
    assert felt([lambda _: 0.01], "roughness")[1] == 10


@pytest.mark.parametrize(("friction", "share"), [(0.01, 1.0), (0.4, 0.2), (10.0, 1.0)])
def test_a_score_is_as_far_between_the_ends_of_any_scale(friction: float, share: float) -> None:
    for minimum, maximum in ((0, 100), (1, 6), (100, 110)):
        scale = Rating(minimum=minimum, maximum=maximum)
        found = felt([lambda _: friction], "roughness", scale=scale)[1]
        assert found == minimum + share * (maximum - minimum)


def test_a_change_in_the_opposite_direction_has_the_same_score() -> None:
    there, back = (
        felt([lambda _: first, lambda _: last], "roughness")  # noqa: B023 - called at once
        for first, last in ((0.4, 0.2), (0.2, 0.4))
    )
    assert (there[0], back[0]) == ("smoother", "rougher")
    assert there[1] == back[1] == round(2 + 5 * math.log(2))


@pytest.mark.parametrize("question", parsed_study(template("paper") + OWN_QUESTIONS).question)
def test_a_studys_own_question_gets_an_answer_that_it_allows(question: StudyQuestion) -> None:
    answers = set()
    for seed in range(60):
        virtual = participant(FakeHand(), seed=seed)
        virtual.show(Ask(question=question))
        response = virtual.poll()
        assert response is not None
        answers.add(question.answer(response.answer))
    assert len(answers) >= 3
    assert (None in answers) == (not question.required)


def test_a_further_question_leaves_answers_and_scores_alone() -> None:
    own = parsed_study(template("paper") + OWN_QUESTIONS).question[0]
    noisy = replace(EXACT, felt_noise=0.2, rating_noise=2.0)
    plain, asked = (participant(FakeHand(), noisy) for _ in range(2))
    for _ in range(5):
        asked.show(Ask(question=own))
        asked.poll()
        assert answered(plain) == answered(asked)


def answered(virtual: VirtualParticipant) -> tuple[str, str]:
    said = []
    for touch in (lambda _: 0.4, lambda _: 0.35):
        assert isinstance(virtual.control, FakeHand)
        _touch(virtual, virtual.control, touch)
    for ask in (ask_change("roughness"), ask_score(PAPERS_SCALE)):
        virtual.show(ask)
        response = virtual.poll()
        assert response is not None
        said.append(response.answer)
    return said[0], said[1]


def test_one_who_drops_out_leaves_at_a_question() -> None:
    virtual = participant(FakeHand(), replace(EXACT, dropout=1.0))
    with pytest.raises(VirtualParticipantLeft, match="1/P01/1 has left"):
        answered(virtual)


WRONG = replace(EXACT, force_factor=1.2, speed_factor=0.8, place_offset_m=1e-3)


@dataclass
class Beam:
    """A beam that notes every touch: force, place, direction, speed."""

    clock: FakeClock = field(default_factory=FakeClock)
    felt: list[tuple[float, float, str, float]] = field(default_factory=list)

    def touch(
        self, force_n: float, position_m: float, direction: str, speed_m_s: float = 0.0
    ) -> float:
        self.felt.append((force_n, position_m, direction, speed_m_s))
        return 0.4

    def lift(self) -> None: ...


def followed(pacing: Pacing, person: Person, tick_s: float = 0.05) -> Beam:
    beam = Beam()
    virtual = participant(beam, person)
    virtual.show(pacing)
    for _ in range(round(pacing.duration_s / tick_s)):
        beam.clock.sleep(tick_s)
        virtual.poll()
    virtual.show(Notice(text="touch.end"))
    return beam


@pytest.mark.parametrize("pacing", [RIGHT, LEFT, HELD])
def test_the_finger_is_wrong_as_it_says(pacing: Pacing) -> None:
    felt = followed(pacing, WRONG).felt
    sign = {"right": 1, "left": -1}[pacing.direction]
    way_m = pacing.end_m - pacing.start_m
    assert felt[0][1] == pytest.approx(pacing.start_m + 1e-3)
    assert felt[-1][1] == pytest.approx(pacing.start_m + 1e-3 + 0.8 * way_m)
    assert {force for force, *_ in felt} == {0.6}
    assert {round(speed, 9) for *_, speed in felt} == {round(0.8 * sign * way_m, 9)}


def test_a_fast_finger_stops_where_the_mark_will() -> None:
    assert followed(RIGHT, replace(EXACT, speed_factor=1.5)).felt[-1][1::2] == (0.08, 0.0)


def test_a_trembling_finger_presses_about_its_mean() -> None:
    forces = [force for force, *_ in followed(HELD, replace(WRONG, tremor=0.05)).felt]
    mean = sum(forces) / len(forces)
    assert mean == pytest.approx(0.6, rel=0.03)
    assert max(forces) > 1.03 * mean > 0.97 * mean > min(forces)


@pytest.mark.parametrize("pacing", [RIGHT, LEFT, HELD])
def test_what_it_feels_does_not_depend_on_how_often_it_is_looked_at(pacing: Pacing) -> None:
    rare, often = (
        {place_m for _, place_m, *_ in followed(pacing, WRONG, tick_s).felt}
        for tick_s in (1.0, 0.01)
    )
    assert rare <= often, "it notes what it feels at the same places, and is at others meanwhile"
    assert len(rare) == (1 if pacing is HELD else 25)


def test_a_single_slide_is_compared_with_the_beam_at_rest() -> None:
    control = FakeHand()
    virtual = participant(control)
    _touch(virtual, control, lambda _: 0.4)
    virtual.show(Instruction(text="remember"))
    virtual.poll()
    _touch(virtual, control, lambda share: 0.3 + 0.1 * share, RIGHT)
    virtual.show(ask_change("roughness"))
    response = virtual.poll()
    assert response is not None
    assert response.answer == "smoother"


_FIRST_TOUCH = """
import sys
from tests.runner.people.test_virtual_participant import HELD, FakeHand, participant

virtual = participant(FakeHand())
before = set(sys.modules)
virtual.show(HELD)
print(sorted(sys.modules.keys() - before))
"""


def test_a_touch_waits_for_no_module_to_be_loaded() -> None:
    """The output is on meanwhile, and a busy computer may take a second for it."""
    # In a process of its own, because other tests have loaded everything here.
    command = [sys.executable, "-c", _FIRST_TOUCH]
    first = subprocess.run(command, capture_output=True, text=True, check=True)
    assert first.stdout == "[]\n"


def rated(
    feels: float, scale: Rating, resting: float = 0.4, person: Person = EXACT, seed: int = 1
) -> int:
    """Let a participant feel one touch, then ask for its score."""
    control = FakeHand()
    virtual = participant(control, person, seed)
    _touch(virtual, control, lambda _: feels)
    control.feels = lambda _: resting  # the output is off
    virtual.show(ask_rating(scale))
    score = virtual.poll()
    assert score is not None
    return int(score.answer)


TO_100 = Rating(minimum=0, maximum=100)


@pytest.mark.parametrize(
    ("scale", "gain", "feels", "score"),
    [
        # 2 + 5 ln(mu' / mu) of the paper's scale, as far between the ends of the study's.
        (TO_100, 5.0, 0.4, 20),
        (TO_100, 5.0, 0.5, round(20 + 50 * math.log(0.5 / 0.4))),
        (TO_100, 5.0, 0.35, round(20 + 50 * math.log(0.35 / 0.4))),
        (TO_100, -5.0, 0.35, round(20 - 50 * math.log(0.35 / 0.4))),
        (TO_100, 5.0, 0.1, 0),
        (Rating(minimum=1, maximum=7), 5.0, 0.6, round(2.2 + 3 * math.log(0.6 / 0.4))),
        (Rating(minimum=-3, maximum=3), 5.0, 0.4, round(-3 + 1.2)),
        (Rating(minimum=-3, maximum=3), 5.0, 4.0, 3),
    ],
)
def test_a_rating_is_level_and_gain_times_what_is_felt_with_its_sign(
    scale: Rating, gain: float, feels: float, score: int
) -> None:
    assert rated(feels, scale, person=replace(EXACT, gain=gain)) == score


def test_ratings_are_noisy_and_use_all_numbers_of_the_scale() -> None:
    noisy = replace(EXACT, bias=5.0, rating_noise=1.5)
    given = [rated(0.4, Rating(minimum=1, maximum=7), person=noisy, seed=it) for it in range(200)]
    assert sum(given) / 200 == pytest.approx(4.0, abs=0.2)
    assert {2, 3, 4, 5, 6} <= {*given} <= {*range(1, 8)}
    few = replace(noisy, number_step=2.0)
    coarse = {rated(0.4, TO_100, person=few, seed=it) for it in range(100)}
    assert all(score % 2 == 0 for score in coarse)
    low = replace(noisy, bias=10.0, ceiling=8.0)
    assert max(rated(0.4, TO_100, person=low, seed=it) for it in range(50)) == 80


def test_who_does_not_attend_rates_as_at_rest() -> None:
    absent = replace(EXACT, lapse=1.0)
    assert rated(0.2, TO_100, person=absent) == 20
