"""`touchbeam import` of what is no table of scores: one line, and nothing left behind."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.runner.command_line import typed


def a_pipe(file: Path) -> None:
    os.mkfifo(file)


def endless(file: Path) -> None:
    file.symlink_to("/dev/zero")


def large(file: Path) -> None:
    with file.open("wb") as hollow:
        hollow.truncate(2**40)


def a_data_set(file: Path) -> None:
    (file / "sourcedata" / "touchbeam").mkdir(parents=True)


@pytest.mark.parametrize(
    ("make", "problem"),
    [
        (a_pipe, "must be a file, got a pipe or a device"),
        (endless, "must be a file, got a pipe or a device"),
        (large, "have at most 32 MiB, got 1048576"),
        (a_data_set, "must be a table of scores, a CSV file or .xlsx, got a folder"),
    ],
)
def test_what_is_no_table_is_refused(
    make: Callable[[Path], None], problem: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make(tmp_path / "scores.csv")
    assert typed("import", tmp_path / "scores.csv", tmp_path / "study") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "scores.csv: must " in line
    assert problem in line
    assert not (tmp_path / "study").exists()
