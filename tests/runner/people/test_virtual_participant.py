"""Virtual participants: answers and scores follow from the friction they feel."""

import math
import random
from typing import Any

import pytest

from protocol.study.questions import ANSWERS, Question
from protocol.study.rating import PAPERS_SCALE, Rating
from protocol.study.study_question import StudyQuestion
from protocol.study_file.loading import parsed_study, template
from runner.people.virtual_participant import Character, VirtualParticipant, drawn_character
from runner.screens import Ask, Instruction, Notice, Pacing, ask_change, ask_score
from tests.protocol.studies import OWN_QUESTIONS
from tests.runner.fakes import FakeClock

EXACT = Character(bias=2.0, gain=5.0, felt_noise=0.0, rating_noise=0.0, criterion=0.01)


class FakeHand:
    """A hand that feels the friction of `feels`, a function of the share of the path."""

    def __init__(self) -> None:
        self.feels: Any = lambda fraction: 0.4

    def touch(
        self, force_n: float, position_m: float, direction: str, speed_m_s: float = 0.0
    ) -> float:
        fraction = (position_m - 0.01) / 0.07
        return float(self.feels(fraction if direction == "right" else 1 - fraction))

    def lift(self) -> None: ...


def felt(
    touches: list[Any],
    question: Question,
    resting: float = 0.4,
    scale: Rating = PAPERS_SCALE,
    character: Character = EXACT,
    seed: int = 1,
) -> tuple[str, int]:
    """Let a participant feel the resting beam, then `touches`, then ask."""
    control, clock = FakeHand(), FakeClock()
    virtual = VirtualParticipant(
        control=control,
        clock=clock,
        character=character,
        random_stream=random.Random(seed),
    )
    _touch(virtual, control, clock, lambda _: resting)
    virtual.show(Instruction(text="remember"))
    assert virtual.poll() is not None
    for touch in touches:
        _touch(virtual, control, clock, touch)
    virtual.show(ask_change(question))
    change = virtual.poll()
    virtual.show(ask_score(scale))
    score = virtual.poll()
    assert change is not None
    assert score is not None
    assert change.answer in ANSWERS[question]
    return change.answer, int(score.answer)


def _touch(virtual: VirtualParticipant, control: FakeHand, clock: FakeClock, feels: Any) -> None:
    control.feels = feels
    way = Pacing(start_m=0.01, end_m=0.08, duration_s=1.0, force_n=0.5, direction="right")
    virtual.show(way)
    for _ in range(20):
        clock.sleep(0.05)
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


def test_false_alarms_are_as_rare_as_those_of_people() -> None:
    characters = [drawn_character(random.Random(seed)) for seed in range(1000)]
    rates = [math.erfc(who.criterion / who.felt_noise / math.sqrt(2)) for who in characters]
    assert min(rates) > 0.05
    assert max(rates) < 0.1
    answers = [
        felt([lambda _: 0.4, lambda _: 0.4], "roughness", character=who, seed=seed)[0]
        for seed, who in enumerate(characters)
    ]
    assert 1 - answers.count("same") / len(answers) == pytest.approx(0.073, abs=0.02)


@pytest.mark.parametrize("question", parsed_study(template("paper") + OWN_QUESTIONS).question)
def test_a_studys_own_question_gets_an_answer_that_it_allows(question: StudyQuestion) -> None:
    answers = set()
    for seed in range(60):
        virtual = VirtualParticipant(
            control=FakeHand(),
            clock=FakeClock(),
            character=EXACT,
            random_stream=random.Random(1),
            questions_stream=random.Random(seed),
        )
        virtual.show(Ask(question=question))
        response = virtual.poll()
        assert response is not None
        answers.add(question.answer(response.answer))
        assert virtual.random_stream.random() == random.Random(1).random()
    assert len(answers) >= 3
    assert (None in answers) == (not question.required)
