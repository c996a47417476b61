"""Programs that stand still while the output is on, at random moments of touches.

Ctrl-Z, a computer that sleeps, an interpreter that is stuck: all that matters is that nothing runs.
"""

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import pytest

from device.simulator.client import ControlClient, simulator_process
from protocol.journal import events
from protocol.journal.events import StoredEvent
from runner.journal.opening import read_journal
from tests.device.rigs import TOUCHBEAM, until

pytestmark = pytest.mark.waits

WATCHDOG_S = 0.5
TOUCH_S, LEAD_IN_S = 4.0, 0.3
LONGEST_STALL_S = 12.0
STUDY = f"""
[study]
name = "stalls"
[rig]
dialect = "{{dialect}}"
amplifier_gain = 20
generator_max_vpp = 20
ramp_v_per_s = 2000
[touch]
lead_in_s = {LEAD_IN_S}
[design]
participants = 1
[[condition]]
name = "one touch"
question = "roughness"
expected = "same"
touches = [{{{{ place = "smooth", voltage_v = 100, duration_s = {TOUCH_S} }}}}]
"""
SLIDE = """
[slide]
frequencies = [0.99, 1.0, 1.01]
references = 1
speeds_m_s = [0.02]
"""
PROGRAM = """\
import sys, touchbeam
with touchbeam.open_rig(sys.argv[1], sys.argv[2], journal=sys.argv[1]) as rig:
    rig.drive(100, 24_221.37)
    for _ in range(40):
        rig.wait(0.1)
"""
COMMANDS = {
    "run": (
        *(*TOUCHBEAM, "run", "{study}", "--device", "{url}", "--participant", "P01"),
        *("--ratings", "virtual", "--seed", "1"),
    ),
    "slide": (*TOUCHBEAM, "slide", "{study}", "--device", "{url}", "--rehearsal"),
    "open_rig": (sys.executable, "-c", PROGRAM, "{study}", "{url}"),
}
CASES = [("run", dialect) for dialect in ("board", "keysight", "siglent", "rigol")]
CASES += [("slide", "board"), ("open_rig", "keysight")]
IN_THE_SUITE, ALL = 2, 10


@dataclass
class Stalled:
    """A program that was stopped for `stall_s` while it drove, and went on."""

    said: str
    code: int
    stall_s: float
    off_within_s: float
    journal: list[StoredEvent]


@contextmanager
def driving(command: str, url: str, study: Path) -> Iterator["subprocess.Popen[str]"]:
    words = [
        word.format(study=study, url=url) if "{" in word else word for word in COMMANDS[command]
    ]
    with subprocess.Popen(
        words,
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def stalled(study: Path, command: str, dialect: str, chance: random.Random) -> Stalled:
    """Stop the program at a random moment of its touch, for a random time."""
    study.mkdir()
    text = STUDY.format(dialect=dialect) + SLIDE * (command == "slide")
    (study / "study.toml").write_text(text, encoding="utf-8")
    calibration = '{"frequency_hz": 24000.0, "tip_m_per_v": 9.0e-9}'
    (study / "calibration.json").write_text(calibration, encoding="ascii")
    wire = "pty" if dialect == "board" else "tcp"
    with (
        simulator_process(TOUCHBEAM, seed=1, dialect=dialect, wire=wire, keep=True) as simulator,
        ControlClient(simulator.control) as control,
        driving(command, simulator.url, study) as process,
    ):

        def driven() -> bool:
            assert process.stdin is not None
            with suppress(BrokenPipeError):
                process.stdin.write("\n")  # confirms whatever is asked
                process.stdin.flush()
            return process.poll() is not None or control.state()["voltage_v"] > 50

        assert until(driven, within_s=60)
        time.sleep(chance.uniform(0, 0.5 * TOUCH_S))
        stall_s = chance.uniform(1, LONGEST_STALL_S)
        begin_s = time.monotonic()
        os.kill(process.pid, signal.SIGSTOP)
        until(lambda: control.state()["output"] is False, within_s=2)
        off_within_s = time.monotonic() - begin_s
        time.sleep(max(begin_s + stall_s - time.monotonic(), 0))
        os.kill(process.pid, signal.SIGCONT)
        assert process.stderr is not None
        said = process.stderr.read()
        code = process.wait()
        assert control.state()["output"] is False
    with read_journal(study / "study.db") as journal:
        (name,) = journal.sessions()
        return Stalled(said, code, stall_s, off_within_s, journal.events(name))


def counted_touches_s(journal: list[StoredEvent]) -> list[float]:
    """How long the touches of answered trials lasted, by the times of their events."""
    lengths_s: list[float] = []
    for before, after in pairwise(journal):
        made = before.record, after.record
        if [*map(type, made)] == [events.TouchStarted, events.TouchEnded]:
            lengths_s.append((after.utc - before.utc).total_seconds())
    answered = any(isinstance(event.record, events.Answered) for event in journal)
    return lengths_s if answered else []


@pytest.mark.parametrize(
    "draw",
    [pytest.param(n, marks=[pytest.mark.soak] * (n >= IN_THE_SUITE)) for n in range(ALL)],
)
@pytest.mark.parametrize(("command", "dialect"), CASES)
def test_no_stall_passes_unseen_and_no_touch_counts_that_lasted_longer(
    tmp_path: Path, command: str, dialect: str, draw: int
) -> None:
    made = stalled(
        tmp_path / "study", command, dialect, random.Random(f"{command} {dialect} {draw}")
    )
    print(f"{command} {dialect}: off after {made.off_within_s:.2f} s of {made.stall_s:.1f} s")
    assert made.code == 1, made.said
    assert "output off, read back" in made.said
    assert made.off_within_s < WATCHDOG_S + 0.2
    planned_s = LEAD_IN_S + TOUCH_S
    assert [it for it in counted_touches_s(made.journal) if it > planned_s + 1] == []
    tags = [event.tag for event in made.journal]
    if command != "open_rig":
        assert "answered" not in tags[tags.index("trial-aborted") :]
    assert "device-off" in tags
    assert "session-completed" not in tags or command == "open_rig"
