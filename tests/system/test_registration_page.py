"""Orders of a registered study are reproduced by the script docs/assets/check_orders.py alone."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.runner.registered_study import registered_in, run_session

SCRIPT = Path(__file__).parents[2] / "docs" / "assets" / "check_orders.py"


def checked(folder: Path, tmp_path: Path) -> list[str]:
    command = [sys.executable, "-I", str(SCRIPT), str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path)
    return done.stdout.splitlines()


TWICE = ("repeats = 4", "repeats = 4\nsessions = 2")
BLOCKS = ('order = "williams"', 'order = "blocks"')
CLOSER = ("catch_apart = 3", "catch_apart = 2")


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("paper", ()),
        ("extended", (TWICE,)),
        ("extended", (TWICE, BLOCKS, CLOSER)),
        ("extended", (TWICE, BLOCKS, ("max_alike_in_row = 1", ""))),
        ("extended", (TWICE, (BLOCKS[0], 'order = "fixed"'), ("opposite_repeats = 1", ""))),
    ],
)
def test_the_script_of_the_page_reproduces_the_orders(
    tmp_path: Path, name: str, changes: tuple[tuple[str, str], ...]
) -> None:
    """Orders, levels, opposite repeats, practice and catch trials."""
    folder = registered_in(tmp_path / "study", name, *changes)
    run_session(folder, "P01")
    run_session(folder, "P01", number=2)
    run_session(folder, "P02")
    run_session(folder, "P03", kind="rehearsal")
    sessions = ["P01/1", "P01/2", "P02/1", "P03/1 (rehearsal)"]
    assert checked(folder, tmp_path) == [f"ok   {each}" for each in sessions]


@pytest.mark.parametrize(
    "change",
    [
        ("catch_trials = 4", "catch_trials = 3"),
        ("practice_trials = 3", "practice_trials = 2"),
        ("opposite_repeats = 1", "opposite_repeats = 2"),
        ("levels = [0.4, 0.6, 0.8, 1.0]", "levels = [0.4, 0.6, 1.0, 0.8]"),
    ],
)
def test_the_script_of_the_page_tells_another_plan(tmp_path: Path, change: tuple[str, str]) -> None:
    folder = registered_in(tmp_path / "study", "extended")
    run_session(folder, "P01")
    study = folder / "study.toml"
    study.write_text(study.read_text(encoding="utf-8").replace(*change), encoding="utf-8")
    assert checked(folder, tmp_path) == ["FAIL P01/1"]
