"""Ctrl-Z and its signals, in a shell with job control: no device goes on driving meanwhile."""

import random
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import psutil
import pytest

from device.resonance import Resonance
from device.simulator.client import ControlClient, simulator_process
from protocol.journal.events import StoredEvent
from runner.journal.opening import read_journal
from runner.journal.verification import verdicts
from runner.study.calibration import keep_calibration
from tests.runner.command_line import TOUCHBEAM
from tests.system.pty_screen import OnTerminal, on_terminal

pytestmark = pytest.mark.waits

TOUCH_S = 2.0
STUDY = f"""
[study]
name = "held"

[rig]
dialect = "keysight"
amplifier_gain = 50

[timing]
inter_trial_s = 0.2

[touch]
lead_in_s = 0.5

[[condition]]
name = "voltage"
question = "strength"
expected = "stronger"
touches = [{{ place = "smooth", voltage_v = 100, duration_s = {TOUCH_S} }}]
"""
SHELL = (
    sys.executable,
    "-c",
    "import fcntl, os, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0);"
    "os.execvp('bash', ['bash', '--norc', '--noprofile', '--noediting', '-i'])",
)
"""A shell whose terminal is its own, as the programs in its foreground need it."""
OFF = "output off, read back; run the same command again to resume; this run is a rehearsal"
CONSOLES = {"keys": "--ratings virtual --pace wall", "lines": "--ratings console --rehearsal"}


@dataclass
class Desk:
    """A session typed into a shell, and the hand on its generator."""

    shell: OnTerminal
    device: ControlClient
    folder: Path
    command: str

    def run(self, form: str = "{}") -> None:
        """Type the command."""
        self.shell.type(f"{form.format(self.command)}\n")

    def until(self, holds: Callable[[], bool], within_s: float = 30.0) -> float:
        """Look at the terminal until something holds; return how long that took."""
        began_s = time.monotonic()
        while not holds():
            assert time.monotonic() < began_s + within_s, self.shell.screen.text
            assert self.shell.look(), self.shell.screen.text
        return time.monotonic() - began_s

    def until_driven(self) -> None:
        """Press Enter, as participant and operator, until the output is on."""

        def driven() -> bool:
            if self.is_on:
                return True
            self.shell.type("\n")
            self.shell.look(0.1)
            return self.is_on

        self.until(driven)

    @property
    def is_on(self) -> bool:
        return bool(self.device.state()["output"])

    @property
    def session(self) -> psutil.Process:
        """The process that runs the session."""
        for process in psutil.Process(self.shell.process.pid).children(recursive=True):
            if process.cmdline()[1:3] == [TOUCHBEAM, "run"]:
                return process
        raise AssertionError(self.shell.screen.text)

    def events(self) -> list[StoredEvent]:
        with read_journal(self.folder / "study.db") as journal:
            assert all(verdict.chain_ok for verdict in verdicts(journal))
            return [event for name in journal.sessions() for event in journal.events(name)]


@contextmanager
def desk(folder: Path, console: str) -> Iterator[Desk]:
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    keep_calibration(folder, Resonance(frequency_hz=24_221.0, tip_m_per_v=1e-7), "KEYSIGHT", "now")
    with (
        simulator_process((TOUCHBEAM,), 1, dialect="keysight", wire="tcp", keep=True) as simulator,
        ControlClient(simulator.control) as device,
        on_terminal(SHELL, 100, 30, HISTFILE="", PS1="shell> ") as shell,
    ):
        run = shlex.join([TOUCHBEAM, "run", str(folder), "--participant", "P01"])
        yield Desk(shell, device, folder, f"{run} --device {simulator.url} {CONSOLES[console]}")


