"""Lines as they are drawn, character by character, and characters that cannot be drawn."""

import unicodedata
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from protocol.errors import BadInput, WorkFailed
from protocol.study.languages import FOLDER, built_in, built_in_codes
from protocol.study.participant_texts import Wording, study_wording
from protocol.study_file.loading import parsed_study, template, with_languages
from runner.window import writing
from runner.window.client import participant_window
from runner.window.messages import Settings
from runner.window.preflight import study_window, writing_problems
from tests.runner.command_line import TOUCHBEAM, typed
from tests.runner.window.sessions import Seat, tiny_study

PAPER = parsed_study(template("paper"))
ENGLISH = study_wording(PAPER, "en")
# "Thank you for taking part", with a bracket and a number.
HEBREW = "תודה על השתתפותך (בערך 20 דקות)."
DEJAVU = frozenset(range(0x20, 0x600))
"""What a font has that lacks everything after Hebrew."""


def in_language(code: str, texts: Mapping[str, str], fonts: str = '"DejaVu Sans"') -> str:
    """The paper's study with a language in which these texts are no longer English."""
    file = (FOLDER / "en.toml").read_text(encoding="utf-8")
    lines = [
        f'{key} = "{texts[bare]}"' if (bare := key.strip('"')) in texts else line
        for line in file.splitlines()
        for key in [line.partition(" = ")[0]]
    ]
    own = "\n".join(f"fonts = [{fonts}]" if line.startswith("fonts") else line for line in lines)
    languages = f'[session]\nlanguages = ["en", "{code}"]\n\n[rating]'
    return with_languages(template("paper").replace("[rating]", languages), {code: own})


def test_a_line_of_hebrew_is_drawn_from_its_end_with_numbers_as_they_are_and_brackets_turned() -> (
    None
):
    assert writing.drawn(HEBREW, from_the_right=True) == ".(תוקד 20 ךרעב) ךתופתתשה לע הדות"


def test_a_latin_word_begins_a_line_of_hebrew_at_its_right() -> None:
    assert writing.drawn("Enter: אבג", from_the_right=True) == "גבא :Enter"
    assert writing.drawn("Enter: אבג") == "Enter: גבא"


@pytest.mark.parametrize(
    ("word", "forms"),
    [
        ("سلام", ["MEEM ISOLATED", "LIGATURE LAM WITH ALEF FINAL", "SEEN INITIAL"]),
        ("بيت", ["TEH FINAL", "YEH MEDIAL", "BEH INITIAL"]),
        # The sign between them, which is never seen, keeps two letters of Persian from joining.
        ("می\u200cخ", ["KHAH ISOLATED", "FARSI YEH FINAL", "MEEM INITIAL"]),
    ],
)
def test_letters_of_arabic_are_drawn_in_the_forms_in_which_they_join(
    word: str, forms: list[str]
) -> None:
    names = [unicodedata.name(sign) for sign in writing.drawn(word)]
    plain = [name.removeprefix("ARABIC ").removeprefix("LETTER ") for name in names]
    assert [name.removesuffix(" FORM") for name in plain] == forms


@pytest.mark.parametrize(
    "text", ["How strong? -5 to 5 (strong)", "光滑的位置，粗糙的位置？", "", "3"]
)
def test_what_is_written_from_the_left_is_drawn_as_it_is(text: str) -> None:
    assert writing.drawn(text, from_the_right=True) == writing.drawn(text) == text


def test_an_accent_becomes_one_with_its_letter() -> None:
    assert writing.drawn("cafe\u0301") == "café"
    assert writing.unshaped("cafe\u0301 Tiế\u0302ng") == "\u0302"


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("स्पर्श करें", "ंे्"),  # Hindi
        ("สัมผัส", "ั"),  # Thai
        ("שָׁלוֹם", "ִָֹׁ".replace("ִ", "")),  # Hebrew with its points
        ("ܫܠܡ", "ܠܡܫ"),  # Syriac, which joins its letters
        ("ڼ", "ڼ"),  # a letter of Pashto
        ("سلام ﻻ ۂ", "ۂ"),  # a joined form, and a letter that comes with its accent
        ("سلام پ چ گ ٹ", ""),  # Persian and Urdu
        ("感觉 한국어 ひらがな Ελλάδα Привет", ""),
    ],
)
def test_what_belongs_on_or_to_another_character_cannot_be_drawn(text: str, wrong: str) -> None:
    assert writing.unshaped(text) == "".join(sorted(wrong))


def test_a_language_is_read_from_the_side_that_most_of_its_letters_are() -> None:
    def wording(text: str) -> Wording:
        return replace(ENGLISH, texts={"welcome": text, "button.ready": "(Enter)"})

    assert writing.is_from_the_right(wording(HEBREW))
    assert not writing.is_from_the_right(wording(f"Thank you for taking part: {HEBREW[:4]}"))


def test_the_first_font_with_every_character_is_taken() -> None:
    fonts = {"Latin": "abc", "Hebrew": "abcאב"}

    def best(signs: str) -> Any:
        return writing.best_font(fonts, lambda font, sign: sign in fonts[font], signs)

    assert best("ab") == ("Latin", "")
    assert best("aא") == ("Hebrew", "")
    assert best("aग") == ("Latin", "ग")
    assert writing.best_font([], lambda *_: True, "a") is None


