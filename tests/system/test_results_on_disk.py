"""Output of results to files, folders, pipes and devices, and to a full disk."""

import os
import resource
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from random import Random

import pytest

from runner.journal.amendments import exclude
from runner.journal.database import log_of
from runner.journal.opening import open_journal, read_journal
from runner.journal.store import JournalError
from runner.journal.verification import verdicts
from tests.runner.command_line import TOUCHBEAM, assert_matches, everything, typed
from tests.runner.fakes import FakeClock, FakeDevice, FakeParticipant
from tests.runner.registered_study import LATER_S, run_session, study_in

PUBLISHED = Path(__file__).parents[1] / "data" / "published_scores.csv"


@pytest.fixture(autouse=True)
def somewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def imported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    study = tmp_path_factory.mktemp("imported") / "published"
    assert typed("import", str(PUBLISHED), study) == 0
    return study


@pytest.fixture
def published(imported: Path, somewhere: None) -> None:
    """A copy of one study of published scores in the working folder: what is fitted is kept."""
    shutil.copytree(imported, "published")


@pytest.mark.usefixtures("published")
def test_a_report_that_cannot_be_written_names_the_path(capsys: pytest.CaptureFixture[str]) -> None:
    Path("file").write_text("")
    assert typed("report", "published", "--out", "file/report") == 2
    assert "file/report: Not a directory" in capsys.readouterr().err


@pytest.mark.usefixtures("published")
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
    Path("file").write_text("")
    capsys.readouterr()
    before = everything(Path())
    assert typed(*command) == 2
    assert message in capsys.readouterr().err
    assert everything(Path()) == before


@pytest.mark.usefixtures("published")
def test_a_full_disk_leaves_no_part_of_a_report() -> None:
    assert typed("report", "published", "--out", "before") == 0, "fills matplotlib's font cache"
    before = everything(Path())
    shown = subprocess.run(
        [TOUCHBEAM, "report", "published", "--out", "deep/out"],
        capture_output=True,
        text=True,
        check=False,
        # A compiled module would be cut off, too, and stay so.
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, 40_000)),
    )
    assert_matches(r"^touchbeam: deep/out/report\.\w+: File too large\n$", shown.stderr)
    assert shown.returncode == 1
    assert everything(Path()) == before


@pytest.fixture
def small_disk() -> Iterator[Path]:
    """A disk of 2 MB."""
    disk = Path("disk").resolve()
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=2m", "none", str(disk)]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("this user cannot mount a small disk")
    try:
        yield disk
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def fill(disk: Path, free: int) -> None:
    """Fill a disk, but for so many bytes."""
    with suppress(OSError), (disk / "rest").open("wb", buffering=0) as rest:
        while rest.write(bytes(4096)):
            pass
    size = (disk / "rest").stat().st_size
    os.truncate(disk / "rest", max(0, size - free))


class Acknowledged(FakeParticipant):
    """Counts how often the screen said "Saved"."""

    told = 0

    def saved(self) -> None:
        self.told += 1


def test_a_disk_that_is_full_at_any_moment_of_a_session_loses_no_answer(small_disk: Path) -> None:
    """The output is off, what was saved can be read at once, and the session is resumed."""
    random, study = Random(1), small_disk / "study"
    for _ in range(6):
        shutil.rmtree(study, ignore_errors=True)
        (small_disk / "rest").unlink(missing_ok=True)
        study_in(study, "extended")
        fill(small_disk, random.randrange(60) * 4096)
        device, person = FakeDevice(), Acknowledged()
        with pytest.raises(JournalError, match="disk is full"):
            run_session(study, "P01", device=device, person=person)
        assert not device.on
        if (study / "study.db").exists():
            with read_journal(study / "study.db") as journal:
                (verdict,) = verdicts(journal)
            assert verdict.ok
            assert verdict.trials_answered >= person.told
        else:
            assert everything(study) == {"study.toml"}
            assert person.told == 0
        (small_disk / "rest").unlink()
        run_session(study, "P01")
        with read_journal(study / "study.db") as journal:
            (verdict,) = verdicts(journal)
        assert (verdict.state, verdict.ok) == ("completed", True)
        assert everything(study) == {"study.toml", "study.db"}


@pytest.mark.parametrize("form", ["csv", "backup"])
def test_a_disk_that_is_full_at_any_moment_gets_no_part_of_a_result(
    form: str, small_disk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line, and what was there before is as it was."""
    study, random = study_in(Path("study")), Random(1)
    run_session(study, "P01")
    place, refused = small_disk / "out", 0
    export = ("export", study, place, "--format", form)
    for _ in range(6):
        (small_disk / "notes").write_text("kept")
        fill(small_disk, random.randrange(20) * 4096)
        before = contents(small_disk)
        capsys.readouterr()
        if typed(*(("backup", study, place) if form == "backup" else export)):
            refused += 1
            said = capsys.readouterr().err
            assert_matches(rf"^touchbeam: .*{small_disk}.*(No space left|disk is full).*\n$", said)
            assert contents(small_disk) == before
        for file in small_disk.iterdir():
            shutil.rmtree(file) if file.is_dir() else file.unlink()
    assert refused > 2


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() if path.is_file() else b"" for path in folder.rglob("*")}


@pytest.mark.parametrize("unwritable", ["full", "read-only"])
def test_from_a_disk_that_cannot_be_written_everything_can_be_read_and_saved(
    small_disk: Path, unwritable: str, capsys: pytest.CaptureFixture[str]
) -> None:
    run_session(study_in(small_disk / "study"), "P01")
    journal = small_disk / "study" / "study.db"
    with open_journal(journal) as kept:
        exclude(kept, FakeClock(LATER_S + 1e3), "P01/1", "a noise", 2)
        copies = [(file, file.read_bytes()) for file in (journal, log_of(journal))]
    for file, content in copies:  # as a killed process leaves them
        file.write_bytes(content)
    if unwritable == "full":
        fill(small_disk, 0)
    else:
        subprocess.run(["mount", "-o", "remount,ro", str(small_disk)], check=True)
    capsys.readouterr()
    study = small_disk / "study"
    assert typed("status", study) == 0
    assert "P01/1  participant  completed  7 of 7 trials, 1 excluded" in capsys.readouterr().out
    assert typed("verify", study) == 0
    assert typed("backup", study, "copy.db") == 0
    assert typed("verify", "copy.db") == 0
    assert typed("export", study, "csv", "--format", "csv") == 0
    capsys.readouterr()
    assert typed("exclude", study, "--participant", "P01", "--trial", "3", "--reason", "x") == 1
    assert capsys.readouterr().err.count("\n") == 1
    assert [(file, file.read_bytes()) for file, _ in copies] == copies
    assert (Path("csv") / "trials.csv").read_text().count("a noise") == 1


def test_a_pipe_that_is_written_to_stays_a_pipe(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    Path("scenes.csv").write_text("voltage_v\n100\n")
    with subprocess.Popen(["cat", str(pipe)], stdout=subprocess.PIPE, text=True) as reader:
        try:
            assert typed("predict", "scenes.csv", "-o", str(pipe)) == 0
            assert "mu_effective" in reader.communicate(timeout=20)[0]
        finally:
            reader.kill()
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


@pytest.mark.usefixtures("published")
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
    with Path("/dev/full").open("w") as full:
        shown = subprocess.run(
            [TOUCHBEAM, *arguments],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            env={name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"},
        )
    assert (shown.returncode, shown.stderr) == (1, f"touchbeam: {message}\n")
