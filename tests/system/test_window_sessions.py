"""Whole sessions at a real window: the journal contains the answers given on the screen."""

import random
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import pytest

from protocol.study.study_question import ANSWERS
from tests.runner.window.person import Controls, Person, virtual_display
from tests.runner.window.sessions import READABLE_S, Running, Seat, short_study, tiny_study

pytestmark = pytest.mark.waits

# One goes through every condition. What control, language, size of the screen and haste can change
# shows on each kind of page, and these two conditions have them all.
FEWER = ("frequency", "direction")
CHOICES = [0, 0, 2, 0, 0, 1]
SCORES = [10, 3, 0, 8, 5, 1]


@dataclass(frozen=True, kw_only=True)
class Case:
    """How a session is answered, and on which screen; `hasty`: with Enter struck all the time."""

    control: Controls
    language: str
    size: tuple[int, int]
    hasty: bool = False
    conditions: tuple[str, ...] = FEWER


CASES = [
    Case(control="mouse", language="en", size=(800, 600), conditions=()),
    Case(control="keyboard", language="zh", size=(1280, 720)),
    Case(control="mouse", language="zh", size=(800, 600), hasty=True),
    Case(control="keyboard", language="en", size=(1280, 720), hasty=True),
]


@dataclass(frozen=True, kw_only=True)
class Sat:
    """The outcome of a session, and its person."""

    code: int
    complaint: str
    person: Person
    seat: Seat


def run_session(case: Case, folder: Path) -> Sat:
    """Run a whole session with one kind of input on a display of its own."""
    with virtual_display(*case.size) as display:
        study = short_study(READABLE_S, case.conditions)
        seat = Seat(folder / "study", display, study=study)
        # An Enter between the digits of 10 confirms 1, as it should.
        scores = [min(score, 9) if case.hasty else score for score in SCORES * 2]
        person = Person(display, case.control, CHOICES * 2, scores, hasty=case.hasty)
        with seat.start("--language", case.language, "--consent", "C-7") as session:
            striking = threading.Thread(target=strike_enter, args=(person, session, case.hasty))
            striking.start()
            code = session.attend(person)
            striking.join()
        return Sat(code=code, complaint=session.complaint, person=person, seat=seat)


def strike_enter(person: Person, session: Running, hasty: bool) -> None:
    """Strike Enter ten times a second until the session ends, if the person is hasty."""
    second = ["key", "Return", "sleep", "0.1"] * 10
    while hasty and session.process.poll() is None:
        person.xdotool(*second)


@pytest.fixture(scope="module")
def sat(small_display: str, tmp_path_factory: pytest.TempPathFactory) -> list[Sat]:
    """Run all sessions at the same time, because each mostly waits."""
    folders = [tmp_path_factory.mktemp("seat") for _ in CASES]
    with ThreadPoolExecutor(len(CASES)) as pool:
        return list(pool.map(run_session, CASES, folders))


@pytest.mark.parametrize("case", CASES, ids=str)
def test_the_journal_contains_every_answer_given_on_the_screen(case: Case, sat: list[Sat]) -> None:
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
    assert opened["language"] == case.language


@pytest.mark.parametrize("case", CASES, ids=str)
def test_no_page_can_be_answered_again(case: Case, sat: list[Sat]) -> None:
    assert sat[CASES.index(case)].person.revived == 0


@pytest.mark.parametrize("case", CASES, ids=str)
def test_no_touch_and_no_answer_comes_within_a_second_of_its_page(
    case: Case, sat: list[Sat]
) -> None:
    done = sat[CASES.index(case)]
    started = [entry["instruction"]["trace"] for entry in done.seat.payloads("touch-started")]
    answers = [trace for entry in done.seat.payloads("answered") for trace in entry["traces"]]
    assert len(started) == (6 if case.conditions else 12)
    for trace in (*started, *answers):
        assert trace["confirmed_s"] >= READABLE_S
        assert all(change["t_s"] <= trace["confirmed_s"] for change in trace["changes"])
    early = sum(trace["early_presses"] for trace in started)
    assert (early > 0) is case.hasty


@pytest.mark.parametrize("case", CASES, ids=str)
def test_each_answer_has_its_trace(case: Case, sat: list[Sat]) -> None:
    done = sat[CASES.index(case)]
    for entry in done.seat.payloads("answered")[1:]:
        for trace, reaction_s in zip(entry["traces"], entry["reaction_time_s"], strict=True):
            assert trace["changes"][0] == trace["start"]
            assert {change["by"] for change in trace["changes"]} == {
                "pointer" if case.control == "mouse" else "key"
            }
            assert 0 < trace["start"]["t_s"] <= reaction_s <= trace["confirmed_s"]
            assert reaction_s == trace["changes"][-1]["t_s"]
            assert trace["display"]["size_px"] == list(case.size)
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
