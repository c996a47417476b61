"""Whole sessions at a real window: the journal contains the answers given on the screen."""

import random
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import pytest

from protocol.study.questions import ANSWERS
from tests.runner.window.person import Controls, Person, virtual_display
from tests.runner.window.sessions import Seat, tiny_study

CHOICES = [0, 0, 2, 0, 0, 1]
SCORES = [10, 3, 0, 8, 5, 1]


CASES: list[tuple[Controls, str, tuple[int, int]]] = [
    ("mouse", "en", (800, 600)),
    ("keyboard", "zh", (800, 600)),
    ("mouse", "zh", (1920, 1080)),
    ("keyboard", "en", (1920, 1080)),
]


@dataclass(frozen=True, kw_only=True)
class Sat:
    """The outcome of a session, and its person."""

    code: int
    complaint: str
    person: Person
    seat: Seat


def run_session(case: tuple[Controls, str, tuple[int, int]], folder: Path) -> Sat:
    """Run a whole session with one kind of input on a display of its own."""
    control, language, size = case
    with virtual_display(*size) as display:
        seat = Seat(folder / "study", display)
        person = Person(display, control, choices=CHOICES * 2, scores=SCORES * 2)
        with seat.start("--language", language, "--consent", "C-7") as session:
            code = session.attend(person)
        return Sat(code=code, complaint=session.complaint, person=person, seat=seat)


@pytest.fixture(scope="module")
def sat(small_display: str, tmp_path_factory: pytest.TempPathFactory) -> list[Sat]:
    """Run all sessions at the same time, because each mostly waits."""
    folders = [tmp_path_factory.mktemp("seat") for _ in CASES]
    with ThreadPoolExecutor(len(CASES)) as pool:
        return list(pool.map(run_session, CASES, folders))


@pytest.mark.parametrize("case", CASES, ids=str)
def test_the_journal_contains_every_answer_given_on_the_screen(
    case: tuple[Controls, str, tuple[int, int]], sat: list[Sat]
) -> None:
    done = sat[CASES.index(case)]
    assert done.code == 0, done.complaint
    answered = done.seat.payloads("answered")
    opened = done.seat.payloads("session-opened")[0]
    asked = [trial["question"] for trial in opened["trials"] if trial["question"]]
    assert [entry["change"] for entry in answered[1:]] == [
        ANSWERS[question][min(position, len(ANSWERS[question]) - 1)]
        for question, position in zip(asked, done.person.given, strict=True)
    ]
    scores = [entry["score"] for entry in answered if entry["score"] is not None]
    assert scores == done.person.scored
    assert len(scores) == sum(entry["agrees"] is True for entry in answered[2:])
    assert opened["language"] == case[1]


@pytest.mark.parametrize("case", CASES, ids=str)
def test_each_answer_has_its_trace(
    case: tuple[Controls, str, tuple[int, int]], sat: list[Sat]
) -> None:
    done = sat[CASES.index(case)]
    for entry in done.seat.payloads("answered")[1:]:
        for trace, reaction_s in zip(entry["traces"], entry["reaction_time_s"], strict=True):
            assert trace["changes"][0] == trace["start"]
            assert {change["by"] for change in trace["changes"]} == {
                "pointer" if case[0] == "mouse" else "key"
            }
            assert 0 < trace["start"]["t_s"] <= trace["confirmed_s"] == reaction_s
            assert trace["display"]["size_px"] == list(case[2])
            assert trace["screens"][-1]["frames"] > 0
    screens = [
        screen["screen"]
        for entry in done.seat.payloads("touch-started")
        for screen in entry["instruction"]["trace"]["screens"]
    ]
    assert {"touch.smooth", "touch.right", "touch.left"} <= set(screens)


def test_two_hundred_random_events_do_no_harm(small_display: str, tmp_path: Path) -> None:
    seat = Seat(tmp_path / "study", small_display, study=tiny_study())
    person = Person(small_display, "keyboard", choices=[0] * 12, scores=[4] * 12)
    with seat.start() as session:
        while person.sight() != "button":
            assert session.process.poll() is None
            person.look_later()
        for batch in monkey_events(random.Random(8), 200):
            person.xdotool(*batch)
        assert session.process.poll() is None, "no key or press ends a session"
        assert session.attend(person) == 0, session.complaint

    answered = seat.payloads("answered")
    assert [entry["index"] for entry in answered] == list(range(3))
    assert {entry["change"] for entry in answered} <= {None, *chain(*ANSWERS.values())}
    assert {entry["score"] for entry in answered} <= {None, *range(11)}


def monkey_events(stream: random.Random, count: int) -> Iterator[list[str]]:
    """Yield random keys and pointer events, twenty at a time."""
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