@pytest.mark.parametrize("times", [3, pytest.param(20, marks=pytest.mark.soak)])
@pytest.mark.parametrize("how", ["Ctrl-Z", "kill"])
@pytest.mark.parametrize("console", CONSOLES)
def test_a_touch_is_broken_off_with_the_output_off_and_its_trial_repeated(
    tmp_path: Path, console: str, how: str, times: int
) -> None:
    instants, took_s = random.Random(f"{console} {how}"), []
    with desk(tmp_path, console) as at:
        at.run()
        for _ in range(times):
            at.until_driven()
            suspended_s = time.monotonic() + instants.uniform(0, TOUCH_S)
            at.until(lambda until_s=suspended_s: time.monotonic() > until_s)  # type: ignore[misc]
            assert at.is_on
            if how == "kill":
                at.session.send_signal(signal.SIGTSTP)
            else:
                at.shell.type("\x1a")
            took_s.append(at.until(lambda: not at.is_on, within_s=5))
            assert at.session.status() != psutil.STATUS_STOPPED
            at.shell.watch(lambda text: "is broken off and will be repeated" in text)
        at.shell.type(":s\n" if console == "lines" else "s")
        at.shell.watch(lambda text: f"stopped by the operator; {OFF}" in " ".join(text.split()))
        assert not at.is_on
    print(f"{console}, {how}: off within {max(took_s):.3f} s of {times}")
    tags = [event.tag for event in at.events()]
    whys = [event.payload["why"] for event in at.events() if event.tag == "trial-aborted"]
    assert whys[:times] == ["broken off by Ctrl-Z (SIGTSTP)"] * times
    assert not {"touch-ended", "answered"}.intersection(tags), "no touch was made to its end"


def test_a_session_whose_terminal_the_shell_takes_ends_with_the_output_off(tmp_path: Path) -> None:
    """Ctrl-Z suspends the program that started it, for which the shell waits."""
    with desk(tmp_path, "keys") as at:
        at.run("sh -c '{}; true'")
        at.until_driven()
        at.shell.type("\x1a")
        at.until(lambda: not at.is_on, within_s=5)
        at.shell.watch(lambda text: "Stopped" in text and "shell>" in text)
        at.shell.watch(lambda text: "terminal is gone: the program is in the background" in text)
        at.shell.type("fg\n")
        at.shell.type("echo $?\n")
        at.shell.watch(lambda text: OFF in text)
    assert at.events()[-1].tag == "device-off"
    assert at.events()[-1].payload["confirmed"] is True


def test_a_session_in_the_background_does_not_begin(tmp_path: Path) -> None:
    with desk(tmp_path, "keys") as at:
        at.run("{} &")
        at.shell.watch(lambda text: "no key reaches it; run it in the foreground" in text)
        assert not (tmp_path / "study.db").exists()


@pytest.mark.parametrize("console", CONSOLES)
def test_no_signal_of_a_terminal_suspends_a_touch(tmp_path: Path, console: str) -> None:
    with desk(tmp_path, console) as at:
        at.run()
        at.until_driven()
        for number in (signal.SIGTTIN, signal.SIGTTOU):
            at.session.send_signal(number)
        at.until(lambda: not at.is_on)
        assert at.session.status() != psutil.STATUS_STOPPED
        at.until(lambda: any(event.tag == "touch-ended" for event in at.events()))


def test_a_search_for_the_resonance_ends_with_the_output_off(tmp_path: Path) -> None:
    with (
        simulator_process((TOUCHBEAM,), seed=1, wire="tcp", keep=True) as simulator,
        ControlClient(simulator.control) as device,
        subprocess.Popen(
            [TOUCHBEAM, "device", "sweep", simulator.url],
            cwd=tmp_path,
            stderr=subprocess.PIPE,
            text=True,
        ) as sweep,
    ):
        while not device.state()["output"]:
            time.sleep(0.01)
        sweep.send_signal(signal.SIGTSTP)
        try:
            _, said = sweep.communicate(timeout=5)
        finally:
            sweep.kill()
        assert (sweep.returncode, said) == (1, "touchbeam: stopped by SIGTSTP\n")
        assert not device.state()["output"]
