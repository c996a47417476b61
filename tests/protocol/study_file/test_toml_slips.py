"""A line that is not TOML is shown with the remedy, in our words."""

import pytest

from protocol.errors import Problem
from protocol.study_file.toml import toml_document


def problem(text: str) -> Problem:
    found = toml_document(text)
    assert isinstance(found, Problem)
    return found


@pytest.mark.parametrize(
    ("line", "remedy"),
    [
        ("force_n = 0,5", "a decimal number has a point, not a comma: force_n = 0.5"),
        ("force_n = 0,5   # N", "a decimal number has a point, not a comma: force_n = 0.5"),
        ("path_m = [0,010, 0,081]", "decimal numbers have a point, and a comma stands between"),
        ("force_n = 0.5 N", "a number stands alone, without its unit: force_n = 0.5"),
        ("force_n = 5e", "a number stands alone, without its unit: force_n = 5"),
        ("share = 50%", "a number stands alone, without its unit: share = 50"),
        ("seed = 01", "a number must not begin with 0: seed = 1"),
        ("force_n = .5", "a number must begin with a digit: force_n = 0.5"),
        ("flag = True", "write flag = true, in small letters"),
        ("flag = yes", "write flag = true, in small letters"),
        ("name = paper", 'a text stands in quotes: name = "paper"'),
        ("name = my study", 'a text stands in quotes: name = "my study"'),
        ("name = 触觉", 'a text stands in quotes: name = "触觉"'),
        ("name = “paper”", 'a text stands in straight quotes: name = "paper"'),
        ("name = „paper“", 'a text stands in straight quotes: name = "paper"'),
        ('name = "paper', "the text lacks the quote at its end"),
        ('device = "C:\\ports\\x"', "a backslash in a text stands twice, or the text is in single"),
        ("name =", "a value is missing after ="),
        ("seed 1", "a key and its value need = between them"),
        ("[touch", "the name of a table stands in brackets: [rig], or [[condition]]"),
        ("path_m = [0.01, 0.08", "what is opened here with [ or { must be closed with ] or }"),
        ("a = 1]", "'Study file' (touchbeam docs) shows how each value is written"),
    ],
)
def test_the_usual_slips_have_a_remedy(line: str, remedy: str) -> None:
    found = problem(f"[study]\n{line}\n[rig]\n")
    assert (found.where, found.rule, found.line) == ("file", "must be TOML", 2)
    assert found.value == f"the line '{line.partition('   #')[0]}'"
    assert found.hint.startswith(remedy)


@pytest.mark.parametrize(
    ("text", "line", "remedy"),
    [
        ("seed = 1\nseed = 2", 2, "seed stands twice; keep one"),
        ("[rig]\nseed = 1\nseed = 2\n[touch]", 3, "seed stands twice; keep one"),
        ("rig = {seed = 1, seed = 2}", 1, "seed stands twice; keep one"),
        ("[question]\n[[question]]", 2, "each question begins with two brackets: [[question]]"),
        ("[page]\n[page]", 2, "each page begins with two brackets: [[page]]"),
        ("[rig]\n[touch]\n[rig]", 3, "[rig] stands twice; keep one, with the keys of both"),
    ],
)
def test_what_stands_twice_is_named(text: str, line: int, remedy: str) -> None:
    assert (problem(text).line, problem(text).hint) == (line, remedy)


@pytest.mark.parametrize(
    ("line", "column", "code"),
    [
        ("# a comment\x00 of the study", 12, "U+0000"),
        ("name = 'bell \x07'", 14, "U+0007"),
        ("seed = 1\x0b", 9, "U+000B"),
        ("seed\u00a0= 1", 5, "U+00A0"),
        ("\ufeffseed = 1", 1, "U+FEFF"),
        ("seed = 1\rx = 2", 9, "U+000D"),
        (f"# {'y' * 200}\x01{'z' * 200}", 203, "U+0001"),
    ],
)
def test_a_character_that_cannot_be_seen_is_named_and_shown(
    line: str, column: int, code: str
) -> None:
    found = problem(f"[study]\n{line}\nname = 1")
    assert found.hint == f"delete the character {code} in column {column}, which cannot be seen"
    assert (found.line, chr(int(code[2:], 16)) in found.value) == (2, True)


def test_what_cannot_be_seen_in_a_text_or_a_comment_is_not_blamed() -> None:
    assert problem("name = 'a\u00a0b' 1 # \u200b\r\n").hint != ""
    assert "cannot be seen" not in problem("name = 'a\u00a0b' 1 # \u200b\r\n").hint


def test_a_long_line_is_shortened() -> None:
    assert len(problem(f"name = {'x' * 500}").value) < 80
