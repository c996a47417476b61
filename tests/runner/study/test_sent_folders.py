"""Studies that somebody else made: what is in their folders leads touchbeam nowhere else."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

import touchbeam
from protocol.errors import BadInput
from runner.study.calibration import keep_calibration, keep_fit, kept_calibration
from runner.study.folder import StudyFolder
from runner.study.registered import registration_of
from tests.runner.command_line import everything, typed
from tests.runner.registered_study import registered_in, run_session, study_in
from tests.runner.study.test_calibration import FITTED, FOUND, SLID, WHEN
from tests.runner.study.test_registered import refused


def victim_in(folder: Path) -> Path:
    """Return a folder outside the study with one file."""
    outside = folder / "outside"
    outside.mkdir()
    (outside / "victim").write_text("theirs")
    return outside


def assert_untouched(outside: Path) -> None:
    assert everything(outside) == {"victim"}
    assert (outside / "victim").read_text() == "theirs"


def test_register_follows_no_link(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    outside, study = victim_in(tmp_path), study_in(tmp_path / "study")
    (study / "registration.toml").symlink_to("../outside/new")
    line = refused(capsys, "register", study)
    assert "registration.toml: touchbeam writes here and follows no link; move it away" in line
    (study / "registration.toml").unlink()
    assert_untouched(outside)
    assert everything(study) == {"study.toml"}, "not even the journal has it"


@pytest.mark.parametrize(
    "name", ["study.toml", "registration.toml", "calibration.json", "report.toml"]
)
def test_a_link_is_not_read(name: str, tmp_path: Path) -> None:
    outside, study = victim_in(tmp_path), study_in(tmp_path / "study")
    (study / name).unlink(missing_ok=True)
    (study / name).symlink_to("../outside/victim")
    readers: dict[str, Callable[[], object]] = {
        "study.toml": StudyFolder(path=study).study,
        "registration.toml": lambda: registration_of(study),
        "calibration.json": lambda: kept_calibration(study),
        "report.toml": StudyFolder(path=study).report_sections,
    }
    with pytest.raises(BadInput) as caught:
        readers[name]()
    told = f"{study / name}: must be a file, got a link; put the file itself there"
    assert str(caught.value) == told
    assert_untouched(outside)


def a_folder(path: Path) -> None:
    path.mkdir()


@pytest.mark.parametrize("made", [os.mkfifo, a_folder])
def test_register_writes_into_no_pipe_and_no_folder(
    made: Callable[[Path], None], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = study_in(tmp_path)
    made(study / "registration.toml")
    line = refused(capsys, "register", study)
    found = "a folder" if made is a_folder else "a pipe or a device"
    assert f"registration.toml: must be a file, got {found}; move it away" in line
    assert everything(study) == {"study.toml", "registration.toml"}


def test_a_calibration_follows_no_link(tmp_path: Path) -> None:
    outside, study = victim_in(tmp_path), study_in(tmp_path / "study")
    (study / "calibration.json").symlink_to("../outside/victim")
    with pytest.raises(BadInput, match=r"calibration\.json: .* follows no link"):
        keep_calibration(study, FOUND, "BOARD", WHEN)
    with pytest.raises(BadInput, match=r"calibration\.json: .* follows no link"):
        keep_fit(study, SLID, "BOARD", FITTED)
    assert_untouched(outside)


def test_translate_follows_no_link(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    outside, study = victim_in(tmp_path), study_in(tmp_path / "study")
    (study / "texts").symlink_to("../outside")
    assert "texts: touchbeam writes here" in refused(capsys, "translate", study, "fr")
    (study / "texts").unlink()
    (study / "texts").mkdir()
    (study / "texts" / "fr.toml").symlink_to("../../outside/new")
    assert "fr.toml: touchbeam writes here" in refused(capsys, "translate", study, "fr")
    assert_untouched(outside)


def test_a_report_follows_only_links_that_the_user_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    outside, study = victim_in(tmp_path), registered_in(tmp_path / "study")
    run_session(study, "P01")
    (study / "report").symlink_to("../outside")
    assert "report: touchbeam writes here" in refused(capsys, "report", study)
    with pytest.raises(BadInput, match="report: touchbeam writes here"):
        touchbeam.load(study).report(sections="methods")
    assert_untouched(outside)
    assert typed("report", study, "--out", study / "report", "--sections", "methods") == 0
    assert (outside / "report.html").is_file()


def sparse(path: Path) -> None:
    """Make a file larger than any memory that takes no place on the disk."""
    with path.open("wb") as file:
        file.truncate(2**42)


def test_a_file_is_not_read_before_its_size_is_known(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = study_in(tmp_path)
    sparse(study / "registration.toml")
    line = refused(capsys, "register", study)
    assert "registration.toml: must have at most 262144 bytes" in line
    assert typed("check", study) == 2
    assert "registration.toml: must have at most 262144 bytes" in capsys.readouterr().err
