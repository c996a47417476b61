"""`touchbeam slide`: a rehearsal, and how the other commands treat a sliding experiment."""

import json
import shutil
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import pytest

from protocol.study_file.loading import template
from runner.journal.opening import read_journal
from runner.study.calibration import fitted_calibration, kept_calibration
from runner.study.folder import StudyFolder
from tests.runner.command_line import everything, typed

SECTION = """
[slide]
frequencies = [0.99, 1.0, 1.01]
frequencies_hz = []
references = 2
speeds_m_s = [0.02]
"""


def new_study(place: Path) -> Path:
    (place / "study").mkdir()
    text = template("paper").replace("[touch]", f"{SECTION}\n[touch]", 1)
    (place / "study" / "study.toml").write_text(text, encoding="utf-8")
    return place / "study"


@pytest.fixture
def study(tmp_path: Path) -> Path:
    return new_study(tmp_path)


@pytest.fixture(scope="module")
def said() -> list[str]:
    """The lines that the rehearsal prints."""
    return []


@pytest.fixture(scope="module")
def rehearsed(tmp_path_factory: pytest.TempPathFactory, said: list[str]) -> Path:
    made = new_study(tmp_path_factory.mktemp("rehearsed"))
    with redirect_stdout(StringIO()) as out:
        assert typed("slide", made, "--device", "sim") == 0
    said += out.getvalue().splitlines()
    return made


