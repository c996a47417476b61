"""The scale of scores: whole numbers between two ends, and bands that cover it."""

from typing import Any, get_args

import pytest
from pydantic import ValidationError

from protocol.errors import Problem
from protocol.study.languages import built_in, built_in_codes
from protocol.study.participant_texts import question_text, study_wording, worded_as_built
from protocol.study.rules import PAPERS_SCALE, Rating
from protocol.study.study_question import (
    MEANINGS,
    QUESTIONS,
    Effect,
    Question,
    change_question,
    score_question,
)
from protocol.study_file.loading import StudyError, parsed_study, template

PAPER = template("paper")
BANDS = PAPER[PAPER.index("bands = [") : PAPER.index("]\n", PAPER.index("bands = [")) + 2]
AT_0 = "{ at = 0, en = 'a', zh = 'a' }"
TO_100 = PAPER.replace(
    BANDS,
    """minimum = 0
maximum = 100
bands = [
  { from = 0, to = 10, en = "no effect" },
  { from = 11, to = 100, en = "very weak" },
]
""",
)


def problems(**keys: Any) -> list[Problem]:
    lines = "\n".join(f"{key} = {value}" for key, value in keys.items())
    with pytest.raises(StudyError) as caught:
        parsed_study(PAPER.replace(BANDS, f"{lines}\n"))
    return caught.value.problems


def test_an_answer_to_another_question_is_refused() -> None:
    with pytest.raises(ValueError, match="smoother, rougher, same, got 'swapped'"):
        change_question("roughness").answer("swapped")


def test_the_papers_scale_is_what_a_study_has_that_names_none() -> None:
    rating = parsed_study(PAPER).rating
    assert (rating.minimum, rating.maximum, rating.span) == (0, 10, PAPERS_SCALE.span)


def test_a_score_beyond_the_scale_is_refused() -> None:
    question = score_question(Rating(minimum=1, maximum=7))
    assert [question.answer(score) for score in ("1", "7")] == [1, 7]
    with pytest.raises(ValueError, match=r"must lie on the scale from 1 to 7, got '0'"):
        question.answer("0")
    for given in ("11", "7.5", "nan", "-1", "seven", ""):
        with pytest.raises(ValueError, match=rf"on the scale from 0 to 10, got '{given}'"):
            score_question(PAPERS_SCALE).answer(given)


def test_the_question_for_a_score_names_the_ends_of_the_studys_scale() -> None:
    study = parsed_study(TO_100)
    question = score_question(study.rating)
    asked = [question_text(question, study_wording(study, code)) for code in ("en", "zh")]
    assert asked == ["How strong is the change? 0 to 100", "变化有多强？0 到 100 分"]
    assert not worded_as_built(study), "other scores may not fit where the built-in ones do"


def test_a_study_may_ask_for_a_score_in_its_own_words() -> None:
    own = TO_100 + '\n[texts.en]\nscore = "How much, up to {maximum} from {minimum}?"\n'
    plain = TO_100 + '\n[texts.en]\nscore = "How much, from 0 to 100?"\n'
    asked = [
        question_text(score_question(study.rating), study_wording(study, "en"))
        for study in map(parsed_study, (own, plain))
    ]
    assert asked == ["How much, up to 100 from 0?", "How much, from 0 to 100?"]
    with pytest.raises(StudyError, match=r"must be \{maximum\}, \{minimum\} or none, got 'To \{m"):
        parsed_study(TO_100 + '\n[texts.en]\nscore = "To {maximum}"\n')
    with pytest.raises(StudyError, match=r"must be \{reference\}, got '\{reference:d\}'"):
        parsed_study(TO_100 + '\n[texts.en]\nconsent = "{reference:d}"\n')


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"minimum": -1001}, "rating.minimum: must be at least -1000, got -1001"),
        ({"maximum": 1001}, "rating.maximum: must be at most 1000, got 1001"),
        ({"maximum": 5.0}, "rating.maximum: must be a whole number, got 5.0"),
        ({"minimum": 10}, "rating: maximum must be above minimum = 10, got 10"),
        ({"minimum": 7, "maximum": 5}, "rating.maximum: must be above minimum = 7, got 5"),
        (
            {"maximum": 20, "bands": "[{ from = 0, to = 19, en = 'all' }]"},
            "rating.bands: must follow one another from 0 to 20, got 0-19",
        ),
        (
            {"minimum": 1, "bands": "[{ from = 0, to = 10, en = 'all' }]"},
            "rating.bands: must follow one another from 1 to 10, got 0-10",
        ),
        ({"labels": "[{ at = 11, en = 'a', zh = 'a' }]"}, "at whole numbers from 0 to 10, got 11"),
        ({"labels": "[{ at = 0.5, en = 'a', zh = 'a' }]"}, "whole numbers from 0 to 10, got 0.5"),
        ({"labels": f"[{AT_0}, {AT_0}]"}, "scores that differ, got 0 twice"),
        ({"labels": "[{ value = 'x', en = 'a', zh = 'a' }]"}, "each have a score alone"),
        ({"labels": "[{ en = 'a', zh = 'a' }]"}, "each have a score alone"),
        ({"labels": "[{ at = 0, en = 'a' }]"}, "rating.labels.0.zh: must be given"),
        ({"labels": "[{ at = 0, en = 'a', zh = 'a', fr = 'a' }]"}, "unknown key, got 'fr'"),
        (
            {
                "labels": f"[{AT_0}]",
                "bands": "[{ from = 0, to = 10, en = 'all', zh = 'a' }]",
            },
            "rating.labels: must be left out where bands are given, got both",
        ),
        ({"bands": f"[{{ from = 0, to = {10**9}, en = 'all' }}]"}, "must be at most 1000, got 1"),
    ],
)
def test_a_scale_that_cannot_be_is_refused(keys: dict[str, Any], told: str) -> None:
    found = problems(**keys)
    assert any(told in str(problem) for problem in found), found


def test_a_scale_is_refused_without_a_study_file_too() -> None:
    with pytest.raises(ValidationError, match="maximum must be above minimum = 3, got 3"):
        Rating(minimum=3, maximum=3)


def test_every_question_is_defined_once() -> None:
    assert tuple(QUESTIONS) == get_args(Question)
    for asked in QUESTIONS.values():
        assert asked.effect in get_args(Effect)
        assert len(asked.answers) in (2, 3)
    assert MEANINGS.keys() == {answer for asked in QUESTIONS.values() for answer in asked.answers}


@pytest.mark.parametrize("question", QUESTIONS)
def test_every_question_and_answer_has_a_text_in_every_language(question: Question) -> None:
    keys = {f"question.{question}", *(f"answer.{answer}" for answer in QUESTIONS[question].answers)}
    for code in built_in_codes():
        assert keys <= built_in(code).texts.keys()
