"""Studies in whose folders somebody planted what Python, its packages and programs may obey.

A bait leaves a mark when it is executed. What is only read as settings is a pipe without an end:
whoever opens it waits, and the command is not done in time.
"""

import os
import subprocess
import sys
from importlib.metadata import packages_distributions
from pathlib import Path
from shutil import which

import pytest

from tests.runner.command_line import TOUCHBEAM
from tests.runner.window.sessions import short_study
from tests.system.test_power_workers import cluster_in

pytestmark = pytest.mark.waits

WITHIN_S = 120
SETTINGS = (
    *("matplotlibrc", ".matplotlib/matplotlibrc", ".config/matplotlib/matplotlibrc", "fonts.conf"),
    *("dask.yaml", ".config/dask/dask.yaml", "distributed.yaml", ".numba_config.yaml"),
    *("pyvenv.cfg", "setup.cfg", "pyproject.toml", "pytest.ini", "tox.ini", ".env", "pip.conf"),
    *("userPrefs.cfg", ".psychopy3/userPrefs.cfg", "lsl_api.cfg", ".git/config", ".git/HEAD"),
    *("alsoft.conf", ".asoundrc", ".drirc", ".Xdefaults", ".jackdrc", ".pdbrc", "python._pth"),
    *(".jupyter/jupyter_config.py", "jupyter_notebook_config.py", "openssl.cnf", ".netrc"),
    *("fonts/DejaVuSans.ttf", "assets/fonts/DejaVuSans.ttf", "fontlist.json", ".sqliterc"),
)
PROGRAMS = (
    *("fc-list", "fc-match", "xrandr", "latex", "gcc", "ldconfig"),
    *("python", "python3", "touchbeam"),
)
LIBRARIES = ("GL", "GLU", "X11", "Xext", "Xinerama", "Xi", "Xxf86vm", "fontconfig", "freetype")
_CONSTRUCTOR = """
#include <fcntl.h>
__attribute__((constructor)) static void run(void) { open("MARK", O_CREAT | O_WRONLY, 0600); }
"""


def planted(folder: Path, marks: Path) -> Path:
    """Plant a module for every name that Python may import, programs, libraries and settings."""
    folder.mkdir(exist_ok=True)
    marks.mkdir(exist_ok=True)
    modules = {*sys.stdlib_module_names, *packages_distributions(), "touchbeam", "bait"}
    for name in {*modules, "sitecustomize", "usercustomize", "conftest", "__main__"}:
        (folder / f"{name}.py").write_text(f"open({str(marks / name)!r}, 'w')\n")
    for name in ("joblib", "numpy", "runner", "analysis", "multiprocessing"):
        (folder / name).mkdir()
        (folder / name / "__init__.py").write_text(f"open({str(marks / name)!r}, 'w')\n")
    (folder / "bait.pth").write_text(f"import os; open({str(marks / 'pth')!r}, 'w')\n")
    (folder / "touchbeam-9.dist-info").mkdir()
    (folder / "touchbeam-9.dist-info" / "METADATA").write_text("Name: touchbeam\nVersion: 9\n")
    (folder / "touchbeam-9.dist-info" / "entry_points.txt").write_text(
        "[pydantic]\nbait = bait\n\n[distributed.comm.backends]\nbait = bait\n"
    )
    for name in PROGRAMS:
        (folder / name).write_text(f"#!/bin/sh\ntouch {marks / name}\n")
        (folder / name).chmod(0o755)
    (folder / "lib").mkdir()
    for name in LIBRARIES:
        _library(folder / "lib" / f"lib{name}.so", marks / f"lib{name}")
    for name in SETTINGS:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        os.mkfifo(folder / name)
    return folder


def _library(path: Path, mark: Path) -> None:
    """Make a shared library that leaves a mark; without a compiler one that cannot be loaded."""
    path.write_text("no library")
    if compiler := which("cc"):
        source = _CONSTRUCTOR.replace("MARK", str(mark))
        command = [compiler, "-shared", "-fPIC", "-x", "c", "-o", str(path), "-"]
        subprocess.run(command, input=source, text=True, check=True)


