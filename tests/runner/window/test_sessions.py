"""Whole sessions at a real window: what was answered on the screen stands in the journal."""

import random
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import pytest

from protocol.questions import ANSWERS
from protocol.texts import Language
from tests.runner.window.person import Hand, Person
from tests.runner.window.sessions import Seat

CHOICES = [0, 0, 2, 0, 0, 1]
SCORES = [10, 3, 0, 8, 5, 1]


@pytest.mark.parametrize(
    ("hand", "language", "display"),
    [
        ("mouse", "en", "small_display"),
        ("keyboard", "zh", "small_display"),
        ("mouse", "zh", "large_display"),
        ("keyboard", "en", "large_display"),
    ],
)
def test_every_answer_given_on_the_screen_stands_in_the_journal(
    hand: Hand, language: Language, display: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    seat = Seat(tmp_path / "study", request.getfixturevalue(display))
    person = Person(seat.display, hand, choices=[*CHOICES], scores=[*SCORES])
    with seat.start("--language", language, "--consent", "C-7") as session:
        assert session.attend(person) == 0, session.complaint

    answered = seat.payloads("answered")
    asked = [trial for trial in seat.payloads("session-opened")[0]["trials"] if trial["question"]]
    assert [entry["change"] for entry in answered[1:]] == [
        ANSWERS[trial["question"]][min(position, len(ANSWERS[trial["question"]]) - 1)]
        for trial, position in zip(asked, person.given, strict=True)
    ]
    assert [entry["score"] for entry in answered if entry["score"] is not None] == person.scored
    assert len(person.scored) == sum(entry["agrees"] is True for entry in answered[2:])


def test_two_hundred_random_events_do_no_harm(small_display: str, tmp_path: Path) -> None:
    seat = Seat(tmp_path / "study", small_display)
    person = Person(small_display, "keyboard", choices=[0] * 12, scores=[4] * 12)
    with seat.start() as session:
        while person.sight() != "button":
            assert session.process.poll() is None
            person.look_later()
        for batch in monkey_events(random.Random(8), 200):
            person.xdotool(*batch)
        assert session.process.poll() is None, "nothing that is pressed ends a session"
        assert session.attend(person) == 0, session.complaint

    answered = seat.payloads("answered")
    assert [entry["index"] for entry in answered] == list(range(7))
    assert {entry["change"] for entry in answered} <= {None, *chain(*ANSWERS.values())}
    assert {entry["score"] for entry in answered} <= {None, *range(11)}


def monkey_events(stream: random.Random, count: int) -> Iterator[list[str]]:
    """Keys and pointer of someone who is no participant, twenty at a time."""
    keys = ["Escape", "Return", "BackSpace", "Left", "Right", "Up", "Down", "space", "Tab", "a"]
    keys += [*"0123456789", "F4", "alt+F4", "ctrl+c", "ctrl+q", "super", "Delete", "KP_5"]
    for _ in range(count // 20):
        batch: list[str] = []
        for _ in range(20):
            at = (str(stream.randrange(800)), str(stream.randrange(600)))
            batch += stream.choice(
                [
                    ["key", stream.choice(keys)],
                    ["mousemove", *at, "click", str(stream.randint(1, 5))],
                    ["mousemove", *at, "mousedown", "1"],
                    ["mousemove", *at, "mouseup", "1"],
                ]
            )
            batch += ["sleep", "0.01"]
        yield [*batch, "mouseup", "1"]
