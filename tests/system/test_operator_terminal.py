"""The operator's screen in a real session: on a terminal of its own, in real time."""

import re
import subprocess
import time
from itertools import pairwise
from pathlib import Path

import pytest

from protocol.journal.events import StoredEvent
from runner.journal.opening import read_journal
from tests.runner.command_line import TOUCHBEAM
from tests.system.pty_screen import OnTerminal, on_terminal

pytestmark = pytest.mark.waits

LATEST_S = 0.3
"""What was read is on the screen within this time."""
STUDY = """
[study]
name = "ramp"

[timing]
inter_trial_s = 0.2

[[condition]]
name = "voltage"
question = "strength"
expected = "stronger"
touches = [{ place = "smooth", voltage_v = 0, ramp_to_v = 200, duration_s = 6 }]
"""


def command(folder: Path, study: str = STUDY) -> list[str]:
    (folder / "study.toml").write_text(study, encoding="utf-8")
    run = [TOUCHBEAM, "run", str(folder), "--participant", "P01"]
    return [*run, "--ratings", "virtual", "--pace", "wall"]


def recorded(folder: Path) -> list[StoredEvent]:
    with read_journal(folder / "study.db") as journal:
        return [event for name in journal.sessions() for event in journal.events(name)]


def shown_v(text: str) -> int | None:
    """Return the monitor's figure on the screen."""
    found = re.search(r"^ monitor .*? (\d+) V  target", text, re.MULTILINE)
    return int(found[1]) if found else None


def measured(folder: Path) -> list[tuple[float, float]]:
    """Return the times (Unix) and monitor readings of the ramp that the journal has."""
    events = recorded(folder)
    ended = next(event for event in events if event.tag == "touch-ended")
    readings = ended.payload["read_back"]
    # The device is read last just before its output goes off, which the journal records then.
    last_s = readings[-1]["device_time_s"]
    return [
        (ended.utc.timestamp() + entry["device_time_s"] - last_s, entry["monitor_v"])
        for entry in readings
    ]


@pytest.mark.parametrize(("width", "height"), [(80, 24), (120, 40)])
def test_the_screen_follows_a_ramp_to_200_v(tmp_path: Path, width: int, height: int) -> None:
    seen: list[tuple[float, int]] = []
    with on_terminal(command(tmp_path), width, height) as terminal:
        while terminal.look():
            volts = shown_v(terminal.screen.text)
            if volts is not None and "touching: voltage" in terminal.screen.text:
                seen.append((time.time(), volts))
        assert terminal.process.wait(10) == 0
    readings = measured(tmp_path)
    assert readings[0][1] < 10
    assert readings[-1][1] > 190
    ramp = [(at_s, volts) for at_s, volts in seen if readings[0][0] < at_s < readings[-1][0]]
    for at_s, volts in ramp:
        before = max(v for t, v in readings if t <= at_s - LATEST_S or t == readings[0][0])
        after = min(v for t, v in readings if t >= at_s or t == readings[-1][0])
        assert before - 3 <= volts <= after + 3, f"{volts} V, read {before} to {after} V"
    distinct = [volts for _, volts in ramp]
    changes = sum(first != second for first, second in pairwise(distinct))
    assert changes >= 5 * 6, "five times a second, for six seconds"


def at_the_ramp(terminal: OnTerminal) -> None:
    terminal.watch(lambda text: "touching: voltage" in text)


def unwatched(terminal: OnTerminal, seconds: float) -> None:
    """Let the program go on while nobody reads what it writes, so that its terminal fills."""
    with pytest.raises(subprocess.TimeoutExpired, match="timed out"):
        terminal.process.wait(seconds)


def awaited(terminal: OnTerminal, folder: Path, tag: str) -> StoredEvent:
    """Return the first event with this tag once it is recorded."""
    for _ in range(400):
        for event in recorded(folder):
            if event.tag == tag:
                return event
        unwatched(terminal, 0.1)
    raise AssertionError(f"no {tag}")


@pytest.mark.parametrize("key", ["e", " ", "\x05", "\x13e"])
def test_the_emergency_stop_works_on_a_terminal_that_takes_nothing(
    tmp_path: Path, key: str
) -> None:
    """Its buffer is full, because nobody looks; Ctrl-S stops nothing either."""
    with on_terminal(command(tmp_path), 200, 60) as terminal:
        at_the_ramp(terminal)
        unwatched(terminal, 1.5)
        pressed_s = time.time()
        terminal.type(key)
        off = awaited(terminal, tmp_path, "device-off")
        assert off.payload["confirmed"] is True
        assert off.utc.timestamp() - pressed_s < 2
        assert terminal.end() == 1
    assert "touchbeam: emergency stop; output off, read back" in terminal.screen.text


def test_a_session_goes_on_while_a_terminal_takes_nothing(tmp_path: Path) -> None:
    with on_terminal(command(tmp_path), 200, 60) as terminal:
        at_the_ramp(terminal)
        awaited(terminal, tmp_path, "session-completed")
        assert terminal.end() == 0
    assert "P01/1 is complete" in terminal.screen.text


def test_every_key_has_an_echo_and_the_log_stays(tmp_path: Path) -> None:
    with on_terminal(command(tmp_path), 80, 24) as terminal:
        at_the_ramp(terminal)
        for keys, echo in (
            ("x", "that key does nothing here"),
            ("p", "PAUSE after this trial"),
            ("p", "no pause"),
            ("?", "break the running trial off"),
            ("?", "log"),
            ("nskin dry\r", "noted: skin dry"),
            ("a", "nobody is calling"),
            ("rr", "will be repeated"),
            ("s", "stopping"),
        ):
            terminal.type(keys)
            terminal.watch(lambda text, echo=echo: echo in text)  # type: ignore[misc]
        assert terminal.end() == 1
    for said in ("noted: skin dry", "will be repeated", "touchbeam: stopped by the operator"):
        assert said in terminal.screen.text.rpartition("EMERGENCY STOP")[2]
    tags = [event.tag for event in recorded(tmp_path)]
    assert tags.count("trial-aborted") == 1