class Sender:
    """A study in a folder full of baits, below another one, and a command line in either."""

    def __init__(self, top: Path) -> None:
        self.marks = top / "marks"
        self.above = planted(top / "above", self.marks)
        self.study = planted(self.above / "study", self.marks)
        (self.study / "study.toml").write_text(STUDY)
        programs = top / "programs"
        programs.mkdir()
        for name in ("latex", "kpsewhich", "dvipng"):
            (programs / name).write_text(f"#!/bin/sh\ntouch {self.marks / name}\n")
        # It would find the settings of a study that the environment lies in.
        (programs / "git").write_text(f'#!/bin/sh\n[ "$GIT_DIR" ] || touch {self.marks}/git\n')
        for program in programs.iterdir():
            program.chmod(0o755)
        (top / "home").mkdir()
        self.environment = {
            **{name: value for name, value in os.environ.items() if name != "PYTHONPATH"},
            "HOME": str(top / "home"),
            "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}",
        }

    def types(self, *arguments: str, above: bool = False) -> subprocess.CompletedProcess[str]:
        """Run a command in the study's folder, or in the one above it."""
        return subprocess.run(
            [TOUCHBEAM, *arguments],
            cwd=self.above if above else self.study,
            env=self.environment,
            input="",
            capture_output=True,
            text=True,
            timeout=WITHIN_S,
            check=False,
        )

    def marked(self) -> set[str]:
        """The names of the baits that were taken."""
        return {path.name for path in self.marks.iterdir()}


COMMANDS = (
    "new other",
    "check .",
    "translate . fr",
    "run . --participant P01 --ratings virtual --rehearsal",
    "slide .",
    "register .",
    "status .",
    "verify .",
    "exclude . --participant P01 --reason tired --rehearsal",
    "include . --participant P01 --reason rested --rehearsal",
    "backup . copy.db",
    "verify copy.db",
    "export . csv --format csv --rehearsals",
    "export . bids --format bids --rehearsals",
    "export . psychds --format psychds --rehearsals",
    "import scores.csv again",
    "report . --rehearsals --sections table4",
    "withdraw . --participant P01 --rehearsal --yes",
    "predict scenes.csv --out friction.csv",
    "device list",
    "device probe sim",
)
TESTED = "--tests-only --studies 2 --null-studies 2 --seed"
STUDY = (
    short_study(conditions=["frequency", "structure"])
    + """
[slide]
frequencies = [0.99, 1.0, 1.01]
frequencies_hz = []
references = 2
speeds_m_s = [0.02]
"""
)
ABOVE = ("ladder --plot ladder.png", f"power study {TESTED} 3 --workers 2")


@pytest.fixture
def sent(tmp_path: Path) -> Sender:
    return Sender(tmp_path)


def test_no_command_obeys_what_lies_in_the_study_or_above(sent: Sender, tmp_path: Path) -> None:
    (sent.study / "scenes.csv").write_text("voltage_v\n100\n")
    (sent.study / "scores.csv").write_text("subject,voltage,pressure\nP01,1,2\nP02,3,4\n")
    with cluster_in(tmp_path, 1) as (address, _):
        typed = [
            (command, False) for command in (*COMMANDS, f"power . {TESTED} 2 --scheduler {address}")
        ]
        for command, above in (*typed, *((command, True) for command in ABOVE)):
            done = sent.types(*command.split(), above=above)
            assert (done.returncode, done.stderr) == (0, ""), command
            assert not sent.marked(), command


def test_the_window_and_the_screens_obey_nothing_there(sent: Sender, small_display: str) -> None:
    sent.environment["DISPLAY"] = small_display
    for above in (False, True):
        assert "screens: 0: 800x600 at 0,0" in sent.types("doctor", above=above).stdout
    opened = sent.types("run", ".", "--participant", "P01", "--rehearsal")
    assert "the input ended before the session was complete" in opened.stderr
    assert not sent.marked()
