"""The commands as a user types them: results, messages, exit codes, and nothing left behind."""

import json
import os
import re
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from analysis.simulation import Simulation
from device.people.person import SENSITIVE
from protocol.study_file.loading import parsed_study, template
from runner.doctor import findings
from runner.launch.device_access import touchbeam_command
from runner.study.folder import StudyFolder
from tests.analysis.simulated_data import score_tables
from tests.runner.command_line import TOUCHBEAM, assert_matches, everything, typed

NOT_UTF8 = r"^touchbeam: text must be valid UTF-8, got '.udcff'\n$"
RUN = ("run", "study", "--participant", "P01", "--ratings")
PUBLISHED = Path(__file__).parents[2] / "data" / "published_scores.csv"


@pytest.fixture(autouse=True)
def somewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_the_demo_ends_with_table_4_and_the_device_off(tmp_path: Path) -> None:
    shown = [
        subprocess.run(
            [TOUCHBEAM, "demo", "--participants", "2", "--seed", "7"],
            env={**os.environ, "PATH": str(Path(TOUCHBEAM).parent)},
            capture_output=True,
            text=True,
            check=True,
        )
        for _ in range(2)
    ]
    assert all("Table 4" in run.stdout and "Device off, read back" in run.stdout for run in shown)
    assert "no person gave these scores" in shown[0].stdout
    assert shown[0].stdout.endswith(
        "Now open demo/report/report.html in a browser, and begin a study of your own: "
        "touchbeam new mystudy\n"
    )
    assert not any(run.stderr for run in shown), "no progress bar without a terminal"
    for name in ("table4.csv", "report.html", "report.json"):
        first, second = (Path(folder, "report", name).read_bytes() for folder in ("demo", "demo-2"))
        assert first == second.replace(b"demo-2", b"demo"), f"{name} depends on the seed alone"
    simulation = Simulation(study=parsed_study(template("paper")), population=SENSITIVE)
    found = pd.read_csv("demo/report/table4.csv", na_values="–").iloc[:2, 1:6]
    np.testing.assert_array_equal(found, score_tables(simulation, 2, 7)[0])
    with closing(sqlite3.connect("demo/study.db")) as journal:
        offs = journal.execute("SELECT payload FROM event WHERE tag = 'device-off'").fetchall()
    assert [json.loads(body)["confirmed"] for (body,) in offs] == [True, True]


def test_a_letter_that_a_pipes_code_page_lacks_ends_no_command() -> None:
    old = {**os.environ, "PYTHONUTF8": "0", "PYTHONIOENCODING": "cp1252"}  # of a pipe on Windows
    made = subprocess.check_output([TOUCHBEAM, "new", "\u03c7"], env=old, text=True)
    assert made.startswith(r"Edit \u03c7/study.toml; ")


