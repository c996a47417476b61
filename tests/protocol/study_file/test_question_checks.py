"""What is wrong with a question of the study's own is told by line, all at once."""

import re

import pytest

from protocol.plan.plan import plan
from protocol.plan.trials import session_s
from protocol.study.columns import TAKEN
from protocol.study.participant_texts import lacking
from protocol.study_file.loading import StudyError, parsed_study, template
from tests.protocol.studies import OWN_QUESTIONS

PAPER = template("paper")


def told(*changes: tuple[str, str]) -> list[str]:
    """What `check` says of the study after some changes to its questions."""
    text = OWN_QUESTIONS
    for before, after in changes:
        assert before in text
        text = text.replace(before, after, 1)
    with pytest.raises(StudyError) as caught:
        parsed_study(PAPER + text)
    return [str(problem) for problem in caught.value.problems]


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ('"hand"', '"score"', "question score, name: a question must have a name of its own"),
        ('"hand"', '"age"', "question age, name: a question must have a name of its own"),
        ('"hand"', '"age_reaction_time_s"', "age, name: a question must have a name of its own"),
        ('"hand"', '"Hand"', "must begin with a small letter"),
        ('kind = "choice"', 'kind = "chioce"', "did you mean 'choice'?"),
        ('when = "block"', 'when = "blocks"', "did you mean 'block'?"),
        ("maximum = 7", "maximun = 7", "unknown key, got 'maximun'; did you mean 'maximum'?"),
        ("maximum = 7", "", "question pleasantness, maximum: must be given, got nothing"),
        ("maximum = 7", "maximum = 1", "maximum: must be above minimum = 1, got 1"),
        ("maximum = 7", "maximum = 7\nstep = 4", "step: must divide the 6 from minimum to maximum"),
        ("at = 7", "at = 7.5", "labels: must be at places of the scale from 1 to 7, got 7.5"),
        ("at = 7", "at = 1", "labels: must be at places that differ, got 1"),
        ("at = 7", 'value = "7"', "labels: must each have a place"),
        ("at = 100", "at = 99", "labels: must be two, one at = 0 and one at = 100, got 0, 99"),
        ('"pressure"', '"presure"', "conditions: must be conditions of the study, got 'presure'"),
        (
            '"pressure"',
            '"voltage"',
            "confidence, conditions: must differ, got 'voltage'; name it once",
        ),
        ('when = "block"', 'conditions = ["voltage"]\nwhen = "block"', 'when: must be "trial"'),
        (
            'when = "after"',
            'sessions = "first"\nwhen = "block"',
            'when: must be "desk", "before" or',
        ),
        ('unit = "years"', "max_length = 3", "max_length: must be left out where kind = 'number'"),
        ("minimum = 18", "minimum = 99", "maximum: must be above minimum = 99, got 99"),
        ('value = "both"', 'value = "left"', "labels: must have values that differ, got 'left'"),
        ('value = "both"', 'value = "a;b"', "a value must have no ';'"),
        ('value = "both"', 'value = "3"', "and be no number, got '3'"),
        ('value = "both"', "at = 3", "labels: must each have a value"),
        ('en = "both"', 'en = "the left one"', "answers to one question must differ"),
        ('en = "both"', 'en = "2"', "an answer must be no number"),
        ('en = "both"', 'en = " "', "a text must not be blank"),
        ('en = "both"', 'eng = "both"', "labels.2.eng: unknown key"),
        ('zh = "两只手"', 'fr = "deux"', "labels.2.zh: must be given, got nothing; or leave 'zh'"),
        (', zh = "您的年龄？"', "", "text.zh: must be given, got nothing; or leave 'zh'"),
        ('zh = "您的年龄？"', 'xx = "?"', "must be one of 'en' or 'zh'"),
    ],
)
def test_what_is_wrong_is_said(before: str, after: str, message: str) -> None:
    assert any(message in line for line in told((before, after)))


@pytest.mark.parametrize(
    ("page", "message"),
    [
        ('before = "block"\nblock = 2', "page 1, block: must be at most 1, the number of blocks"),
        ('before = "practice"', 'page 1, before: must not be "practice" without practice_trials'),
        ("block = 1", 'page 1, block: must be left out unless before = "block", got 1'),
    ],
)
def test_a_page_that_would_never_be_shown_is_refused(page: str, message: str) -> None:
    with pytest.raises(StudyError, match=re.escape(message)):
        parsed_study(f'{PAPER}\n[[page]]\n{page}\ntext = {{ en = "x", zh = "x" }}\n')


def test_everything_is_said_at_once() -> None:
    found = told(('"hand"', '"score"'), ("at = 7", "at = 8"), ("maximum = 99", "maximum = 9"))
    assert len(found) == 3


def test_a_language_needs_the_texts_of_question_pages_only_for_questions() -> None:
    study = parsed_study(PAPER)
    bare = study.model_copy(update={"languages": {"fr": language_without("hint.typed")}})
    assert not [text for text in lacking(bare, "fr") if "hint" in text]
    asking = parsed_study(PAPER + OWN_QUESTIONS).model_copy(update={"languages": bare.languages})
    assert "the text 'hint.typed'" in lacking(asking, "fr")
    assert "a text of the question 'hand'" in lacking(asking, "fr")


def language_without(key: str) -> object:
    from protocol.study.languages import built_in

    english = built_in("en")
    texts = {name: text for name, text in english.texts.items() if name != key}
    return english.model_copy(update={"texts": texts})


def test_questions_count_in_the_length_of_a_session() -> None:
    plain, asking = (parsed_study(PAPER + more) for more in ("", OWN_QUESTIONS))
    longer_s = session_s(asking, plan(asking, 0)) - session_s(plain, plan(plain, 0))
    # pleasantness 5 times, confidence 2 times, and four others once
    assert longer_s == pytest.approx((5 + 2 + 4) * asking.timing.answer_s)


def test_names_of_columns_are_written_as_names_of_questions() -> None:
    assert all(name == name.lower() for name in TAKEN)
