"""A study's own languages: read with the study file, and every mistake named by file and line."""

from importlib.resources import files
from pathlib import Path

import pytest

from protocol.errors import Problem
from protocol.study.languages import built_in, later_texts, reference_texts
from protocol.study.participant_texts import (
    band_names,
    read_in_reference,
    study_codes,
    study_wording,
)
from protocol.study_file.loading import (
    StudyError,
    parsed_study,
    template,
    text_digest,
    with_languages,
)
from protocol.study_file.toml import LONGEST_TEXT
from tests.protocol.studies import TRACKS

PAPER = template("paper")
FIRST_FILE = Path(__file__).parents[2] / "data" / "language_1.0.0.toml"
FRENCH = (
    (files("protocol") / "languages" / "en.toml")
    .read_text(encoding="utf-8")
    .replace('name = "English"', 'name = "French"')
    .replace('general = "general"', 'general = "moyen"')
    .replace("Lift your finger.", "Levez le doigt.\\n\\u007f".replace("\\u007f", ""))
)


def problems(content: str, study: str = PAPER) -> list[Problem]:
    with pytest.raises(StudyError) as caught:
        parsed_study(with_languages(study, {"fr": content}), "here/study.toml")
    return caught.value.problems


def test_a_study_without_languages_of_its_own_is_the_text_of_its_file() -> None:
    assert with_languages(PAPER, {}) is PAPER


def test_a_language_of_the_studys_own_is_one_more_that_it_can_be_read_in() -> None:
    study = parsed_study(with_languages(PAPER, {"fr": FRENCH}))
    assert study_codes(study) == ("en", "zh", "fr")
    wording = study_wording(study, "fr")
    assert wording.texts["touch.end"] == "Levez le doigt.\n"
    assert band_names(study.rating.bands, wording)[2] == "5-7 moyen"
    assert study.languages["fr"].name == "French"


def test_a_language_from_before_the_newer_texts_stays_valid() -> None:
    """Older texts of the study stand in for them, and then the texts of the reference."""
    newer = tuple(f'"{key}" = ' if "." in key else f"{key} = " for key in later_texts())
    lines = FRENCH.replace('wait = "Please wait."', 'wait = "Attendez."').splitlines(keepends=True)
    older = "".join(line for line in lines if not line.startswith(newer))
    texts = study_wording(parsed_study(with_languages(PAPER, {"fr": older})), "fr").texts
    assert texts["wait.beam"] == texts["touch.soon"] == "Attendez."
    assert texts["stopped"] == "Levez le doigt.\n"
    assert texts["saved"] == "Saved"
    own = PAPER + '\n[texts.en]\nwait = "One moment."\n'
    assert study_wording(parsed_study(own), "en").texts["wait.touch"] == "One moment."


def test_a_language_file_of_version_1_stays_valid() -> None:
    """As `touchbeam translate` wrote it then. A text that has come since is no reason to refuse."""
    content = FIRST_FILE.read_text(encoding="utf-8")
    study = parsed_study(with_languages(PAPER, {"fr": content}))
    assert study_wording(study, "fr").texts.keys() >= reference_texts().keys()
    assert not study.languages["fr"].texts.keys() & {*read_in_reference(study, "fr")}


def test_a_study_with_tracks_needs_the_texts_of_its_own_tracks() -> None:
    content = FIRST_FILE.read_text(encoding="utf-8")
    wanted = {
        *("interval.1", "interval.2", "question.which_smoother", "answer.first", "answer.second"),
        *("question.is_different", "answer.yes", "answer.no"),
        *("interval.3", "question.which_different", "answer.third"),
        *("feedback.right", "feedback.wrong"),
    }
    found = {problem.path[-1] for problem in problems(content, TRACKS)}
    assert found == wanted
    texts = reference_texts()
    added = "".join(f'"{key}" = "{texts[key]}"\n' for key in sorted(wanted))
    study = parsed_study(with_languages(TRACKS, {"fr": content + added}))
    assert {*read_in_reference(study, "fr")}.isdisjoint(wanted)


def test_a_text_that_comes_later_is_read_in_english(monkeypatch: pytest.MonkeyPatch) -> None:
    newer = {**reference_texts(), "button.louder": "Louder"}
    english = built_in("en").model_copy(update={"texts": newer})
    later_texts.cache_clear()
    monkeypatch.setattr("protocol.study.languages.built_in", lambda _: english)
    try:
        study = parsed_study(with_languages(PAPER, {"fr": FRENCH}))
        assert study_wording(study, "fr").texts["button.louder"] == "Louder"
        assert read_in_reference(study, "fr") == ("button.louder",)
    finally:
        later_texts.cache_clear()


def test_a_study_may_replace_a_built_in_language_and_a_text_of_its_own_language() -> None:
    text = PAPER + '\n[texts.fr]\nwait = "Un instant."\n'
    study = parsed_study(with_languages(text, {"en": FRENCH, "fr": FRENCH}))
    assert study_wording(study, "en").texts["touch.end"] == "Levez le doigt.\n"
    assert study_wording(study, "fr").texts["wait"] == "Un instant."


def test_what_identifies_a_study_tells_every_change_of_its_languages() -> None:
    texts = [with_languages(PAPER, own) for own in ({}, {"fr": FRENCH}, {"fr": FRENCH + "\n"})]
    assert len({text_digest(text) for text in texts}) == len(texts)