def test_the_journal_commands_work_on_a_rehearsal(capsys: pytest.CaptureFixture[str]) -> None:
    typed("new", "study")
    assert typed(*RUN, "virtual") == 0
    capsys.readouterr()
    assert typed("status", "study", "--json") == 0
    status = json.loads(capsys.readouterr().out)
    assert status["sessions"][0]["state"] == "completed"
    assert status["next_slot"] == 0, "a rehearsal uses no slot"
    assert typed("verify", "study", "--json") == 0
    verified = json.loads(capsys.readouterr().out)
    assert (verified["ok"], verified["sessions"][0]["trials_answered"]) == (True, 7)
    of = ("--participant", "P01")
    assert typed("exclude", "study", *of, "--trial", "3", "--reason", "noise") == 0
    assert typed("exclude", "study", *of, "--trial", "99", "--reason", "noise") == 2
    assert typed("exclude", "study", "--participant", "P09", "--reason", "noise") == 2
    assert typed("amend", "study", "--reason", "why not") == 0, "a rehearsal locks nothing"
    assert typed("exclude", "study", *of, "--reason", " ") == 2
    assert typed("exclude", "study", *of, "--reason", "\udcff") == 2
    capsys.readouterr()
    assert typed("report", "study", "--rehearsals", "--json") == 0
    assert json.loads(capsys.readouterr().out)["left_out"]["trials excluded"] == 1
    assert typed("withdraw", "study", *of, "--yes") == 0
    assert typed("verify", "study") == 0
    assert "withdrawn" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("run", "nowhere", "--participant", "P01", "--ratings", "virtual"), 2, "no study here"),
        ((*RUN, "console", "--device", "/dev/ttyNOPE"), 1, "/dev/ttyNOPE: no such port"),
        ((*RUN, "console", "--device", "\udcff"), 2, NOT_UTF8),
        ((*RUN, "console", "--override", "\udcff"), 2, NOT_UTF8),
        (("exclude", "study", "--participant", "\udcff", "--reason", "x"), 2, NOT_UTF8),
        ((*RUN, "console", "--device", "frob://x"), 2, "frob://x: not the address of a device"),
        ((*RUN, "virtual", "--device", "/dev/ttyNOPE"), 1, "/dev/ttyNOPE: no such port"),
        (
            (*RUN, "console"),
            2,
            "the device is simulated: P01/1 will be a rehearsal, .*; add --rehearsal",
        ),
        (
            (*RUN, "virtual", "--consent", "C-1"),
            2,
            "^touchbeam: --ratings virtual with --consent: ",
        ),
        ((*RUN, "virtual", "--consent", "C-1"), 2, "add --rehearsal .*; otherwise leave out one"),
        ((*RUN, "virtual", "--device", ""), 2, "'': not the address of a device; it must be sim"),
        ((*RUN, "virtual", "--session", "2"), 2, "--session 2: the study plans 1 .* add --extra"),
        ((*RUN, "console", "--pace", "stepped"), 2, "--pace stepped needs"),
        (("run", "study", "--participant", "../P01", "--ratings", "virtual"), 2, "got '../P01'"),
        (("run", "study", "--participant", "Anna", "--ratings", "virtual"), 2, "got 'Anna'"),
        (("run", "study", "--ratings", "virtual"), 2, "Missing option '--participant'"),
        (
            ("import", "elevens.csv", "new", "--scale", "0", "10"),
            2,
            "elevens.csv, line 2, column a: .* got 11",
        ),
        (("import", "words.csv", "new"), 2, "words.csv, line 2, column a: .* got 'x'"),
        (("import", "nowhere.csv", "new"), 2, "nowhere.csv: no such file"),
        (
            ("import", "binary.csv", "new"),
            2,
            "binary.csv: .* UTF-16 text at line 1; save .* as UTF-8",
        ),
        (
            ("import", "scores.csv", "scores.csv/new"),
            2,
            "scores.csv/new: cannot be used for a study",
        ),
        (("import", "scores.csv", "study"), 2, "study: must be a new or empty folder, but"),
        (("demo", "--out", "scores.csv/demo"), 2, "scores.csv/demo: cannot be used for a study"),
        (("demo", "--participants", "0"), 2, "--participants"),
        (("report", "study"), 2, "no sessions here"),
        (("report", "nowhere"), 2, "nowhere: no sessions here"),
        (("report", "studi"), 2, "studi: no sessions here .*; did you mean study[?] Otherwise"),
        ((*RUN, "virtual", "--session", "x"), 2, "'--session': must be a whole number, got 'x'"),
        (("check", "study/study.toml"), 2, "must be the folder that .* got a file; give study$"),
        (("report", "study/study.toml"), 2, "must be the folder that .* got a file; give study$"),
        ((*RUN, "virtual", "--session", "0"), 2, "'--session': must be at least 1, got '0' .see"),
        (
            (*RUN, "virtual", "--session", "x"),
            2,
            "'--session': must be a whole number, got 'x' .see",
        ),
        (
            (*RUN, "virtual", "--pace", "x"),
            2,
            "'--pace': 'x' is not one of 'wall', 'stepped'. .see",
        ),
        ((*RUN, "virtual", "--damping", "x"), 2, "must lie strictly between 0 and 1, got 'x' .see"),
        (("power", "study", "--studies", "1"), 2, "'--studies': must be at least 2, got '1' .see"),
        (("fit", "x.csv", "--lapse", "y"), 2, "'--lapse': must be a number, got 'y' .see"),
        ((*RUN, "frob"), 2, "'--ratings': 'frob' is not one of 'window', 'console', 'virtual'"),
        (("new", "study"), 2, "study: must be a new or empty folder, but it contains files"),
        (("new", "scores.csv"), 2, "scores.csv: cannot be used for a study .Not a directory"),
        (("import", "words.csv", "empty"), 2, "words.csv, line 2"),
        (("demo", "--out", "empty", "--participants", "100"), 2, "--participants"),
        (("new", "other", "--template", "frob"), 2, "'frob' is not one of 'paper'"),
        (("simulate-device", "tcp", "x"), 2, "a port must be a whole number .* got 'x'"),
        (("simulate-device", "tcp", "70000"), 2, "a port must .* got '70000'"),
        (("simulate-device", "pty", "scores.csv"), 2, "scores.csv: cannot be used"),
        (("frob",), 2, "No such command 'frob'"),
    ],
)
def test_bad_input_is_one_clear_line_and_changes_nothing(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    code: int,
    message: str,
) -> None:
    typed("new", "study")
    Path("scores.csv").write_text("subject,a,b\n1,5,6\n")
    Path("elevens.csv").write_text("subject,a,b\n1,11,6\n")
    Path("words.csv").write_text("subject,a,b\n1,x,6\n2,5,6\n")
    Path("binary.csv").write_bytes(b"\xff\xfe\x00")
    Path("empty").mkdir()
    capsys.readouterr()
    before = everything(tmp_path)
    assert typed(*arguments) == code
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.count("\n") == 1
    assert_matches(message, shown.err)
    assert everything(tmp_path) == before


