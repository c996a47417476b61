"""Programs that drive a rig in another process: killed, hung, stopped, and two at once."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import touchbeam
from device.simulator.client import ControlClient, Endpoints, simulator_process
from runner.journal.cohort import states
from runner.journal.opening import read_journal
from runner.journal.verification import verdicts
from tests.device.rigs import TOUCHBEAM, until
from tests.runner.command_line import typed

pytestmark = pytest.mark.waits

WATCHDOG_S = 0.5
PROGRAM = """\
import signal, sys, time, touchbeam
# A shell starts what runs beside it with Ctrl-C ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)
url, folder, then = sys.argv[1:]
rig = touchbeam.open_rig(folder, url, journal=folder)
rig.drive(100, 24_221.37)
rig.wait(0.4)
print("on", flush=True)
if then == "hang":
    time.sleep(60)
while then == "wait":
    rig.wait(0.1)
"""


@pytest.fixture(scope="module")
def simulator() -> Iterator[Endpoints]:
    with simulator_process(TOUCHBEAM, seed=1, keep=True) as endpoints:
        yield endpoints


@pytest.fixture
def control(simulator: Endpoints) -> Iterator[ControlClient]:
    with ControlClient(simulator.control) as control:
        control.reset()
        yield control


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    assert typed("new", str(tmp_path / "study")) == 0
    return tmp_path / "study"


@contextmanager
def program(url: str, folder: Path, then: str) -> Iterator["subprocess.Popen[str]"]:
    """A program that drives the rig at `url` and has just said so."""
    command = [sys.executable, "-c", PROGRAM, url, str(folder), then]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "on\n"
            yield process
        finally:
            process.kill()


def test_a_program_that_is_killed_leaves_the_output_off_within_the_watchdogs_time(
    simulator: Endpoints, control: ControlClient, folder: Path
) -> None:
    with program(simulator.url, folder, "wait") as process:
        assert until(lambda: control.state()["voltage_v"] > 90, within_s=2)
        os.kill(process.pid, signal.SIGKILL)
        killed_s = time.monotonic()
        assert until(lambda: control.state()["voltage_v"] == 0, within_s=2)
        state = control.state()
        assert (state["output"], state["cause"]) == (False, "WATC")
        assert state["tripped_wall_s"] - killed_s <= WATCHDOG_S
    with read_journal(folder / "study.db") as journal:
        assert states(journal)["script/1"].name == "driving", "nobody has read back its end"
        assert all(verdict.ok for verdict in verdicts(journal))
    # The rig and its lock are free again, and the next program has a session of its own.
    with touchbeam.open_rig(folder, simulator.url, journal=folder) as rig:
        assert rig.drive(50, 24_221.37).output
        rig.off()
        assert typed("status", str(folder)) == 0
    excluded = ("--participant", "script", "--reason", "killed")
    assert typed("exclude", str(folder), *excluded) == 0
    with read_journal(folder / "study.db") as journal:
        kept = {name: state.shown_name for name, state in states(journal).items()}
    assert kept == {"script/1": "excluded", "script/2": "completed"}


def test_a_program_that_hangs_is_ended_by_the_watchdog(
    simulator: Endpoints, control: ControlClient, folder: Path
) -> None:
    with program(simulator.url, folder, "hang"):
        assert until(lambda: control.state()["output"] is False, within_s=3)
        assert control.state()["cause"] == "WATC"


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGTERM, 128 + signal.SIGTERM), (signal.SIGINT, -signal.SIGINT)]
)
def test_a_program_that_is_stopped_turns_the_output_off_itself(
    simulator: Endpoints, control: ControlClient, folder: Path, number: int, code: int
) -> None:
    with program(simulator.url, folder, "wait") as process:
        os.kill(process.pid, number)
        assert process.wait(10) == code
        assert (control.state()["output"], control.state()["tripped"]) == (False, False)
    with read_journal(folder / "study.db") as journal:
        assert states(journal)["script/1"].name == "completed"


def test_the_end_of_the_interpreter_turns_the_output_off(
    simulator: Endpoints, control: ControlClient, folder: Path
) -> None:
    with program(simulator.url, folder, "end") as process:
        assert process.wait(10) == 0
        assert process.stderr is not None
        opening = (
            f"touchbeam: opening the rig at {simulator.url} (board); nobody may touch the beam"
        )
        assert process.stderr.read() == f"{opening} yet\n"
        assert (control.state()["output"], control.state()["tripped"]) == (False, False)
    with read_journal(folder / "study.db") as journal:
        assert states(journal)["script/1"].name == "completed"


def test_a_rig_is_driven_by_one_program(simulator: Endpoints, folder: Path) -> None:
    with touchbeam.open_rig(folder, simulator.url) as rig:
        with pytest.raises(RuntimeError, match=r"is in use by .*; end that session first"):
            touchbeam.open_rig(folder, simulator.url)
        assert typed("run", str(folder), "--participant", "P01", "--ratings", "virtual",
                     "--device", simulator.url) == 1  # fmt: skip
        assert rig.drive(50, 24_221.37).output
    assert not (folder / "study.db").exists()


def test_a_device_without_a_working_watchdog_is_refused(
    simulator: Endpoints, control: ControlClient, folder: Path
) -> None:
    control.fault("watchdog-dead")
    with pytest.raises(RuntimeError, match="the device's watchdog did not trip"):
        touchbeam.open_rig(folder, simulator.url, journal=folder)
    assert control.state()["output"] is False
    with read_journal(folder / "study.db") as journal:
        tags = [event.tag for event in journal.events("script/1")]
    assert tags[1:] == ["device-armed", "watchdog-tested", "device-off", "session-completed"]


def test_the_simulated_rig_has_real_time_if_asked(folder: Path) -> None:
    with touchbeam.open_rig(real_time=True) as rig:
        rig.drive(100, 24_221.37)
        assert rig.hand is not None
        hand = rig.hand  # nobody beats meanwhile, as in a program that hangs
        assert until(lambda: hand.state()["output"] is False, within_s=3)
        with pytest.raises(RuntimeError, match=r"watchdog tripped: .*; output off, read back"):
            rig.wait(1)