@pytest.mark.parametrize("character", ["\x7f", '"', "\\", "'''", "\u2028", "\r\n"])
def test_a_file_comes_through_as_it_is(character: str) -> None:
    content = f"# {character}\n{FRENCH}"
    if character == "\x7f":
        (problem,) = problems(content)
        assert "must be TOML" in str(problem)
        return
    assert parsed_study(with_languages(PAPER, {"fr": content})).languages["fr"].name == "French"


@pytest.mark.parametrize(
    ("right", "wrong", "line"),
    [
        ('wait = "', 'wiat = "', "48: texts.wiat: unknown key, got 'wiat'; did you mean 'wait'?"),
        ('"Please wait."', '""', "48: texts.wait: must not be empty, got"),
        ('"Please wait."', '" "', "48: texts.wait: a text must not be blank, got ' '"),
        ('"Please wait."', "4", "48: texts.wait: must be a text, got 4"),
        ('"Please wait."', f'"{"x" * 501}"', "48: texts.wait: must have at most 500 characters"),
        ('"Please wait."', '"Wait.\\u0007"', "48: texts.wait: a text must hold no control"),
        ('"Please wait."', '"Wait {s}."', "48: texts.wait: the fields in braces must be none"),
        ("{reference}", "{number}", "47: texts.consent: the fields in braces must be {reference}"),
        (
            '= "it became rougher"',
            '= "It became smoother"',
            '39: texts."answer.rougher": answers to one question must',
        ),
        (
            '= "it became rougher"',
            '= "1"',
            '39: texts."answer.rougher": an answer must be no number',
        ),
        ('name = "French"', "", " name: must be given, got nothing"),
        ('name = "French"', 'nmae = "French"', "7: nmae: unknown key, got 'nmae'; did you mean"),
        ("font_package", "font_packge", "9: font_packge: unknown key, got 'font_packge'; did"),
        ('"DejaVu Sans", ', "1, ", "8: fonts.0: must be a text, got 1"),
        ("[texts]", "[texts", "19: file: must be TOML, got "),
        ('name = "French"', f"name = {2**64}", " name: a whole number must fit into 64 bits"),
        (FRENCH, "", " name: must be given, got nothing"),
    ],
)
def test_what_is_wrong_with_a_file_is_told_by_its_line(right: str, wrong: str, line: str) -> None:
    assert right in FRENCH
    found = [
        problem.located("here/study.toml") for problem in problems(FRENCH.replace(right, wrong))
    ]
    assert any(text.startswith(f"here/texts/fr.toml:{line}") for text in found), found
    assert not any("study.toml" in text for text in found)


def test_every_key_must_be_there() -> None:
    (problem,) = problems(FRENCH.replace('wait = "Please wait."\n', ""))
    assert (problem.file, problem.where) == ("texts/fr.toml", "texts.wait")
    assert problem.rule == "must be given"


def test_a_file_has_an_end() -> None:
    (problem,) = problems("#" * (LONGEST_TEXT // 2 + 1) + "\n" + "#" * LONGEST_TEXT)
    assert str(problem).startswith(f"file: must have at most {LONGEST_TEXT} characters, got more")


def test_a_band_without_a_name_in_a_required_language_is_a_problem_of_the_study_file() -> None:
    text = PAPER.replace('en = "no effect", zh = "无效果"', 'en = "nothing", zh = "无"')
    (problem,) = problems(FRENCH, text)
    assert problem.located("study.toml") == (
        "study.toml:40: rating.bands.0.fr: must be given, got nothing"
    )
    named = text.replace('en = "nothing"', 'en = "nothing", fr = "rien"')
    parsed_study(with_languages(named, {"fr": FRENCH}))


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        (', zh = "很弱"', ', fr = "faible"', "41: rating.bands.1.fr: unknown key, got 'fr'; did"),
        ('general", zh = "一般"', 'so-so"', "42: rating.bands.2.zh: must be given, got nothing"),
        ("[rating]", "[texts.fr]\nwait = 'x'\n[rating]", "37: texts.fr: must be one of 'en' or"),
        (
            "[rating]",
            "[session]\nlanguages = ['fr']\n[rating]",
            "38: session.languages.0: must be one of",
        ),
        ("[rating]", "[session]\nlanguages = []\n[rating]", "38: session.languages: must have at"),
    ],
)
def test_a_language_that_is_not_there_cannot_be_named(right: str, wrong: str, message: str) -> None:
    assert right in PAPER
    with pytest.raises(StudyError) as caught:
        parsed_study(PAPER.replace(right, wrong, 1))
    assert message in "\n".join(problem.located("study.toml") for problem in caught.value.problems)


def test_a_study_need_not_be_complete_in_every_language() -> None:
    text = PAPER.replace('en = "no effect", zh = "无效果"', 'zh = "无"')
    with pytest.raises(StudyError, match=r"rating\.bands\.0\.en: must be given, got nothing"):
        parsed_study(text)
    parsed_study(text.replace("[rating]", '[session]\nlanguages = ["zh"]\n\n[rating]'))


def test_an_instruction_must_have_a_text_in_a_language_of_the_studys_own() -> None:
    text = PAPER.replace("press = 1.5", 'press = 1.5, instruction = "hard"')
    text += '\n[texts.en]\nhard = "Press hard."\n[texts.zh]\nhard = "用力。"\n'
    (problem,) = problems(FRENCH, text)
    assert problem.value == "none for 'hard' in fr"
    parsed_study(with_languages(text, {"fr": f'{FRENCH}hard = "Appuyez."\n'}))
