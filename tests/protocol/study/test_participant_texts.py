"""Texts: everything that is asked has one, and bands have a name."""

from protocol.plan.plan import plan
from protocol.study.languages import built_in, reference_texts
from protocol.study.participant_texts import (
    band_names,
    numbers_touches,
    read_in_reference,
    study_wording,
    touch_text,
)
from protocol.study.study_question import ANSWERS
from protocol.study_file.loading import parsed_study, template

STUDY = parsed_study(template("paper"))


def test_every_question_answer_and_touch_has_a_text() -> None:
    for question, answers in ANSWERS.items():
        assert f"question.{question}" in reference_texts()
        assert {f"answer.{answer}" for answer in answers} <= reference_texts().keys()
    touches = [touch for trial in plan(STUDY, 0).trials for touch in trial.touches]
    assert {touch_text(touch) for touch in touches} <= reference_texts().keys()


def test_touches_are_numbered_in_languages_that_have_words_for_each() -> None:
    assert [numbers_touches(STUDY, "zh", touches) for touches in (1, 2, 3, 4)] == [
        False, True, True, False
    ]  # fmt: skip
    chinese = built_in("zh")
    older = {key: text for key, text in chinese.texts.items() if key != "interval.2"}
    study = STUDY.model_copy(
        update={"languages": {"zh": chinese.model_copy(update={"texts": older})}}
    )
    assert not numbers_touches(study, "zh", 2), "no page is half in English"
    assert "interval.2" not in read_in_reference(study, "zh"), "nor does anybody have to add it"


def test_bands_are_named_with_their_scores() -> None:
    assert band_names(STUDY.rating.bands, study_wording(STUDY, "en"))[1] == "1-4 very weak"
    assert band_names(STUDY.rating.bands, study_wording(STUDY, "zh"))[0] == "0 无效果"


def test_a_band_without_a_name_in_a_language_takes_that_of_the_language() -> None:
    study = parsed_study(template("paper").replace(', zh = "很弱"', ""))
    assert band_names(study.rating.bands, study_wording(study, "zh"))[1] == "1-4 很弱"
