"""Texts: everything that is asked has one, and bands have a name."""

import pytest

from protocol.plan.plan import plan
from protocol.study.languages import built_in, reference_texts
from protocol.study.participant_texts import (
    band_names,
    numbers_touches,
    question_text,
    read_in_reference,
    required_texts,
    scale_in_words,
    study_wording,
    touch_text,
)
from protocol.study.rules import Rating
from protocol.study.study_question import ANSWERS, RATING, score_question
from protocol.study_file.loading import parsed_study, template
from tests.protocol.studies import unasked

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


RATED = parsed_study(unasked(template("paper")))


@pytest.mark.parametrize(
    ("code", "words"), [("en", ("change", "effect")), ("zh", ("变化", "效果"))]
)
def test_a_rating_is_asked_for_without_a_word_on_a_change(
    code: str, words: tuple[str, ...]
) -> None:
    scale = Rating(minimum=-3, maximum=3)
    wording = study_wording(RATED, code)
    told = question_text(score_question(scale, RATING), wording)
    assert "-3" in told
    assert "3" in told
    assert not any(word in told for word in words)
    assert all(word not in wording.texts["hint.score"] for word in words)
    assert any(word in question_text(score_question(scale), wording) for word in words)


def test_a_study_says_what_is_rated_in_its_own_words() -> None:
    own = '\n[texts.en]\nrating = "How rough? {minimum} to {maximum}"\n'
    study = parsed_study(unasked(template("paper")) + own)
    told = question_text(score_question(study.rating, RATING), study_wording(study, "en"))
    assert told == "How rough? 0 to 10"
    bare = parsed_study(unasked(template("paper")) + '\n[texts.en]\nrating = "How rough?"\n')
    asked = score_question(bare.rating, RATING)
    assert question_text(asked, study_wording(bare, "en")) == "How rough?"


def test_a_language_without_the_words_for_ratings_serves_studies_that_ask_for_none() -> None:
    english = built_in("en")
    older = {key: text for key, text in english.texts.items() if key != "rating"}
    languages = {"fr": english.model_copy(update={"texts": older})}
    asked, rated = (it.model_copy(update={"languages": languages}) for it in (STUDY, RATED))
    assert "rating" not in required_texts(asked)
    assert "rating" not in read_in_reference(asked, "fr")
    assert "rating" in required_texts(rated)


def test_a_scale_is_said_with_its_labels_or_bands() -> None:
    ends = [{"at": -3, "en": "smooth", "zh": "a"}, {"at": 3, "en": "rough", "zh": "b"}]
    labelled = Rating.model_validate({"minimum": -3, "maximum": 3, "labels": ends})
    assert scale_in_words(STUDY, labelled) == "-3 to 3 (-3: smooth; 3: rough)"
    bands = [{"from": -3, "to": -1, "en": "less"}, {"from": 0, "to": 3, "en": "more"}]
    banded = Rating.model_validate({"minimum": -3, "maximum": 3, "bands": bands})
    assert scale_in_words(STUDY, banded) == "-3 to 3 (-3 to -1: less; 0-3: more)"
