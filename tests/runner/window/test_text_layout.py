"""Laws of the layout: lines contain the whole text, in order, and stay within their width."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from runner.window.elements import text_height, text_width, wrapped

WORDS = st.lists(
    st.sampled_from(["a", "beam", "smooth", "光滑", "的", "位置，", "10"]), max_size=30
)


@given(words=WORDS, width=st.floats(140, 800))
def test_lines_contain_the_whole_text_and_stay_within_the_width(
    words: list[str], width: float
) -> None:
    text = " ".join(words)
    lines = wrapped(text, 30, width)
    assert "".join("".join(lines).split()) == "".join(text.split())
    assert all(text_width(line, 30) <= width for line in lines)


@given(words=WORDS)
def test_no_line_begins_with_a_closing_mark(words: list[str]) -> None:
    assert not any(line[:1] in "，。" for line in wrapped("".join(words), 30, 150) if line)


def test_lines_are_about_equally_long() -> None:
    first, second = wrapped("Slide your left index finger slowly from left to right.", 30, 720)
    assert (first, second) == ("Slide your left index finger", "slowly from left to right.")


def test_an_unbreakable_word_stays_whole() -> None:
    assert wrapped("piezoelectricity", 30, 60) == ("piezoelectricity",)
    assert text_width("piezoelectricity", 30) > 60


@pytest.mark.parametrize(("text", "ems"), [("0", 0.636), ("W", 0.989), ("梁", 1.0), ("é", 1.0)])
def test_a_letter_is_at_least_as_wide_as_in_its_font(text: str, ems: float) -> None:
    assert text_width(text, 100) == pytest.approx(ems * 100 * 1.04)


def test_the_distance_of_lines_is_one_and_a_quarter_ems() -> None:
    assert text_height(3, 20) == 75
