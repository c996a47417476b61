"""Texts: both languages say the same things."""

import pytest

from protocol.plan.plan import plan
from protocol.study.questions import ANSWERS, checked_answer
from protocol.study.texts import TEXTS, band_names, touch_text
from protocol.study_file.loading import parsed_study, template

STUDY = parsed_study(template("paper"))


def test_both_languages_have_the_same_texts() -> None:
    assert TEXTS["en"].keys() == TEXTS["zh"].keys()


def test_every_question_answer_and_touch_has_a_text() -> None:
    for question, answers in ANSWERS.items():
        assert f"question.{question}" in TEXTS["en"]
        assert {f"answer.{answer}" for answer in answers} <= TEXTS["en"].keys()
    touches = [touch for trial in plan(STUDY, 0).trials for touch in trial.touches]
    assert {touch_text(touch) for touch in touches} <= TEXTS["en"].keys()


def test_bands_are_named_with_their_scores() -> None:
    assert band_names(STUDY.rating, "en")[1] == "1-4 very weak"
    assert band_names(STUDY.rating, "zh")[0] == "0 无效果"


def test_an_answer_to_another_question_is_refused() -> None:
    with pytest.raises(ValueError, match="smoother, rougher, same, got 'swapped'"):
        checked_answer("roughness", "swapped")


def test_a_score_beyond_the_scale_is_refused() -> None:
    with pytest.raises(ValueError, match=r"rating must lie in \[0, 10\], got 11"):
        STUDY.rating.checked_score(11)
