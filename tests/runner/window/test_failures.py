"""A window that fails: the session ends with the device off, says why, and can be resumed."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.runner.window.person import Person, virtual_display
from tests.runner.window.sessions import Running, Seat, short_study

LATIN_FONTS_ONLY = """<?xml version="1.0"?>
<!DOCTYPE fontconfig SYSTEM "fonts.dtd">
<fontconfig><dir>/usr/share/fonts/truetype/dejavu</dir></fontconfig>
"""
LONG_S = 10.0
LONG_SIGNAL = f"voltage_v = 100, duration_s = {LONG_S} }}]"


def stop(running: Running, person: Person) -> None:
    os.kill(running.window_process(), signal.SIGSTOP)


def crash(running: Running, person: Person) -> None:
    os.kill(running.window_process(), signal.SIGKILL)


def close(running: Running, person: Person) -> None:
    person.xdotool("search", "--name", "touchbeam", "windowclose")


def lose_display(running: Running, person: Person) -> None:
    """The server of the person's display ends."""
    running.lose_display()


def begun(seat: Seat, running: Running) -> int:
    """How many touches have begun; the operator is told of the session once it is opened."""
    return len(seat.payloads("touch-started")) if running.said else 0


@pytest.fixture
def own_display(small_display: str) -> Iterator[tuple[str, Callable[[], None]]]:
    """A display that may be lost."""
    with ExitStack() as stack:
        name = stack.enter_context(virtual_display(800, 600))
        yield name, stack.close


@pytest.mark.parametrize(
    ("harm", "complaint", "goes_on"),
    [
        (stop, "the participant's window is stuck (silent for 2 s)", "console"),
        (crash, "the participant's window has ended unexpectedly", "virtual"),
        (close, "the participant's window was closed", "virtual"),
        (lose_display, "the participant's window has ended unexpectedly", "virtual"),
    ],
    ids=["stopped", "crashed", "closed", "display lost"],
)
def test_the_device_goes_off_and_the_session_can_go_on_without_a_window(
    harm: Callable[[Running, Person], None],
    complaint: str,
    goes_on: str,
    own_display: tuple[str, Callable[[], None]],
    tmp_path: Path,
) -> None:
    display, lose = own_display
    seat = Seat(tmp_path / "study", display)
    study = short_study().replace("voltage_v = 100 }]", LONG_SIGNAL, 1)
    (seat.folder / "study.toml").write_text(study, encoding="utf-8")
    person = Person(display, "keyboard")
    with seat.start() as running:
        running.lose_display = lose
        while begun(seat, running) < 2:
            assert running.process.poll() is None, running.end()
            person.act()
        harmed_s = time.monotonic()
        harm(running, person)
        assert running.end() == 1
        assert time.monotonic() - harmed_s < LONG_S, "it did not wait for the end of the touch"
        assert running.complaint.startswith(f"touchbeam: {complaint}")
        assert running.complaint.count("\n") == 1
        assert "--ratings console" in running.complaint
    assert seat.payloads("device-off")[-1]["confirmed"] is True
    assert seat.payloads("trial-aborted")[-1]["index"] == 1

    with seat.start(ratings=goes_on) as resumed:
        resumed.type("1\n" * 99)
        assert resumed.end() == 0, resumed.complaint
    assert seat.events()[-1].tag == "session-completed"


@pytest.mark.parametrize(
    ("options", "environment", "complaint"),
    [
        ((), {"DISPLAY": ""}, "there is no display for the participant's window"),
        ((), {"DISPLAY": ":941"}, "the participant's window cannot open on :941"),
        (("--screen", "3"), {}, "--screen 3 is not there; this machine has 0 (800x600)"),
        (
            ("--language", "zh"),
            {"FONTCONFIG_FILE": "fonts.conf"},
            "no font for the language zh (looked for WenQuanYi Micro Hei, Noto Sans CJK JP",
        ),
    ],
    ids=["no display", "dead display", "no such screen", "no font"],
)
def test_a_window_that_cannot_open_says_why_in_one_line_and_leaves_nothing_behind(
    options: tuple[str, ...],
    environment: dict[str, str],
    complaint: str,
    small_display: str,
    tmp_path: Path,
) -> None:
    (tmp_path / "fonts.conf").write_text(LATIN_FONTS_ONLY, encoding="utf-8")
    if "FONTCONFIG_FILE" in environment:
        environment = {"FONTCONFIG_FILE": str(tmp_path / "fonts.conf")}
    seat = Seat(tmp_path / "study", small_display, more_environment=environment)
    with seat.start(*options) as running:
        assert running.end() == 1
    assert running.complaint.startswith(f"touchbeam: {complaint}")
    assert running.complaint.count("\n") == 1
    assert "--ratings console" in running.complaint
    assert [path.name for path in seat.folder.iterdir()] == ["study.toml"]
