"""The demo on a system without Unix sockets, pseudo-terminals and POSIX modules, such as Windows.

Their absence is simulated here; what Windows itself does is not tried.
"""

import os
import socket
import subprocess
from pathlib import Path

import pytest

from device.errors import DeviceError
from device.simulator.client import ControlClient, simulator_process
from runner.people import terminal
from tests.device.rigs import TOUCHBEAM
from tests.runner.command_line import typed

pytestmark = pytest.mark.waits

WITHOUT = """
import builtins, os, socket

LACKING = {
    "socket": {"AF_UNIX"},
    "os": {"openpty", "getuid", "getpgrp", "tcgetpgrp", "O_NOFOLLOW", "O_DIRECTORY"},
}
POSIX = {"termios", "tty", "pty", "fcntl", "resource", "pwd", "grp"}
OURS = {"protocol", "device", "runner", "analysis"}
whole = builtins.__import__

class Lacking:
    def __init__(self, module):
        self.module = module

    def __getattr__(self, name):
        if name in LACKING[self.module.__name__]:
            raise AttributeError(name)
        return getattr(self.module, name)

def without(name, scope=None, *rest, **more):
    found = whole(name, scope, *rest, **more)
    if (scope or {}).get("__name__", "").partition(".")[0] not in OURS:
        return found
    if name in POSIX:
        raise ImportError(f"no module named {name}")
    return Lacking(found) if name in LACKING else found

builtins.__import__ = without
"""
"""Hides them from our packages alone: the libraries of this system need them."""


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """The environment of processes that lack what Windows lacks."""
    (tmp_path / "without").mkdir()
    (tmp_path / "without" / "sitecustomize.py").write_text(WITHOUT)
    return {**os.environ, "PYTHONPATH": str(tmp_path / "without")}


def test_the_demo_runs_over_a_loopback_port(tmp_path: Path, environment: dict[str, str]) -> None:
    command = (*TOUCHBEAM, "demo", "--participants", "1")
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "Device off, read back after the session." in done.stdout
    assert (tmp_path / "demo" / "report" / "report.html").is_file()


def test_a_pseudo_terminal_is_refused_with_the_other_wire(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delattr(os, "openpty")
    assert typed("simulate-device", "pty", "port") == 2
    assert "no pseudo-terminals; use: touchbeam simulate-device tcp 0" in capsys.readouterr().err


def test_the_control_port_opens_for_its_token_alone(
    monkeypatch: pytest.MonkeyPatch, environment: dict[str, str]
) -> None:
    monkeypatch.setenv("PYTHONPATH", environment["PYTHONPATH"])
    with simulator_process(TOUCHBEAM, seed=1, wire="tcp", keep=True) as endpoints:
        monkeypatch.delattr(socket, "AF_UNIX")
        assert endpoints.control.stat().st_mode & 0o777 == 0o600
        with ControlClient(endpoints.control) as control:
            assert control.state()["output"] is False
        port, _ = endpoints.control.read_text().split()
        endpoints.control.write_text(f"{port} {'0' * 32}\n")
        with (
            ControlClient(endpoints.control) as stranger,
            pytest.raises(DeviceError, match="gone"),
        ):
            stranger.state()


def test_without_posix_and_windows_there_are_no_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "termios", None)
    with terminal.terminal_keys() as keys:
        assert keys(False) == ""
