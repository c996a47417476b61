"""The window is on the screen that was asked for, says where it is, and notices when it is not."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from protocol.study.participant_texts import study_wording
from protocol.study_file.loading import parsed_study, template
from runner.screens import Instruction
from runner.window.client import WindowGone, participant_window
from runner.window.elements import in_window, on_canvas
from runner.window.messages import Settings
from runner.window.place import Area, Wanted
from runner.window.question_pages import BUTTON
from tests.runner.command_line import TOUCHBEAM
from tests.runner.window.desktop import BESIDE, PARTICIPANT, Desk, Monitor, desk, until
from tests.runner.window.sessions import Seat, short_study, tiny_study

OPERATOR = Area(x=0, y=0, width=1280, height=1024)
OTHER = Area(x=1280, y=0, width=1024, height=768)
COMMAND = (TOUCHBEAM, "participant-window")
ENGLISH = study_wording(parsed_study(template("paper")), "en")


@pytest.mark.parametrize("x", [-400.0, 0.0, 123.4])
@pytest.mark.parametrize("y", [-208.0, 300.0])
def test_a_press_is_where_it_is_seen_whether_told_in_points_or_in_pixels(
    x: float, y: float
) -> None:
    pixels, points = (2880, 1800), (1440, 900)
    assert in_window(x, y, points) == tuple(side / 2 for side in in_window(x, y, pixels))
    for size in (pixels, points):
        assert on_canvas(*in_window(x, y, size), size) == pytest.approx((x, y))


def test_a_window_must_fill_its_screen_and_one_with_a_size_stand_on_it() -> None:
    full, small = Wanted(number=1, screen=OTHER), Wanted(number=1, screen=OTHER, size=(800, 600))
    assert full.is_met_by(OTHER)
    assert not full.is_met_by(Area(x=1280, y=22, width=1024, height=746))
    assert small.is_met_by(Area(x=1393, y=106, width=800, height=600))
    assert not small.is_met_by(Area(x=200, y=106, width=800, height=600))
    assert not small.is_met_by(Area(x=1393, y=106, width=640, height=600))


def test_a_lost_screen_is_told_apart_from_a_window_that_left_it() -> None:
    full = Wanted(number=1, screen=OTHER)
    assert full.lost(OTHER, [OPERATOR, OTHER]) == ""
    assert full.lost(OTHER, [OTHER]) == "", "the other one is none of its business"
    assert full.lost(OTHER, [OPERATOR]) == (
        "lost screen 1 (1024x768 at 1280,0): this computer now has 0 (1280x1024 at 0,0)"
    )
    assert full.lost(OPERATOR, [OPERATOR, OTHER]) == (
        "left screen 1 (1024x768 at 1280,0): it is 1280x1024 at 0,0"
    )


# On a desk with a window manager.

at_a_desk = pytest.mark.waits


@pytest.fixture
def table(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Desk]:
    """A desk with two monitors, on which windows of this test open."""
    with desk(*BESIDE) as made:
        monkeypatch.setenv("DISPLAY", made.display)
        monkeypatch.setenv("HOME", str(tmp_path))
        yield made


@at_a_desk
@pytest.mark.parametrize("number", [0, 1])
def test_the_window_fills_the_screen_that_was_asked_for(table: Desk, number: int) -> None:
    settings = Settings(wording=ENGLISH, screen=number)
    with participant_window(COMMAND, settings):
        assert table.place(PARTICIPANT) == BESIDE[number]


@at_a_desk
def test_a_small_window_is_on_the_screen_that_was_asked_for(table: Desk) -> None:
    settings = Settings(wording=ENGLISH, screen=1, windowed=True)
    with participant_window(COMMAND, settings):
        place = table.place(PARTICIPANT)
    assert (place.width, place.height) == (800, 600)
    assert BESIDE[1].x <= place.x <= BESIDE[1].x + BESIDE[1].width - 800


@at_a_desk
def test_a_press_on_a_button_of_the_second_screen_counts(table: Desk) -> None:
    settings = Settings(wording=ENGLISH, screen=1)
    with participant_window(COMMAND, settings) as participant:
        participant.show(Instruction(text="remember"))
        monitor = BESIDE[1]
        x, y = in_window(BUTTON.x, BUTTON.y, (monitor.width, monitor.height))
        answers: list[Any] = []

        def is_answered() -> bool:
            table.click(round(monitor.x + x), round(monitor.y + monitor.height - y))
            answers.append(participant.poll())
            return answers[-1] is not None

        until(is_answered)


NESTED = (BESIDE[0], Monitor(width=640, height=480), Monitor(width=1024, height=768))
"""Two projectors that show parts of the operator's screen. Each place of the last one belongs to
another screen, too, and a window manager takes that one."""


@at_a_desk
def test_a_window_that_cannot_be_put_on_its_screen_is_refused(tmp_path: Path) -> None:
    with desk(*NESTED) as table:
        seat = Seat(tmp_path / "study", table.display, study=tiny_study())
        with seat.start("--screen", "2") as running:
            assert running.end() == 1
    assert running.complaint.startswith(
        "touchbeam: the participant's window cannot be put on screen 2 (1024x768 at 0,0): the "
        "window manager leaves it 1280x1024 at 0,0; choose another one with --screen, or use "
        "--ratings console"
    )
    assert running.complaint.count("\n") == 1
    assert [path.name for path in seat.folder.iterdir()] == ["study.toml"], "nothing was armed"


@at_a_desk
def test_the_journal_says_where_the_window_was(table: Desk, tmp_path: Path) -> None:
    seat = Seat(tmp_path / "study", table.display, short_study(conditions=["pressure"]))
    with seat.start("--screen", "1", "--at-window", ratings="virtual") as running:
        assert running.end() == 0
    shown = [trace["display"] for entry in seat.payloads("answered") for trace in entry["traces"]]
    assert {tuple(display["place_px"]) for display in shown} == {(1280, 0)}
    assert {tuple(display["size_px"]) for display in shown} == {(1024, 768)}
    assert {display["screen"] for display in shown} == {1}


@at_a_desk
def test_a_screen_that_is_lost_in_a_touch_turns_the_output_off(table: Desk, tmp_path: Path) -> None:
    study = tiny_study().replace("voltage_v = 100 }]", "voltage_v = 100, duration_s = 20 }]", 1)
    seat = Seat(tmp_path / "study", table.display, study=study)
    with seat.start("--screen", "1", "--at-window", ratings="virtual") as running:
        until(lambda: len(running.said) > 1 and len(seat.payloads("touch-started")) > 1)
        table.remove_monitor(1)
        assert running.end() == 1
    assert running.complaint.startswith(
        "touchbeam: the participant's window lost screen 1 (1024x768 at 1280,0): this computer "
        "now has 0 (1280x1024 at 0,0)"
    )
    aborted, off = seat.events()[-2:]
    assert aborted.tag == "trial-aborted"
    assert (off.tag, off.payload["confirmed"]) == ("device-off", True)


@at_a_desk
def test_a_window_that_leaves_its_screen_is_noticed(table: Desk) -> None:
    with participant_window(COMMAND, Settings(wording=ENGLISH, screen=1, windowed=True)) as seat:
        table.run("xdotool", "windowmove", table.window(PARTICIPANT), "100", "100")
        left = r"left screen 1 \(1024x768 at 1280,0\): it is 800x600 at "
        with pytest.raises(WindowGone, match=left):
            until(seat.poll)
