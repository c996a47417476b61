"""Output of results to files, folders, pipes and devices, and to a full disk."""

import os
import resource
import subprocess
from pathlib import Path

import pytest

from tests.runner.command_line import TOUCHBEAM, assert_matches, everything, typed

PUBLISHED = Path(__file__).parents[1] / "data" / "published_scores.csv"


@pytest.fixture(autouse=True)
def somewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_report_that_cannot_be_written_names_the_path(capsys: pytest.CaptureFixture[str]) -> None:
    typed("import", str(PUBLISHED), "published")
    Path("file").write_text("")
    assert typed("report", "published", "--out", "file/report") == 2
    assert "file/report: Not a directory" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (("report", "published", "--out", ""), "--out': must name a folder, got ''"),
        (
            ("report", "published", "--out", "file"),
            "file: must be a folder for the report, got a file",
        ),
        (("export", "published", " ", "--format", "csv"), "'DIR': must name a folder, got ' '"),
    ],
)
def test_a_place_for_results_must_be_a_folder(
    capsys: pytest.CaptureFixture[str], command: tuple[str, ...], message: str
) -> None:
    typed("import", str(PUBLISHED), "published")
    Path("file").write_text("")
    capsys.readouterr()
    before = everything(Path())
    assert typed(*command) == 2
    assert message in capsys.readouterr().err
    assert everything(Path()) == before


def test_a_full_disk_leaves_no_part_of_a_report() -> None:
    typed("import", str(PUBLISHED), "published")
    assert typed("report", "published", "--out", "before") == 0, "fills matplotlib's font cache"
    before = everything(Path())
    shown = subprocess.run(
        [TOUCHBEAM, "report", "published", "--out", "deep/out"],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, 40_000)),
    )
    assert_matches(r"^touchbeam: deep/out/report\.\w+: File too large\n$", shown.stderr)
    assert shown.returncode == 1
    assert everything(Path()) == before


def test_a_pipe_that_is_written_to_stays_a_pipe(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    Path("scenes.csv").write_text("voltage_v\n100\n")
    reader = subprocess.Popen(["cat", str(pipe)], stdout=subprocess.PIPE, text=True)
    assert typed("predict", "scenes.csv", "-o", str(pipe)) == 0
    assert "mu_effective" in reader.communicate(timeout=20)[0]
    assert pipe.is_fifo()


def test_standard_output_gets_the_predictions_and_nothing_else(
    capsys: pytest.CaptureFixture[str],
) -> None:
    Path("scenes.csv").write_text("voltage_v\n100\n")
    assert typed("predict", "scenes.csv", "-o", "out.csv") == 0
    assert capsys.readouterr().out == "1 scene predicted: out.csv\n"
    assert typed("predict", "scenes.csv", "-o", "-") == 0
    assert capsys.readouterr() == (Path("out.csv").read_text(), "")
    with Path("redirected.csv").open("w") as redirected:
        subprocess.run(
            [TOUCHBEAM, "predict", "scenes.csv", "-o", "/dev/stdout"], stdout=redirected, check=True
        )
    assert Path("redirected.csv").read_text() == Path("out.csv").read_text()
    assert not Path("-").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("predict", "scenes.csv", "-o", "/dev/full"), "/dev/full: No space left on device"),
        (
            ("predict", "scenes.csv", "-o", "-"),
            "cannot write to standard output (No space left on device)",
        ),
        (
            ("report", "published", "--json"),
            "cannot write to standard output (No space left on device)",
        ),
        (("report", "published"), "cannot write to standard output (No space left on device)"),
    ],
)
def test_a_full_disk_gives_one_clear_line(arguments: tuple[str, ...], message: str) -> None:
    Path("scenes.csv").write_text("voltage_v\n100\n")
    typed("import", str(PUBLISHED), "published")
    with Path("/dev/full").open("w") as full:
        shown = subprocess.run(
            [TOUCHBEAM, *arguments], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert (shown.returncode, shown.stderr) == (1, f"touchbeam: {message}\n")