@pytest.fixture
def fonts_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """A computer with two fonts, of which only the second has Devanagari."""
    fonts = {"DejaVu Sans": DEJAVU, "Noto Sans Devanagari": DEJAVU | set(range(0x900, 0x980))}
    monkeypatch.setattr(writing, "installed_font", fonts.get)


@pytest.mark.usefixtures("fonts_here")
def test_a_text_that_cannot_be_drawn_is_a_problem_with_its_place_and_characters() -> None:
    text = in_language("hi", {"touch.now": "स्पर्श करें।"}, '"Noto Sans Devanagari"')
    (problem,) = writing_problems(parsed_study(text))
    assert problem.path == ("languages", "hi", "texts", "touch.now")
    assert problem.rule == (
        "a text must have no characters that PsychoPy cannot place on, or join to, others"
    )
    assert problem.value.startswith("'ं' (U+0902 DEVANAGARI SIGN ANUSVARA), ")
    assert problem.hint == "write it without them, or use --ratings console"


@pytest.mark.usefixtures("fonts_here")
@pytest.mark.parametrize(
    ("fonts", "lacking"),
    [
        ('"DejaVu Sans"', "DejaVu Sans"),
        ('"None such", "DejaVu Sans"', "DejaVu Sans"),
        ('"DejaVu Sans", "Noto Sans Devanagari"', None),
        ('"None such"', None),
    ],
)
def test_a_character_that_no_font_of_the_language_has_is_a_problem_with_its_remedy(
    fonts: str, lacking: str | None
) -> None:
    found = list(writing_problems(parsed_study(in_language("hi", {"touch.now": "अब"}, fonts))))
    if lacking is None:  # another one has it, or nobody knows
        assert found == []
        return
    (problem,) = found
    assert problem.path == ("languages", "hi", "texts", "touch.now")
    assert problem.rule == f"the font {lacking} must have every character of the texts in hi"
    assert problem.value == "'अ' (U+0905 DEVANAGARI LETTER A), 'ब' (U+092C DEVANAGARI LETTER BA)"
    assert "fonts-noto-core" in problem.hint
    assert "`fonts` of texts/hi.toml" in problem.hint


@pytest.mark.usefixtures("fonts_here")
def test_check_refuses_what_cannot_be_drawn_and_a_console_session_does_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = tmp_path / "study"
    typed("new", str(study))
    text, _, _ = in_language("hi", {}).partition("[languages]")
    (study / "study.toml").write_text(text, encoding="utf-8")
    (study / "texts").mkdir()
    hindi = (FOLDER / "en.toml").read_text(encoding="utf-8").replace("Touch now.", "स्पर्श करें")
    (study / "texts" / "hi.toml").write_text(hindi, encoding="utf-8")
    capsys.readouterr()
    assert typed("check", str(study)) == 2
    told = capsys.readouterr().err
    assert 'texts/hi.toml:32: texts."touch.now": a text must have no characters that' in told
    command = ("run", str(study), "--participant", "P01", "--ratings", "virtual")
    assert typed(*command, "--language", "hi") == 0


def test_a_window_is_not_opened_for_a_text_that_cannot_be_drawn() -> None:
    study = parsed_study(in_language("hi", {"touch.now": "करें"}))
    settings = Settings(wording=study_wording(study, "hi"))
    with pytest.raises(BadInput, match=r"cannot place on, or join to, others, got 'ं' \(U\+0902"):
        study_window((), study, settings, None)


# Fonts and windows as a user has them.


@pytest.mark.waits
@pytest.mark.parametrize("code", built_in_codes())
def test_the_fonts_of_the_built_in_languages_have_every_character_of_their_texts(code: str) -> None:
    language = built_in(code)
    points = next(filter(None, map(writing.installed_font, language.fonts)), None)
    if points is None:
        pytest.skip(f"fontconfig or a font for {code} is not here; make test installs them")
    lacking = {sign for sign in writing.signs(language.texts.values()) if ord(sign) not in points}
    assert lacking == set()


@pytest.mark.waits
def test_a_window_whose_font_lacks_a_character_does_not_open(
    small_display: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("DISPLAY", small_display)
    monkeypatch.setenv("HOME", str(tmp_path))
    settings = Settings(wording=replace(ENGLISH, fonts=("DejaVu Sans",)), signs="aש光")
    lacks = r"the font DejaVu Sans for the language en lacks '光' \(U\+5149 CJK UNIFIED IDEOGRAPH"
    window = participant_window([TOUCHBEAM, "participant-window"], settings)
    with pytest.raises(WorkFailed, match=lacks), window:
        pass


@pytest.mark.waits
def test_a_session_whose_texts_cannot_be_shown_ends_before_anything_is_recorded(
    small_display: str, tmp_path: Path
) -> None:
    study = tiny_study() + '\n[texts.en]\nremember = "Remember 感觉."\n'
    seat = Seat(tmp_path / "study", small_display, study=study)
    with seat.start() as running:
        assert running.end() == 1
    assert running.complaint.startswith("touchbeam: the font DejaVu Sans for the language en lacks")
    assert running.complaint.count("\n") == 1
    assert [path.name for path in seat.folder.iterdir()] == ["study.toml"]
