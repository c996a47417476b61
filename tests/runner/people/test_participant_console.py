"""A participant at a terminal: the texts, valid answers, and questions asked again."""

import io
import time
from collections.abc import Iterator
from dataclasses import replace

import pytest

from protocol.errors import BadInput
from protocol.study.participant_texts import study_wording
from protocol.study.rules import Rating
from protocol.study_file.loading import parsed_study, template
from runner.people.participant_console import (
    MOST_LINES,
    ConsoleParticipant,
    ParticipantGone,
    TypedLines,
)
from runner.screens import (
    Ask,
    FingerPath,
    Instruction,
    Notice,
    Response,
    Screen,
    ask_change,
    ask_rating,
    ask_score,
    ask_track,
)
from tests.protocol.studies import OWN_QUESTIONS

PAPER = parsed_study(template("paper"))
REMARKS = "Is there anything that you would like to tell us?"
SURE = "How sure are you of your answer?"
ANALOGUE = "  0, 0.1 … 100"


class Terminal:
    """A participant who types `lines`, and the lines printed for them."""

    def __init__(self, lines: str, language: str = "en") -> None:
        self.said: list[str] = []
        self.typed = TypedLines(io.StringIO(lines))
        ticks: Iterator[int] = iter(range(10_000))
        self.participant = ConsoleParticipant(
            self.typed,
            self.said.append,
            study_wording(PAPER, language),
            monotonic_s=lambda: float(next(ticks)),
        )

    def answer(self, screen: Screen) -> Response:
        self.participant.show(screen)
        until_s = time.monotonic() + 5
        while time.monotonic() < until_s:
            if (response := self.participant.poll()) is not None:
                return response
        raise AssertionError(f"no answer; said: {self.said}")


@pytest.mark.parametrize("typed", ["1", "smoother", "SMOOTHER", "  1  "])
def test_a_change_is_given_by_number_or_word(typed: str) -> None:
    assert Terminal(f"{typed}\n").answer(ask_change("roughness")).answer == "smoother"


@pytest.mark.parametrize("typed", ["Glatter", "glatter", " GLATTER "])
def test_a_studys_own_answer_text_matches_in_any_case(typed: str) -> None:
    terminal = Terminal(f"{typed}\n")
    english = terminal.participant.wording
    texts = {**english.texts, "answer.smoother": "Glatter"}
    terminal.participant.wording = replace(english, texts=texts)
    assert terminal.answer(ask_change("roughness")).answer == "smoother"


def test_it_is_told_which_touch_of_a_track_comes() -> None:
    terminal = Terminal("\n3\n")
    path = FingerPath(start_m=0.04, end_m=0.04, interval=3)
    terminal.answer(Instruction(text="touch.smooth", touch=path))
    assert terminal.said[0] == "Third touch"
    assert terminal.answer(ask_track("different", 3)).answer == "third"
    assert terminal.said[-4:] == [
        "Which touch was different from the others?",
        *("  1  the first", "  2  the second", "  3  the third"),
    ]


def test_chinese_answers_are_accepted() -> None:
    terminal = Terminal("没有互换\n", language="zh")
    assert terminal.answer(ask_change("places")).answer == "not swapped"
    assert "光滑和粗糙的位置是否互换了？" in terminal.said


def test_an_invalid_answer_is_asked_for_again() -> None:
    terminal = Terminal("4\nyes\n2\n")
    assert terminal.answer(ask_change("roughness")).answer == "rougher"
    again = "This is not one of the possible answers. Please type one of these:"
    choices = ["  1  it became smoother", "  2  it became rougher", "  3  it stayed the same"]
    assert terminal.said[-8:] == [f"'4': {again}", *choices, f"'yes': {again}", *choices]


def test_an_order_without_its_colon_is_explained() -> None:
    terminal = Terminal("p\n2\n")
    terminal.answer(ask_change("roughness"))
    hint = "(For the operator: an order begins with a colon, such as :p)"
    assert terminal.said[-1] == hint


def test_a_score_outside_the_scale_is_asked_for_again() -> None:
    terminal = Terminal("11\nx\n-1\n7\n")
    assert terminal.answer(ask_score(Rating())).answer == "7"
    again = "This is not one of the possible answers. Please type one of these:"
    assert terminal.said[-6:] == [
        line for typed in ("11", "x", "-1") for line in (f"'{typed}': {again}", "  0, 1 … 10")
    ]


def test_a_score_lies_on_the_studys_scale() -> None:
    terminal = Terminal("101\n55\n")
    assert terminal.answer(ask_score(Rating(minimum=0, maximum=100))).answer == "55"
    assert terminal.said[0] == "How strong is the change? 0 to 100"
    assert terminal.said[-1] == "  0, 1 … 100"