@pytest.fixture
def slid(rehearsed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """A copy of a study with a rehearsed sliding experiment."""
    capsys.readouterr()
    return Path(shutil.copytree(rehearsed, tmp_path / "study"))


@pytest.mark.usefixtures("figures_as_svg")
def test_a_rehearsal_on_the_simulated_device(
    slid: Path, rehearsed: Path, said: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert said[0] == (
        "slide/1 is complete: 5 passes, device off (read back); this was a rehearsal."
    )
    assert said[1].split() == ["property", "value", "95%", "interval"]
    assert said[-1].startswith(f"Written: {rehearsed / 'slide' / 'slide.html'}")
    files = {f"slide.{end}" for end in ("html", "json", "svg", "pdf", "png")}
    assert everything(slid / "slide") == files
    with read_journal(slid / "study.db") as journal:
        assert journal.sessions() == ["slide/1 (rehearsal)"]
    assert typed("slide", slid, "--device", "sim") == 2
    assert "slide/1 is already completed; --session 2 draws the block anew" in (
        capsys.readouterr().err
    )
    assert typed("slide", slid, "--device", "sim", "--session", "2") == 0
    with read_journal(slid / "study.db") as journal:
        assert journal.sessions() == ["slide/1 (rehearsal)", "slide/2 (rehearsal)"]


@pytest.mark.usefixtures("figures_as_svg")
def test_what_was_drawn_is_analysed_again(slid: Path, capsys: pytest.CaptureFixture[str]) -> None:
    written = (slid / "slide" / "slide.json").read_text(encoding="utf-8")
    assert typed("slide", slid, "--analyse", "--json") == 0
    shown = capsys.readouterr().out
    found = json.loads(shown)
    assert found == json.loads(written), "one document, the same as before"
    assert found.keys() >= {"passes", "mu", "troughs", "peaks", "fit", "models", "rehearsal"}
    assert found["fit"].keys() >= {"damping_ratio", "resonance_hz"}
    excluded = ("--participant", "slide", "--trial", "0", "--reason", "the block tilted")
    assert typed("exclude", slid, *excluded) == 0
    capsys.readouterr()
    assert not (slid / "calibration.json").exists(), "unless it is asked for"
    assert typed("slide", slid, "--analyse", "--calibrate") == 0
    shown = capsys.readouterr().out
    assert "Left out: pass 1, the block tilted." in shown
    assert "Kept as the rig's calibration, from a rehearsal: " in shown
    kept = json.loads((slid / "calibration.json").read_text(encoding="utf-8"))
    assert kept["fitted"]["rehearsal"] is True
    assert fitted_calibration(slid, StudyFolder(path=slid).study()).origin
    calibration = kept_calibration(slid)
    assert calibration is not None
    assert calibration.frequency_hz == pytest.approx(24_069, abs=10)


def test_without_a_pass_there_is_nothing_to_analyse(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed("slide", study, "--analyse") == 2
    assert "no block has been drawn here as slide/1" in capsys.readouterr().err
    assert typed("run", study, "--participant", "P01", "--ratings", "virtual") == 0
    capsys.readouterr()
    assert typed("slide", study, "--analyse") == 2
    assert "no block has been drawn here as slide/1" in capsys.readouterr().err
    assert not (study / "slide").exists()


def test_status_lists_it_apart_from_participants(
    slid: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed("status", slid) == 0
    shown = capsys.readouterr().out
    assert "slide/1  rehearsal  completed  5 of 5 passes" in shown
    assert "Done: 0 of 9 participants. The next participant gets slot 0" in shown
    assert "--participant P01" in shown
    assert typed("status", slid, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    (session,) = found["sessions"]
    assert (session["participant"], session["kind"], session["slot"]) == (
        "slide",
        "rehearsal",
        None,
    )
    assert (found["done"], found["next_slot"], found["next_participant"]) == (0, 0, "P01")


def test_verify_counts_its_passes(slid: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert typed("verify", slid, "--json") == 0
    (session,) = json.loads(capsys.readouterr().out)["sessions"]
    assert session["ok"]
    assert typed("verify", slid) == 0
    assert "5 of 5 passes drawn" in capsys.readouterr().out
    assert (session["trials_planned"], session["trials_answered"]) == (5, 5)


def test_a_pass_is_excluded_and_included_again(
    slid: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = ("--participant", "slide", "--trial", "3", "--reason", "the block tilted")
    assert typed("exclude", slid, *one) == 0
    assert "slide/1 (rehearsal), pass 3 is excluded: the block tilted" in capsys.readouterr().out
    typed("status", slid)
    assert "5 of 5 passes, 1 excluded" in capsys.readouterr().out
    assert typed("include", slid, *one) == 0


def test_nobody_can_withdraw_from_it(slid: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert typed("withdraw", slid, "--participant", "slide", "--yes") == 2
    assert "has no participant who could withdraw" in capsys.readouterr().err
    assert typed("verify", slid) == 0


def test_analyses_of_participants_leave_it_out(
    slid: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed("report", slid, "--rehearsals") == 2
    assert typed("export", slid, tmp_path / "out", "--format", "csv", "--rehearsals") == 2
    capsys.readouterr()
    assert typed("run", slid, "--participant", "P01", "--ratings", "virtual") == 0
    assert typed("report", slid, "--rehearsals", "--json") == 0
    found = capsys.readouterr().out
    found = json.loads(found[found.index("{") :])
    assert {trial["subject"] for trial in found["trials"]} == {"P01"}
    assert typed("export", slid, tmp_path / "out", "--format", "csv", "--rehearsals") == 0
    rows = (tmp_path / "out" / "trials.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == 1 + 7
    assert not [row for row in rows if "slide" in row]


def test_its_name_is_no_participants(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = everything(study)
    assert typed("run", study, "--participant", "slide", "--ratings", "virtual") == 2
    assert "a participant must be a pseudonym" in capsys.readouterr().err
    assert everything(study) == before


@pytest.mark.parametrize(
    ("section", "options", "said"),
    [
        ("voltage_v = 250", (), "slide, 23200 Hz: the amplitude must not exceed"),
        ("voltag_v = 100", (), "unknown key"),
        ("", ("--device", "sim", "--pace", "wall", "--law", "none"), "'none' is not one of"),
        ("", ("--device", "socket://localhost:1", "--law", "printed"), "are for --device sim"),
    ],
)
def test_what_cannot_be_done_is_refused_in_one_line(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    section: str,
    options: tuple[str, ...],
    said: str,
) -> None:
    text = template("paper").replace("[touch]", f"[slide]\n{section}\n[touch]", 1)
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    assert typed("slide", tmp_path, *options) == 2
    assert said in capsys.readouterr().err
    assert everything(tmp_path) == {"study.toml"}


def test_a_rig_that_cannot_record_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig = 'device = "sim"\ndialect = "keysight"\namplifier_gain = 50.0'
    text = template("paper").replace('device = "sim"', rig, 1)
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    assert typed("slide", tmp_path) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "needs a board or a gauge" in line
    assert everything(tmp_path) == {"study.toml"}
