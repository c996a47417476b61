"""A virtual participant at the real window answers with its keys as through the port."""

import os
import signal
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.protocol.studies import OWN_QUESTIONS
from tests.runner.command_line import typed
from tests.runner.window.person import Person
from tests.runner.window.sessions import Seat, short_study, tiny_study

pytestmark = pytest.mark.waits

# With all questions and all kinds of pages that a session has.
CONDITIONS = ("frequency", "direction", "voltage", "pressure")
PEOPLE = """
[person]
rating_noise = 2.0
reaction_median_s = 0.2
"""


@dataclass(frozen=True, kw_only=True)
class Sat:
    """The same person's sessions through the port and at the window."""

    port: Seat
    window: Seat
    codes: tuple[int, ...]
    complaints: tuple[str, ...]


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> str:
    file = tmp_path_factory.mktemp("people") / "people.toml"
    file.write_text(PEOPLE, encoding="utf-8")
    return str(file)


@pytest.fixture(scope="module")
def sat(small_display: str, people: str, tmp_path_factory: pytest.TempPathFactory) -> Sat:
    folder = tmp_path_factory.mktemp("seat")
    port, window = (
        Seat(folder / name, small_display, short_study(conditions=CONDITIONS) + OWN_QUESTIONS)
        for name in ("port", "window")
    )
    options = ("--people", people, "--seed", "5")
    with (
        port.start(*options, ratings="virtual") as at_port,
        window.start(*options, "--at-window", ratings="virtual") as at_window,
    ):
        codes = (at_port.end(), at_window.end())
    complaints = (at_port.complaint, at_window.complaint)
    return Sat(port=port, window=window, codes=codes, complaints=complaints)


def given(seat: Seat) -> list[Any]:
    """Return everything that was answered, without the times."""
    of_trials = [
        (entry["change"], entry["score"], [own["answer"] for own in entry["questions"]])
        for entry in seat.payloads("answered")
    ]
    asked = [entry["answer"] for entry in seat.payloads("question-answered")]
    return [*of_trials, *asked]


def test_the_answers_are_those_through_the_port(sat: Sat) -> None:
    assert sat.codes[:2] == (0, 0), sat.complaints
    assert given(sat.window) == given(sat.port)
    scores = [entry["score"] for entry in sat.window.payloads("answered")]
    assert sum(score is not None for score in scores) > 1


def test_each_answer_was_pressed_at_the_window(sat: Sat) -> None:
    answered = [entry for entry in sat.window.payloads("answered") if entry["change"]]
    assert answered
    for entry in answered:
        for trace, reaction_s in zip(entry["traces"], entry["reaction_time_s"], strict=True):
            assert {change["by"] for change in trace["changes"]} == {"key"}
            assert reaction_s == trace["changes"][-1]["t_s"]
            assert trace["screens"][-1]["frames"] > 0
            assert trace["early_presses"] == 0
    by = {
        own["name"]: {change["by"] for change in own["trace"]["changes"]}
        for entry in [*answered, {"questions": sat.window.payloads("question-answered")}]
        for own in entry["questions"]
        if own["answer"] is not None
    }
    assert by.pop("confidence") == {"pointer"}
    assert {frozenset(each) for each in by.values()} == {frozenset({"key"})}


def test_the_session_is_a_rehearsal_of_a_virtual_person(sat: Sat) -> None:
    def opened(seat: Seat) -> Mapping[str, Any]:
        return seat.payloads("session-opened")[0]

    assert opened(sat.window)["kind"] == "rehearsal"
    assert opened(sat.window)["virtual"] == opened(sat.port)["virtual"]
    assert opened(sat.window)["virtual"]["rating_noise"] == 2.0
    assert sat.window.payloads("device-off")[-1]["confirmed"] is True


def test_a_window_that_ends_leaves_the_output_off_and_the_session_to_be_resumed(
    small_display: str, people: str, tmp_path: Path
) -> None:
    seat = Seat(tmp_path / "study", small_display, study=tiny_study())
    watcher = Person(small_display, "keyboard")
    with seat.start("--people", people, "--at-window", ratings="virtual") as session:
        # A line is printed once the session is open; the one before it says there is one screen.
        while len(session.said) < 2 or len(seat.payloads("touch-started")) < 2:
            assert session.process.poll() is None
            watcher.look_later()
        os.kill(session.window_process(), signal.SIGKILL)
        assert session.end() == 1
    assert session.complaint.startswith("touchbeam: the participant's window ")
    off = seat.events()[-1]
    assert (off.tag, off.payload["confirmed"]) == ("device-off", True)
    with seat.start(ratings="virtual") as resumed:
        assert resumed.end() == 0, resumed.complaint
    assert seat.events()[-1].tag == "session-completed"


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (("--ratings", "window"), "--at-window is for --ratings virtual, got window"),
        (("--ratings", "virtual", "--pace", "stepped"), "--pace stepped needs --device sim and"),
    ],
)
def test_people_and_stepped_time_do_not_press_keys(
    options: tuple[str, ...],
    complaint: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    typed("new", tmp_path / "study")
    capsys.readouterr()
    arguments = ("--participant", "P01", "--at-window", *options)
    assert typed("run", tmp_path / "study", *arguments) == 2
    assert complaint in capsys.readouterr().err