@pytest.mark.parametrize(
    ("name", "typed", "shown", "possible"),
    [
        ("age", "17\n31\n", ["How old are you?", "  … years"], "  18 … 99 years"),
        ("remarks", f"{'a' * 121}\n\n", [REMARKS, "  Skip (Enter)"], "  … (1–120)"),
        ("confidence", "70.55\n70.5\n", [SURE, "0 a mere guess   100 completely sure"], ANALOGUE),
    ],
)
def test_limits_unit_and_how_to_skip_are_shown(
    name: str, typed: str, shown: list[str], possible: str
) -> None:
    terminal = Terminal(typed)
    study = parsed_study(template("paper") + OWN_QUESTIONS)
    (question,) = (each for each in study.question if each.name == name)
    terminal.answer(Ask(question=question))
    assert terminal.said[:2] == shown
    assert terminal.said[-1] == possible


def test_the_reaction_time_starts_at_the_question() -> None:
    assert Terminal("\n").answer(Instruction(text="remember")).reaction_time_s == 1.0


def test_a_notice_is_not_answered() -> None:
    terminal = Terminal("1\n")
    terminal.participant.show(Notice(text="thanks"))
    assert terminal.participant.poll() is None


def test_input_that_ends_too_early_is_an_error() -> None:
    with pytest.raises(ParticipantGone, match="the input ended before the session was complete"):
        Terminal("").answer(Instruction(text="remember"))


def test_a_line_that_begins_with_a_colon_is_the_operators() -> None:
    terminal = Terminal(":p\n1\n")
    assert terminal.answer(ask_change("roughness")).answer == "smoother"
    assert terminal.typed.operator_typed(asked=False) == ":p\n"


def test_any_line_answers_a_question_to_the_operator() -> None:
    typed = TypedLines(io.StringIO("dry\n"))
    until_s = time.monotonic() + 5
    line = ""
    while not line and time.monotonic() < until_s:
        line = typed.operator_typed(asked=True)
    assert line == "dry\n"


def test_a_closed_input_is_refused_at_the_start() -> None:
    with pytest.raises(BadInput, match="standard input must be open, got a closed one"):
        TypedLines(None)


def test_undecodable_bytes_are_asked_for_again() -> None:
    source = io.TextIOWrapper(io.BytesIO(b"\xff\xfe\n2\n"), encoding="utf-8", errors="strict")
    said: list[str] = []
    participant = ConsoleParticipant(TypedLines(source), said.append, study_wording(PAPER, "en"))
    participant.show(ask_change("roughness"))
    until_s = time.monotonic() + 5
    answer = None
    while answer is None and time.monotonic() < until_s:
        answer = participant.poll()
    assert answer is not None
    assert answer.answer == "rougher"


def test_an_order_arrives_behind_a_stuck_key() -> None:
    class Typist(io.StringIO):
        def isatty(self) -> bool:
            return True

    typed = TypedLines(Typist("\n" * (2 * MOST_LINES) + ":e\n"))
    until_s, order = time.monotonic() + 5, ""
    while not order and time.monotonic() < until_s:
        order = typed.operator_typed(asked=False)
    assert order == ":e\n"


def test_a_flood_of_lines_is_not_read_ahead() -> None:
    class Flood(io.StringIO):
        given = 0

        def __next__(self) -> str:  # type: ignore[override]
            self.given += 1
            if self.given > 100 * MOST_LINES:
                raise StopIteration
            return "\n"

    flood = Flood()
    typed = TypedLines(flood)
    until_s = time.monotonic() + 5
    while flood.given < MOST_LINES and time.monotonic() < until_s:
        pass
    assert typed.take() == ""
    assert flood.given <= MOST_LINES + 3


@pytest.mark.parametrize(
    ("name", "typed", "answer"),
    [
        ("pleasantness", "8\n7\n", "7"),
        ("confidence", "some\n61.83\n61.8\n", "61.8"),
        ("sensations", "\n9\nwarmth, 3\n", "warmth;sticking"),
        ("hand", "the left one\n", "left"),
        ("age", "\n17\n31\n", "31"),
        ("remarks", "Nothing.\n", "Nothing."),
        ("remarks", "\n", ""),
    ],
)
def test_a_studys_own_question_is_asked_until_it_is_answered(
    name: str, typed: str, answer: str
) -> None:
    study = parsed_study(template("paper") + OWN_QUESTIONS)
    question = next(question for question in study.question if question.name == name)
    terminal = Terminal(typed)
    assert terminal.answer(Ask(question=question)).answer == answer
    assert terminal.said[0] == question.text["en"]
    again = [line for line in terminal.said if "is not one of the possible answers" in line]
    assert len(again) == typed.count("\n") - 1


@pytest.mark.parametrize(("low", "high", "typed"), [(-3, 3, "-3"), (0, 100, "42"), (1, 7, "7")])
def test_what_was_felt_is_rated_on_the_scale_of_the_study(low: int, high: int, typed: str) -> None:
    ends = ({"at": low, "en": "smooth", "zh": "光滑"}, {"at": high, "en": "rough", "zh": "粗糙"})
    scale = Rating.model_validate({"minimum": low, "maximum": high, "labels": ends})
    terminal = Terminal(f"{high + 1}\n{low - 1}\n1.5\n{typed}\n")
    assert terminal.answer(ask_rating(scale)).answer == typed
    shown = [f"How strong was what you felt? {low} to {high}", f"{low} smooth   {high} rough"]
    assert terminal.said[:2] == shown
    assert sum("not one of the possible answers" in line for line in terminal.said) == 3
