"""Unusable files in a study's folder: each is refused at once, without being read to the end."""

import os
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from protocol.errors import BadInput
from protocol.study_file.loading import template
from protocol.study_file.toml import LONGEST_TEXT
from runner.study.calibration import kept_calibration
from runner.study.folder import StudyFolder

READERS: dict[str, Callable[[Path], object]] = {
    "study.toml": lambda folder: StudyFolder(path=folder).study(),
    "calibration.json": kept_calibration,
}


@pytest.fixture(params=READERS)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def test_a_pipe_in_place_of_the_choice_of_sections_is_named_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "report.toml")
    with pytest.raises(BadInput) as caught:
        StudyFolder(path=tmp_path).report_sections()
    assert str(caught.value).count("report.toml") == 1


def test_a_pipe_or_a_device_is_refused_without_being_read(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / name)
    with pytest.raises(BadInput, match=f"{name}: must be a file, got a pipe or a device$"):
        READERS[name](tmp_path)
    (tmp_path / name).unlink()
    (tmp_path / name).symlink_to("/dev/zero")
    with pytest.raises(BadInput, match=f"{name}: must be a file, got a pipe or a device$"):
        READERS[name](tmp_path)


def test_a_file_that_is_too_long_is_refused_without_being_read(tmp_path: Path, name: str) -> None:
    with (tmp_path / name).open("wb") as file:
        file.truncate(10**12)
    message = f"{name}: must have at most {LONGEST_TEXT} bytes, got 1000000000000$"
    with pytest.raises(BadInput, match=message):
        READERS[name](tmp_path)


@pytest.mark.parametrize(
    "name",
    ["study.toml.txt", "Study.toml", "STUDY.TOML", "study (1).toml", "study.tml", "mystudy.toml"],
)
def test_a_study_file_of_nearly_the_right_name_is_to_be_renamed(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text(template("paper"), encoding="utf-8")
    told = f"the study's file must be called study.toml, got {name!r}; rename it"
    with pytest.raises(BadInput, match=re.escape(told)):
        StudyFolder(path=tmp_path).study()


def test_other_files_are_not_taken_for_a_study(tmp_path: Path) -> None:
    for name in ("report.toml", "registration.toml", "study.db", "notes.txt"):
        (tmp_path / name).write_text("")
    with pytest.raises(BadInput, match=r"study.toml is missing\); make one with: touchbeam new"):
        StudyFolder(path=tmp_path).study()


@pytest.mark.parametrize("text", ["[" * 100_000, '{"frequency_hz": 1' + "0" * 400 + "}", "\x00"])
def test_an_invalid_calibration_is_refused_in_one_line(tmp_path: Path, text: str) -> None:
    (tmp_path / "calibration.json").write_text(text, encoding="utf-8")
    with pytest.raises(BadInput, match=r"not a calibration .*; measure it again$"):
        kept_calibration(tmp_path)
