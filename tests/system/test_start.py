"""What a command loads before it answers: nothing that it does not need."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.runner.command_line import TOUCHBEAM, typed

RUN = ("run", "study", "--participant", "P01", "--ratings", "virtual", "--pace", "stepped")


@pytest.mark.parametrize(
    ("command", "unneeded"),
    [
        (("check", "study"), ("pandas", "numpy.ma.", "sqlite3")),
        (RUN, ("pandas",)),
    ],
    ids=["check", "run"],
)
def test_what_a_command_needs_not_is_not_loaded(
    command: tuple[str, ...],
    unneeded: tuple[str, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert typed("new", "study") == 0
    loaded = subprocess.run(
        [sys.executable, "-X", "importtime", TOUCHBEAM, *command],
        capture_output=True,
        text=True,
        check=True,
    ).stderr
    assert "touchbeam.cli" in loaded
    assert not [name for name in unneeded if name in loaded]
