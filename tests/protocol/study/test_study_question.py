"""What each kind of question takes for an answer."""

import pytest

from protocol.study.study_question import Answer, StudyQuestion
from protocol.study_file.loading import parsed_study, template
from tests.protocol.studies import OWN_QUESTIONS

STUDY = parsed_study(template("paper") + OWN_QUESTIONS)
ASKED = {question.name: question for question in STUDY.question}


@pytest.mark.parametrize(
    ("name", "given", "answer"),
    [
        ("pleasantness", "4", 4),
        ("confidence", "0.1", 0.1),
        ("confidence", "100", 100),
        ("confidence", "33.3", 33.3),
        ("sensations", "warmth", ("warmth",)),
        ("sensations", "sticking;vibration", ("vibration", "sticking")),
        ("hand", "both", "both"),
        ("age", "18", 18),
        ("remarks", "x" * 120, "x" * 120),
        ("remarks", "", None),
    ],
)
def test_an_answer_is_read(name: str, given: str, answer: Answer) -> None:
    assert ASKED[name].answer(given) == answer


@pytest.mark.parametrize(
    ("name", "given", "rule"),
    [
        ("pleasantness", "8", "lie on the scale from 1 to 7"),
        ("pleasantness", "1.5", "lie on the scale from 1 to 7"),
        ("pleasantness", "", "lie on the scale from 1 to 7"),
        ("confidence", "0.05", "lie on the scale from 0 to 100"),
        ("sensations", "warmth;cold", "be some of vibration, warmth, sticking, slipping, none"),
        ("sensations", "", "be some of vibration"),
        ("hand", "foot", "be one of left, right, both"),
        ("age", "17", "be a whole number, at least 18, at most 99"),
        ("age", "20.5", "be a whole number"),
        ("age", "old", "be a whole number"),
        ("remarks", "x" * 121, "have 1 to 120 characters"),
    ],
)
def test_any_other_is_refused(name: str, given: str, rule: str) -> None:
    with pytest.raises(ValueError, match=f"the answer to {name} must {rule}.*got '{given}'"):
        ASKED[name].answer(given)


@pytest.mark.parametrize(
    ("given", "answer"), [("-0.5", -0.5), ("1,25", 1.25), ("+2.", 2), ("3.00", 3)]
)
def test_a_number_may_have_decimals_and_a_sign(given: str, answer: Answer) -> None:
    question = StudyQuestion(name="x", kind="number", decimals=2)
    assert question.answer(given) == answer
    for wrong in ("1.234", "1e3", "nan", "--1", "１", ""):
        with pytest.raises(ValueError, match=f"a number with at most 2 decimals, got '{wrong}'"):
            question.answer(wrong)


def test_every_place_of_a_scale_is_an_answer() -> None:
    scale = StudyQuestion(name="x", kind="scale", minimum=-0.3, maximum=0.3, step=0.1)
    places = [scale.place(number) for number in range(scale.places + 1)]
    assert places == [-0.3, -0.2, -0.1, 0, 0.1, 0.2, 0.3]
    assert [scale.answer(str(place)) for place in places] == places


def test_questions_are_asked_after_the_trials_that_they_name() -> None:
    def after(condition: str | None) -> list[str]:
        return [question.name for question in STUDY.questions_after(condition)]

    assert after("voltage") == ["pleasantness", "confidence"]
    assert after("frequency") == ["pleasantness"]
    assert after(None) == []


def test_a_question_of_the_first_session_is_asked_once() -> None:
    assert [question.name for question in STUDY.questions("before", 1)] == ["hand", "age"]
    assert STUDY.questions("before", 2) == ()