def test_an_empty_folder_is_accepted_and_kept_when_the_command_fails(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("study").mkdir()
    assert typed("check", "study") == 2
    assert "make one with: touchbeam new study" in capsys.readouterr().err
    with monkeypatch.context() as patched:
        patched.setattr("protocol.study_file.loading.template_tests", lambda: 1 / 0)
        assert typed("new", "study") == 1
    assert everything(Path()) == {"study"}
    assert typed("new", "study") == 0
    assert typed("check", "study") == 0


def test_import_says_what_it_understood_before_it_writes(
    capsys: pytest.CaptureFixture[str],
) -> None:
    Path("scores.csv").write_text("subject,频率,Voltage,电压\n1,3,4,5\n2,6,,8\n", encoding="utf-8")
    assert typed("import", "scores.csv", "published") == 0
    shown = capsys.readouterr()
    assert shown.out.splitlines() == [
        "scores.csv: wide, a column per condition; commas.",
        "Subjects: 2 (column subject). Conditions: 3: 频率, Voltage, 电压.",
        "Scale: not known (--scale LOW HIGH says it); scores from 3 to 8.",
        "Missing: 1 score blank.",
        "2 subjects imported; next: touchbeam report published",
    ]
    assert shown.err == ""
    assert typed("report", "published", "--json") == 0
    assert json.loads(capsys.readouterr().out)["responses"]["slope"]["value"] is None


@pytest.mark.parametrize(
    "command",
    [("new", "../study"), ("import", str(PUBLISHED), "../study"), ("new", "../a/../study")],
)
def test_a_study_can_be_made_outside_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]
) -> None:
    for name in ("here", "a"):
        Path(name).mkdir()
    monkeypatch.chdir("here")
    assert typed(*command) == 0
    assert (tmp_path / "study" / "study.toml").is_file()
    assert not everything(tmp_path / "here")


@pytest.mark.parametrize("place", ["missing/../study", "missing/../../study", "link/../study"])
def test_a_path_through_a_missing_folder_fails_and_leaves_nothing(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    place: str,
) -> None:
    Path("here").mkdir()
    Path("there").mkdir()
    Path("here/link").symlink_to(tmp_path / "missing")
    monkeypatch.chdir("here")
    before = everything(tmp_path)
    assert typed("new", place) == 2
    assert capsys.readouterr().err.endswith(f"{place}: No such file or directory\n")
    assert everything(tmp_path) == before


def test_an_unknown_key_names_the_near_miss(capsys: pytest.CaptureFixture[str]) -> None:
    typed("new", "study")
    study = Path("study/study.toml")
    study.write_text(study.read_text().replace("hold_s", "hold_z"))
    assert typed(*RUN, "virtual") == 2
    assert "unknown key, got 'hold_z'; did you mean 'hold_s'?" in capsys.readouterr().err
    assert everything(Path("study")) == {"study.toml", "test_study.py"}


