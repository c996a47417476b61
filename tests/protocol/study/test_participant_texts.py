"""Texts: everything that is asked has one, and bands have a name."""

from protocol.plan.plan import plan
from protocol.study.languages import reference_texts
from protocol.study.participant_texts import band_names, study_wording, touch_text
from protocol.study.study_question import ANSWERS
from protocol.study_file.loading import parsed_study, template

STUDY = parsed_study(template("paper"))


def test_every_question_answer_and_touch_has_a_text() -> None:
    for question, answers in ANSWERS.items():
        assert f"question.{question}" in reference_texts()
        assert {f"answer.{answer}" for answer in answers} <= reference_texts().keys()
    touches = [touch for trial in plan(STUDY, 0).trials for touch in trial.touches]
    assert {touch_text(touch) for touch in touches} <= reference_texts().keys()


def test_bands_are_named_with_their_scores() -> None:
    assert band_names(STUDY.rating.bands, study_wording(STUDY, "en"))[1] == "1-4 very weak"
    assert band_names(STUDY.rating.bands, study_wording(STUDY, "zh"))[0] == "0 无效果"


def test_a_band_without_a_name_in_a_language_takes_that_of_the_language() -> None:
    study = parsed_study(template("paper").replace(', zh = "很弱"', ""))
    assert band_names(study.rating.bands, study_wording(study, "zh"))[1] == "1-4 很弱"
