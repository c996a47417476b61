"""The sliding experiment as a process: killed anywhere, drawn by hand over TCP, stopped."""

import json
import random
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from device.simulator.client import ControlClient, simulator_process
from protocol.journal.events import SLIDE, Answered, TouchRecorded, TrialStarted
from protocol.study_file.loading import template
from runner.journal.opening import read_journal
from runner.journal.verification import verdicts
from tests.runner.command_line import TOUCHBEAM
from tests.system.pty_screen import on_terminal
from tests.system.test_sigkill import len_of

pytestmark = pytest.mark.waits

SPEED_M_S = 0.05
LEAD_IN_S = 0.5
SECTION = f"""
[slide]
frequencies = [0.99, 1.0, 1.01]
frequencies_hz = []
references = 1
speeds_m_s = [{SPEED_M_S}]
"""
PASSES = 4
EVENTS = 8 + 5 * PASSES


@pytest.fixture
def study(tmp_path: Path) -> Path:
    text = template("paper").replace("[touch]", f"{SECTION}\n[touch]\nlead_in_s = {LEAD_IN_S}", 1)
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    return tmp_path


def whole_passes_only(study: Path, *, completed: bool = True) -> None:
    with read_journal(study / "study.db") as journal:
        (verdict,) = verdicts(journal)
        (name,) = journal.sessions()
        records = [event.record for event in journal.events(name)]
    assert verdict.ok, verdict
    assert verdict.participant == SLIDE
    answered = [record.index for record in records if isinstance(record, Answered)]
    assert len(answered) == len(set(answered))
    assert len(answered) == PASSES or not completed
    recorded = [record for record in records if isinstance(record, TouchRecorded)]
    assert len(recorded) >= len(answered)
    assert all(record.counts() for record in recorded), "each as it was recorded"
    begun = sum(isinstance(record, TrialStarted) for record in records)
    assert begun == len(answered) + verdict.trials_aborted or not completed


@pytest.mark.parametrize("draw", range(3))
def test_an_experiment_killed_at_random_instants_goes_on(study: Path, draw: int) -> None:
    command = [TOUCHBEAM, "slide", str(study), "--device", "sim"]
    instants = random.Random(draw)
    for _ in range(2):
        before = len_of(study / "study.db")
        after = before + instants.randrange(max(1, EVENTS - before))
        with subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        ) as process:
            while process.poll() is None and len_of(study / "study.db") < after:
                time.sleep(0.001)
            time.sleep(instants.uniform(0, 0.05))
            process.send_signal(signal.SIGKILL)
        if (study / "study.db").exists() and len_of(study / "study.db"):
            whole_passes_only(study, completed=False)
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    # The second kill may have come after the last event.
    assert done.returncode == 0 or "already completed" in done.stderr, done.stderr
    whole_passes_only(study)


@contextmanager
def drawn_by_hand(study: Path, control: ControlClient, url: str) -> Iterator["Hand"]:
    """Run the experiment at `url` with a hand that does what it is told."""
    command = [TOUCHBEAM, "slide", str(study), "--device", url, "--rehearsal"]
    with subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        bufsize=1,
    ) as process:
        try:
            yield Hand(process, control)
        finally:
            process.kill()


class Hand:
    """Reads what the operator is told, and draws the block."""

    def __init__(self, process: "subprocess.Popen[str]", control: ControlClient) -> None:
        self.process = process
        self.said: list[str] = []
        self._control = control
        self.touching = threading.Event()
        self._ready = False
        self._thread = threading.Thread(target=self._follow, daemon=True)
        self._thread.start()

    def _follow(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.said.append(line.rstrip())
            self._obey(line)

    def _obey(self, line: str) -> None:
        if "press enter" in line.lower():
            if line.startswith("Put the block"):
                self._control.touch(0.56, 0.010, "right")
                self._ready = True
            self._press_enter()
        elif line.startswith("slide/1 touching") and self._ready:
            self._ready = False  # the line comes again as the amplitude rises
            self.touching.set()
            time.sleep(LEAD_IN_S)
            self._control.touch(0.56, 0.010, "right", SPEED_M_S)
        elif line.startswith("pass "):
            self._control.lift()

    def _press_enter(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write("\n")
        self.process.stdin.flush()

    def end(self, within_s: float = 120.0) -> tuple[int, str]:
        """Return the exit code, and the last line on standard error."""
        code = self.process.wait(within_s)
        self._thread.join(5)
        assert self.process.stderr is not None
        return code, self.process.stderr.read().strip()


def test_an_experiment_over_tcp_with_the_operator_at_the_block(study: Path) -> None:
    with (
        simulator_process((TOUCHBEAM,), seed=1, wire="tcp", keep=True) as simulator,
        ControlClient(simulator.control) as control,
        drawn_by_hand(study, control, simulator.url) as hand,
    ):
        code, complained = hand.end()
        assert code == 0, complained
        assert control.state()["output"] is False
    assert sum(line.startswith("Put the block (0.56 N)") for line in hand.said) == PASSES
    assert [line for line in hand.said if line.startswith("pass 1, reference, 0 V: mu 0.3")]
    assert any("slide/1 is complete: 4 passes" in line for line in hand.said)
    whole_passes_only(study)
    found = json.loads((study / "slide" / "slide.json").read_text(encoding="utf-8"))
    assert len(found["passes"]) == PASSES
    assert found["left_out"] == []
    assert len(found["troughs"]) >= 3


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL])
def test_the_output_is_off_after_every_signal(study: Path, sent: signal.Signals) -> None:
    with (
        simulator_process((TOUCHBEAM,), seed=1, wire="tcp", keep=True) as simulator,
        ControlClient(simulator.control) as control,
        drawn_by_hand(study, control, simulator.url) as hand,
    ):
        assert hand.touching.wait(60)
        time.sleep(LEAD_IN_S + 0.3)
        assert control.state()["output"] is True
        hand.process.send_signal(sent)
        code, complained = hand.end()
        end_s = time.monotonic() + 5  # of a killed process the watchdog takes care
        while control.state()["output"] and time.monotonic() < end_s:
            time.sleep(0.05)
        assert control.state()["output"] is False
    if sent == signal.SIGKILL:
        return
    assert code == 1
    assert complained.endswith("output off, read back; run the same command again to resume; "
                               "this run is a rehearsal")  # fmt: skip


def test_the_plot_follows_the_block_at_80_by_24(study: Path) -> None:
    command = [TOUCHBEAM, "slide", str(study), "--device", "sim", "--pace", "wall"]
    dots, drawn = 0, ""
    with on_terminal(command, 80, 24) as terminal:
        while terminal.look():
            text = terminal.screen.text
            if text.count("●") > dots and len(text.splitlines()) == 24:
                dots, drawn = text.count("●"), text
        assert terminal.process.wait(30) == 0
    assert dots > 10
    lines = drawn.splitlines()
    assert max(map(len, lines)) <= 80
    assert "DRY RUN" in lines[0]
    assert lines[2].startswith(" mu against place  pass ")
    assert "10 mm" in drawn
    assert lines[-1] == " EMERGENCY STOP: e, space, Ctrl-E"
    assert "slide/1 is complete: 4 passes" in terminal.screen.text
