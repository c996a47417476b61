"""A failing window: the session ends with the device off and a reason, and can be resumed."""

import os
import signal
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import pytest

from protocol.journal.events import StoredEvent
from tests.runner.window.person import Person, virtual_display
from tests.runner.window.sessions import Running, Seat, tiny_study

pytestmark = pytest.mark.waits

LATIN_FONTS_ONLY = """<?xml version="1.0"?>
<!DOCTYPE fontconfig SYSTEM "fonts.dtd">
<fontconfig><dir>/usr/share/fonts/truetype/dejavu</dir></fontconfig>
"""
LONG_SIGNAL = "voltage_v = 100, duration_s = 8 }]"


def stop(running: Running, person: Person) -> None:
    os.kill(running.window_process(), signal.SIGSTOP)


def crash(running: Running, person: Person) -> None:
    os.kill(running.window_process(), signal.SIGKILL)


def close(running: Running, person: Person) -> None:
    person.close_window()


def lose_display(running: Running, person: Person) -> None:
    """The server of the person's display ends."""
    running.lose_display()


def begun(seat: Seat, running: Running) -> int:
    """Return the number of touches begun; the console prints a line once the session is open.

    The line before it says that there is one screen.
    """
    return len(seat.payloads("touch-started")) if len(running.said) > 1 else 0


@dataclass(frozen=True, kw_only=True)
class Case:
    """What fails, the expected message, and how the session is resumed."""

    name: str
    harm: Callable[[Running, Person], None]
    complaint: str
    goes_on: str = "virtual"


CASES = [
    Case(
        name="stopped",
        harm=stop,
        complaint="the participant's window does not respond (silent for 2 s)",
        goes_on="console",
    ),
    Case(
        name="crashed",
        harm=crash,
        complaint="the participant's window ended unexpectedly (signal SIGKILL); --ratings",
    ),
    Case(name="closed", harm=close, complaint="the participant's window was closed"),
    Case(
        name="display lost",
        harm=lose_display,
        complaint="the participant's window ended unexpectedly",
    ),
]


@dataclass(frozen=True, kw_only=True)
class Harmed:
    """How a session ended and was resumed."""

    code: int
    complaint: str
    events: list[StoredEvent]
    resumed: int
    resumed_events: list[StoredEvent]


def harmed(case: Case, folder: Path) -> Harmed:
    """Harm the window while the output is on; resume without one."""
    study = tiny_study().replace("voltage_v = 100 }]", LONG_SIGNAL, 1)
    with ExitStack() as stack:
        display = stack.enter_context(virtual_display(800, 600))
        seat = Seat(folder / "study", display, study=study)
        person = Person(display, "keyboard")
        with seat.start() as running:
            running.lose_display = stack.close
            while begun(seat, running) < 2 and running.process.poll() is None:
                person.act()
            case.harm(running, person)
            code = running.end()
        events = seat.events()
        with seat.start(ratings=case.goes_on) as resumed:
            resumed.type("1\n" * 99)
            again = resumed.end()
    return Harmed(
        code=code,
        complaint=running.complaint,
        events=events,
        resumed=again,
        resumed_events=seat.events(),
    )


@pytest.fixture(scope="module")
def all_harmed(small_display: str, tmp_path_factory: pytest.TempPathFactory) -> list[Harmed]:
    """Run one session at a time: a window that is slow to draw would count as one that hangs."""
    return [harmed(case, tmp_path_factory.mktemp("seat")) for case in CASES]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_the_device_goes_off_and_the_session_can_be_resumed_without_a_window(
    case: Case, all_harmed: list[Harmed]
) -> None:
    done = all_harmed[CASES.index(case)]
    assert done.code == 1
    assert done.complaint.startswith(f"touchbeam: {case.complaint}")
    assert done.complaint.count("\n") == 1
    assert "--ratings console" in done.complaint
    aborted, off = done.events[-2:]
    assert (aborted.tag, aborted.payload["index"]) == ("trial-aborted", 1)
    assert (off.tag, off.payload["confirmed"]) == ("device-off", True)
    assert done.resumed == 0
    assert done.resumed_events[-1].tag == "session-completed"


@pytest.mark.parametrize(
    ("options", "environment", "complaint"),
    [
        ((), {"DISPLAY": ""}, "the participant's window needs a display (DISPLAY is not set)"),
        ((), {"DISPLAY": ":941"}, "the participant's window cannot open on :941"),
        (("--screen", "3"), {}, "--screen 3 does not exist; this computer has 0 (800x600)"),
        (
            ("--language", "zh"),
            {"FONTCONFIG_FILE": "fonts.conf"},
            "no font for the language zh (looked for WenQuanYi Micro Hei, Noto Sans CJK JP",
        ),
    ],
    ids=["no display", "dead display", "no such screen", "no font"],
)
def test_a_window_that_cannot_open_gives_one_line_and_leaves_nothing_behind(
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


def test_a_stopped_session_ends_on_a_page_that_the_participant_closes(
    small_display: str, tmp_path: Path
) -> None:
    study = tiny_study().replace("voltage_v = 100 }]", LONG_SIGNAL, 1)
    seat = Seat(tmp_path / "study", small_display, study=study)
    person = Person(small_display, "keyboard")
    with seat.start() as running:
        while begun(seat, running) < 2 and running.process.poll() is None:
            person.act()
        running.type(":s\n")
        while person.sight() != "button" and running.process.poll() is None:
            person.look_later()
        assert running.process.poll() is None, "the page stays"
        assert seat.events()[-1].tag == "device-off", "but not the output"
        person.key("Return")
        assert running.end() == 1
    assert running.complaint.startswith("touchbeam: stopped by the operator; output off, read back")
    assert any("the participant's last page stays for up to 20 s" in line for line in running.said)


def test_a_participant_whose_session_was_killed_is_asked_to_lift_the_finger(
    small_display: str, tmp_path: Path
) -> None:
    study = tiny_study().replace("voltage_v = 100 }]", LONG_SIGNAL, 1)
    seat = Seat(tmp_path / "study", small_display, study=study)
    person = Person(small_display, "keyboard")
    with seat.start() as running:
        while begun(seat, running) < 2 and running.process.poll() is None:
            person.act()
        window = running.window_process()
        running.process.kill()
        running.end()
    while person.sight() != "button":
        assert Path(f"/proc/{window}").exists(), "the page stays"
        person.look_later()
    person.key("Return")
    while Path(f"/proc/{window}").exists():
        person.look_later()