def test_a_new_study_has_its_folders_name_and_commands_that_can_be_copied(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert typed("new", 'my "own" study') == 0
    shown = capsys.readouterr().out
    assert """  touchbeam check 'my "own" study'\n""" in shown
    assert "test_study.py tests the study with pytest" in shown
    assert StudyFolder(path=Path('my "own" study')).study().study.name == 'my "own" study'


def test_commands_that_are_printed_work_where_the_shell_does_not_find_touchbeam() -> None:
    place = {**os.environ, "PATH": os.defpath}
    assert not shutil.which("touchbeam", path=place["PATH"])
    made = subprocess.check_output([TOUCHBEAM, "new", "mystudy"], env=place, text=True)
    check, rehearse = (line for line in made.splitlines() if line.startswith("  "))
    assert check == f"  {TOUCHBEAM} check mystudy"
    assert rehearse.startswith(f"  {TOUCHBEAM} run mystudy ")
    subprocess.run(check, env=place, shell=True, check=True)


def test_debug_shows_a_traceback() -> None:
    shown = subprocess.run(
        [TOUCHBEAM, "report", "nowhere", "--debug"], capture_output=True, text=True, check=False
    )
    assert "Traceback" in shown.stderr
    assert shown.returncode == 1


def test_the_doctor_finds_our_own_packages(capsys: pytest.CaptureFixture[str]) -> None:
    assert typed("doctor", "--json") == 0
    found = {entry["what"]: entry for entry in json.loads(capsys.readouterr().out)}
    assert all(found[f"package {name}"]["ok"] for name in ("protocol", "device", "runner"))
    assert found["psychopy"]["value"] == "2026.2.5"
    assert found["SQLite"]["value"] == sqlite3.sqlite_version


@pytest.mark.parametrize(("version", "said"), [("3.51.2", True), ("3.51.3", False)])
def test_the_doctor_says_what_touchbeam_does_about_an_old_sqlite(
    monkeypatch: pytest.MonkeyPatch, version: str, said: bool
) -> None:
    monkeypatch.setattr("runner.doctor.SQLITE_VERSION", version)
    (found,) = (finding for finding in findings() if finding.what == "SQLite")
    assert found.ok
    assert (
        found.line().startswith(
            f"ok    SQLite: {version} (older than 3.51.3, which can lose transactions if a process "
            "commits during a checkpoint; touchbeam lets none commit then"
        )
        == said
    )


def test_the_doctor_says_ok_or_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr("runner.doctor.sys.platform", "linux")
    monkeypatch.setattr("ctypes.util.find_library", lambda _: None)
    lines = [finding.line() for finding in findings()]
    assert "missing  screens: none (use --ratings console)" in lines
    assert any(line.startswith("missing  sound libraries: asound, jack (") for line in lines)
    assert not [line for line in lines if line.startswith("ok") and "missing" in line]


def test_the_version_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert typed("--version") == 0
    assert re.fullmatch(r"touchbeam \d+\.\d+\.\d+(\.dev\d+)?\n", capsys.readouterr().out)


def test_the_doctor_reports_a_package_that_shadows_ours() -> None:
    Path("analysis").mkdir()
    Path("analysis/__init__.py").write_text("")
    program = (
        "import sys; sys.argv = ['touchbeam', 'doctor']; from touchbeam.cli import main; main()"
    )
    shown = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert shown.returncode == 1
    assert "FAIL  package analysis" in shown.stdout
    honest = subprocess.run([TOUCHBEAM, "doctor"], capture_output=True, text=True, check=False)
    assert honest.returncode == 0, "the command does not import from the current folder"


def test_the_package_is_a_command_and_obeys_nothing_in_the_folder(tmp_path: Path) -> None:
    for name in ("typer", "json"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('obeyed')")
    said = subprocess.run(
        [sys.executable, "-m", "touchbeam", "new", "study"],
        env={**os.environ, "PATH": ""},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (said.returncode, said.stderr) == (0, "")
    assert f"  {sys.executable} -m touchbeam check study\n" in said.stdout


def test_without_its_script_the_package_starts_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert touchbeam_command() == (TOUCHBEAM,)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    assert touchbeam_command() == (str(tmp_path / "python"), "-P", "-m", "touchbeam")
