"""Choices of options: listed from the module that defines them, and loaded only when needed."""

import subprocess
import sys
from collections.abc import Iterable
from typing import get_args

import pytest

from analysis.export.formats import EXPORTS
from device.beam.eq15 import Overlap
from device.friction.laws import LAWS
from device.simulator.device import dialects
from device.simulator.transports import LineKind
from protocol.study.languages import built_in_codes
from protocol.study_file.loading import TEMPLATES
from runner.clock import Pace
from runner.screens import AnswerSource
from tests.runner.command_line import typed

HEAVY = {
    "device",
    "analysis",
    "numpy",
    "scipy",
    "pandas",
    "pydantic",
    "rich",
    "sqlite3",
    "joblib",
    "threadpoolctl",
    "distributed",
    "serial",
    "matplotlib",
}
CHOICES = [
    (("run", "--ratings"), get_args(AnswerSource)),
    (("run", "--pace"), get_args(Pace)),
    (("run", "--language"), (*built_in_codes(), "CODE")),
    (("new", "--template"), tuple(TEMPLATES)),
    (("export", "--format"), tuple(EXPORTS)),
    (("predict", "--law"), tuple(LAWS)),
    (("predict", "--eq15-overlap"), get_args(Overlap)),
    (("simulate-device", "wire"), get_args(LineKind)),
    (("simulate-device", "--dialect"), tuple(dialects())),
    (("device", "sweep", "--dialect"), tuple(dialects())),
]


@pytest.mark.parametrize(("option", "names"), CHOICES, ids=str)
def test_help_lists_the_choices(
    option: tuple[str, ...], names: Iterable[str], capsys: pytest.CaptureFixture[str]
) -> None:
    *command, name = option
    assert typed(*command, "--help") == 0
    assert f"{name} <{'|'.join(names)}>" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("command", "names"),
    [
        (("predict", "scenes.csv", "-o", "-", "--law", "frob"), tuple(LAWS)),
        (("predict", "scenes.csv", "-o", "-", "--eq15-overlap", "frob"), get_args(Overlap)),
        (("device", "sweep", "sim", "--dialect", "frob"), tuple(dialects())),
        (("export", "study", "out", "--format", "frob"), tuple(EXPORTS)),
    ],
    ids=str,
)
def test_an_unknown_choice_is_refused_with_the_known_ones(
    command: tuple[str, ...], names: Iterable[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed(*command) == 2
    listed = ", ".join(map(repr, names))
    assert f"'frob' is not one of {listed}." in capsys.readouterr().err


def test_the_list_of_commands_loads_nothing_heavy() -> None:
    program = (
        "import sys; from touchbeam.cli.app import app; app(['--help'], standalone_mode=False); "
        "print('loaded:', *{name.split('.')[0] for name in sys.modules})"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert "withdraw" in loaded.stdout
    listed = loaded.stdout.rpartition("loaded:")[2].split()
    assert "typer" in listed
    assert not HEAVY & set(listed)


def test_a_command_is_built_without_the_modules_of_others() -> None:
    program = (
        "import sys, typer; from touchbeam.cli.app import app; "
        "typer.main.get_command(app).get_command(None, 'check'); "
        "print(*(name for name in sys.modules if name.startswith('touchbeam.cli.')))"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert "touchbeam.cli.study" in loaded.stdout
    assert "touchbeam.cli.results" not in loaded.stdout
