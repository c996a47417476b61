"""Ctrl-C at random moments in the first second of a command: one line, and no traceback."""

import random
import signal
import subprocess
import time
from pathlib import Path

import pytest

from protocol.study_file.loading import template
from tests.runner.command_line import TOUCHBEAM

pytestmark = pytest.mark.waits

COMMANDS = (
    "--help",
    "new made",
    "check study",
    "status study",
    "verify study",
    "report study",
    "export study made --format csv",
    "import scores.csv made",
    "run study --participant P01 --ratings virtual",
    "demo --participants 1 --out made",
    "predict scenes.csv -o made",
    "ladder",
    "device list",
    "device sweep sim",
    "simulate-device tcp 0",
    "doctor",
)


@pytest.mark.parametrize("draw", range(20))
def test_ctrl_c_ends_a_command_in_one_line(tmp_path: Path, draw: int) -> None:
    instants = random.Random(draw)
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / "study.toml").write_text(template("paper"))
    (tmp_path / "scores.csv").write_text("subject,a,b\n1,5,6\n2,6,7\n")
    (tmp_path / "scenes.csv").write_text("voltage_v\n100\n")
    command = COMMANDS[draw % len(COMMANDS)]
    with subprocess.Popen(
        [TOUCHBEAM, *command.split()],
        cwd=tmp_path,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        time.sleep(instants.uniform(0, 0.6))
        process.send_signal(signal.SIGINT)
        try:
            _, complaints = process.communicate(timeout=20)
        finally:
            process.kill()
    starting = "Traceback" in complaints or process.returncode == -signal.SIGINT
    if starting and "main()" not in complaints:
        return  # Python itself was still starting
    assert "Traceback" not in complaints
    assert complaints.count("\n") <= 1
    assert process.returncode in {0, 1, 2}
    if process.returncode == 1 and complaints:
        assert "stopped by SIGINT" in complaints
