"""The commands as a user types them: results, messages, exit codes, and nothing left behind."""

import io
import json
import signal
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from runner import sitting
from runner.journal import read_journal
from runner.operator_console import PlainDisplay
from runner.session_log import SessionLog
from runner.study_folder import StudyFolder
from tests.runner.command_line import TOUCHBEAM, assert_matches, everything, typed

RUN = ("run", "study", "--participant", "P01", "--ratings")
PUBLISHED = Path(__file__).parents[1] / "data" / "published_scores.csv"


@pytest.fixture(autouse=True)
def somewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_the_published_table_is_imported_and_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed("import", str(PUBLISHED), "published") == 0
    capsys.readouterr()
    assert typed("report", "published", "--json") == 0
    numbers = json.loads(capsys.readouterr().out)
    table = numbers["table4"]
    assert list(table["column_means"]) == [
        "frequency",
        "structure",
        "voltage",
        "direction",
        "pressure",
    ]
    assert [round(mean, 2) for mean in table["column_means"].values()] == [
        8.44,
        8.89,
        9.67,
        8.33,
        6.22,
    ]
    assert round(table["grand_mean"], 2) == 8.31
    assert [row["comprehensive"] for row in table["rows"]] == pytest.approx(
        [8.6, 9, 7, 9.6, 7.8, 9, 8.2, 8, 7.6]
    )
    assert round(numbers["friedman"]["chi2"], 4) == 21.4521
    assert {"table4.csv", "report.html", "report.json"} <= everything(Path("published/report"))


def test_the_demo_ends_with_table_4_and_the_device_off(tmp_path: Path) -> None:
    shown = [
        subprocess.run(
            [TOUCHBEAM, "demo", "--participants", "2", "--seed", "7"],
            capture_output=True,
            text=True,
            check=True,
        )
        for _ in range(2)
    ]
    assert all("Table 4" in run.stdout and "Device off, read back" in run.stdout for run in shown)
    assert not any(run.stderr for run in shown), "no progress bar where there is no terminal"
    for name in ("table4.csv", "report.html", "report.json"):
        first, second = (Path(folder, "report", name).read_bytes() for folder in ("demo", "demo-2"))
        assert first == second.replace(b"demo-2", b"demo"), f"{name} follows from the seed"
    with closing(sqlite3.connect("demo/study.db")) as journal:
        offs = journal.execute("SELECT payload FROM event WHERE tag = 'device-off'").fetchall()
    assert [json.loads(body)["confirmed"] for (body,) in offs] == [True, True]


def test_a_virtual_session_is_not_run_twice(capsys: pytest.CaptureFixture[str]) -> None:
    assert typed("new", "study") == 0
    arguments = ("run", "study", "--participant", "P01", "--ratings", "virtual")
    assert typed(*arguments) == 0
    assert "7 trials answered, device off (read back)" in capsys.readouterr().out
    assert typed(*arguments) == 2
    assert "P01/1 is complete" in capsys.readouterr().err
    assert typed("report", "study") == 2
    assert "nothing but rehearsals here; name them with --rehearsals" in capsys.readouterr().err


def test_a_study_is_looked_after(capsys: pytest.CaptureFixture[str]) -> None:
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
    assert typed("amend", "study", "--reason", "why not") == 2
    assert typed("exclude", "study", *of, "--reason", " ") == 2
    assert typed("exclude", "study", *of, "--reason", "\udcff") == 2
    capsys.readouterr()
    assert typed("report", "study", "--rehearsals", "--json") == 0
    assert json.loads(capsys.readouterr().out)["left_out"]["trials excluded"] == 1
    assert typed("withdraw", "study", *of) == 0
    assert typed("verify", "study") == 0
    assert "withdrawn" in capsys.readouterr().out


def test_a_changed_study_does_not_go_on(capsys: pytest.CaptureFixture[str]) -> None:
    typed("new", "study")
    study = Path("study/study.toml")
    study.write_text(study.read_text().replace("= 24221 ", "= 12000 "))
    arguments = ("run", "study", "--participant", "P01", "--ratings", "virtual")
    assert typed(*arguments) == 1
    assert "no resonance between 11400 and 12600 Hz" in capsys.readouterr().err
    study.write_text(study.read_text().replace("= 12000 ", "= 24221 "))
    assert typed(*arguments) == 2
    assert "study.toml has changed since the last session" in capsys.readouterr().err


def test_what_run_would_refuse_is_not_accepted(capsys: pytest.CaptureFixture[str]) -> None:
    typed("new", "study")
    assert typed(*RUN, "virtual") == 0
    study, before = Path("study/study.toml"), recorded()
    study.write_text(study.read_text().replace("0.0414", "0.2", 1))
    capsys.readouterr()
    assert typed("amend", "study", "--reason", "further out") == 2
    assert "must lie on the beam, which ends at 0.1 m" in capsys.readouterr().err
    assert recorded() == before


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_turns_the_device_off_and_the_session_goes_on_later(number: int) -> None:
    typed("new", "study")
    command = [TOUCHBEAM, *RUN, "virtual"]
    process = subprocess.Popen(
        [*command, "--pace", "wall"], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    wait_for_event("touch-started")
    process.send_signal(number)
    _, said = process.communicate(timeout=20)
    assert process.returncode == 1
    assert said.strip() == f"touchbeam: stopped by {signal.Signals(number).name}; " + (
        "output off, read back; run it again to go on"
    )
    assert recorded()[-2:] == ["trial-aborted", "device-off"]
    assert subprocess.run(command, check=True, capture_output=True, text=True).stderr == ""
    tags = recorded()
    assert (tags.count("answered"), tags[-1]) == (7, "session-completed")


def test_what_is_run_is_what_the_journal_says_was_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """A study file that is saved while the session begins is not half of it."""
    typed("new", "study")
    study = Path("study/study.toml")
    first = study.read_text()
    text = StudyFolder.text

    def saved_meanwhile(folder: StudyFolder) -> str:
        read = text(folder)
        study.write_text(first.replace("voltage_v = 100", "voltage_v = 40"))
        return read

    monkeypatch.setattr(StudyFolder, "text", saved_meanwhile)
    assert typed(*RUN, "virtual") == 0
    with read_journal(Path("study/study.db")) as journal:
        opened, *events = journal.events("P01/1")
    commanded = [e.payload["commanded"] for e in events if e.tag == "touch-started"]
    assert opened.payload["study_text"] == first
    assert {drive["voltage_v"] for drive in commanded} == {0, 100}


def test_a_journal_that_is_deleted_meanwhile_ends_the_session(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    typed("new", "study")
    append = SessionLog.append

    def append_and_delete(log: SessionLog, tag: str, **payload: object) -> None:
        append(log, tag, **payload)
        if tag == "touch-started":
            Path("study/study.db").unlink(missing_ok=True)

    monkeypatch.setattr(SessionLog, "append", append_and_delete)
    assert typed(*RUN, "virtual") == 1
    said = capsys.readouterr()
    assert_matches(
        r"study\.db: is not the journal any more .*before anything else; output off, read", said.err
    )
    assert "complete" not in said.out


@pytest.mark.parametrize(
    ("closed", "arguments", "code"),
    [
        ("<&-", "--ratings virtual --pace stepped", 0),
        (">&-", "--ratings virtual --pace stepped", 0),
        ("<&-", "--ratings console", 2),
        ("<&-", "--ratings window", 2),
    ],
)
def test_a_closed_stream_is_no_error_of_ours(closed: str, arguments: str, code: int) -> None:
    typed("new", "study")
    command = f"{TOUCHBEAM} run study --participant P01 {arguments} {closed}"
    done = subprocess.run(["sh", "-c", command], stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == code
    assert "internal error" not in done.stderr
    assert (code == 2) == ("needs somebody who types" in done.stderr)
    assert Path("study/study.db").exists() == (code == 0)


@pytest.mark.parametrize("closed", ["stdin", "stdout"])
def test_nobody_is_at_a_terminal_that_is_closed(
    closed: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, closed, None)
    with sitting._console(quiet=False, say=lambda _: None) as (keys, display):
        assert keys(False) == ""
        assert isinstance(display, PlainDisplay)


@pytest.mark.parametrize("somebody_types", [True, False])
def test_who_types_is_no_pipe_though_the_output_is_one(
    somebody_types: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in `touchbeam run … | tee log`."""

    class Typing(io.StringIO):
        def isatty(self) -> bool:
            return somebody_types

    monkeypatch.setattr(sys, "stdin", Typing("\n"))
    with sitting._operator(lambda _: None, lambda _: None) as operator:
        assert operator.piped is not somebody_types


@pytest.mark.parametrize("tag", ["device-off", "session-completed"])
def test_a_signal_after_the_last_answer_finds_the_session_complete(
    tag: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    typed("new", "study")
    append = SessionLog.append

    def append_and_signal(log: SessionLog, tag_of_event: str, **payload: object) -> None:
        if tag_of_event == tag:
            signal.raise_signal(signal.SIGTERM)
        append(log, tag_of_event, **payload)

    monkeypatch.setattr(SessionLog, "append", append_and_signal)
    assert typed(*RUN, "virtual") == 1
    assert capsys.readouterr().err == (
        "touchbeam: stopped by SIGTERM; output off, read back; the session is complete\n"
    )
    assert recorded()[-2:] == ["device-off", "session-completed"]
    assert typed("verify", "study") == 0


def wait_for_event(tag: str) -> None:
    """Return once the journal holds `tag`."""
    import time

    until_s = time.monotonic() + 60
    while time.monotonic() < until_s:
        if Path("study/study.db").exists() and tag in recorded():
            return
        time.sleep(0.05)
    raise AssertionError(f"{tag} never came")


def recorded() -> list[str]:
    with closing(sqlite3.connect("study/study.db", timeout=5)) as journal:
        try:
            return [tag for (tag,) in journal.execute("SELECT tag FROM event ORDER BY rowid")]
        except sqlite3.OperationalError:  # the file is there, its table not yet
            return []


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("run", "nowhere", "--participant", "P01", "--ratings", "virtual"), 2, "no study here"),
        ((*RUN, "console", "--device", "/dev/ttyNOPE"), 1, "/dev/ttyNOPE: no such port"),
        ((*RUN, "console", "--device", "frob://x"), 2, "frob://x: not the address of a device"),
        ((*RUN, "virtual", "--device", "/dev/ttyNOPE"), 2, "feels the simulated device only"),
        ((*RUN, "console", "--pace", "stepped"), 2, "--pace stepped needs"),
        (("run", "study", "--participant", "../P01", "--ratings", "virtual"), 2, "got '../P01'"),
        (("run", "study", "--participant", "Anna", "--ratings", "virtual"), 2, "got 'Anna'"),
        (("run", "study", "--ratings", "virtual"), 2, "Missing option '--participant'"),
        (("import", "elevens.csv", "new"), 2, "elevens.csv, line 2, column a: .* got 11"),
        (("import", "words.csv", "new"), 2, "words.csv, line 2, column a: .* got 'x'"),
        (("import", "nowhere.csv", "new"), 2, "nowhere.csv: no such file"),
        (("import", "binary.csv", "new"), 2, "binary.csv: cannot be read as UTF-8 text"),
        (("import", "scores.csv", "scores.csv/new"), 2, "scores.csv/new: cannot be made"),
        (("import", "scores.csv", "study"), 2, "study: is there already and not empty"),
        (("demo", "--out", "scores.csv/demo"), 2, "scores.csv/demo: cannot be made"),
        (("demo", "--participants", "0"), 2, "--participants"),
        (("report", "study"), 2, "no sessions here"),
        (("report", "nowhere"), 2, "nowhere: no sessions here"),
        (("new", "study"), 2, "study: is there already and not empty"),
        (("new", "scores.csv"), 2, "scores.csv: no folder for a study .Not a directory"),
        (("import", "words.csv", "empty"), 2, "words.csv, line 2"),
        (("demo", "--out", "empty", "--participants", "100"), 2, "--participants"),
        (("new", "other", "--template", "frob"), 2, "one of paper.*, got 'frob'"),
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
    Path("words.csv").write_text("subject,a,b\n1,x,6\n")
    Path("binary.csv").write_bytes(b"\xff\xfe\x00")
    Path("empty").mkdir()
    capsys.readouterr()
    before = everything(tmp_path)
    assert typed(*arguments) == code
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert_matches(message, said.err)
    assert everything(tmp_path) == before


def test_an_empty_folder_is_as_good_as_a_new_one_and_stays_when_the_work_fails(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("study").mkdir()
    assert typed("check", "study") == 2
    assert "make one with: touchbeam new study" in capsys.readouterr().err
    with monkeypatch.context() as patched:
        patched.setattr("protocol.study_file.template_tests", lambda: 1 / 0)
        assert typed("new", "study") == 1
    assert everything(Path()) == {"study"}
    assert typed("new", "study") == 0
    assert typed("check", "study") == 0


def test_conditions_that_the_model_does_not_know_are_named_at_import(
    capsys: pytest.CaptureFixture[str],
) -> None:
    Path("scores.csv").write_text("subject,频率,Voltage,电压\n1,3,4,5\n2,6,8,8\n", encoding="utf-8")
    assert typed("import", "scores.csv", "published") == 0
    said = capsys.readouterr()
    assert said.out.splitlines()[0] == (
        "No contrast is predicted for 频率, 电压: the friction model knows signal, frequency, "
        "structure, voltage, direction, pressure."
    )
    assert said.err == ""
    assert typed("report", "published", "--json") == 0
    reason = json.loads(capsys.readouterr().out)["sensitivity_models"]["M1"]["reason"]
    assert reason == "a line needs at least 3 ratings with a predicted contrast, got 2"
    assert typed("import", str(PUBLISHED), "another") == 0
    assert "predicted" not in capsys.readouterr().out


@pytest.mark.parametrize(
    "command",
    [("new", "../study"), ("import", str(PUBLISHED), "../study"), ("new", "../a/../study")],
)
def test_a_study_can_be_made_beside_this_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]
) -> None:
    for name in ("here", "a"):
        Path(name).mkdir()
    monkeypatch.chdir("here")
    assert typed(*command) == 0
    assert (tmp_path / "study" / "study.toml").is_file()
    assert not everything(tmp_path / "here")


@pytest.mark.parametrize("place", ["missing/../study", "missing/../../study", "link/../study"])
def test_what_cannot_be_made_by_going_back_leaves_nothing(
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
    assert capsys.readouterr().err.endswith(f"{place}/study.toml: No such file or directory\n")
    assert everything(tmp_path) == before


def test_an_unknown_key_names_the_near_miss(capsys: pytest.CaptureFixture[str]) -> None:
    typed("new", "study")
    study = Path("study/study.toml")
    study.write_text(study.read_text().replace("hold_s", "hold_z"))
    assert typed(*RUN, "virtual") == 2
    assert "unknown key, got 'hold_z'; did you mean 'hold_s'?" in capsys.readouterr().err
    assert everything(Path("study")) == {"study.toml", "test_study.py"}


def test_debug_shows_where_an_error_came_from() -> None:
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


def test_the_doctor_sees_a_package_in_the_way() -> None:
    Path("analysis").mkdir()
    Path("analysis/__init__.py").write_text("")
    program = "import sys; sys.argv = ['touchbeam', 'doctor']; from runner.cli import main; main()"
    shown = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert shown.returncode == 1
    assert "FAIL  package analysis" in shown.stdout
    honest = subprocess.run([TOUCHBEAM, "doctor"], capture_output=True, text=True, check=False)
    assert honest.returncode == 0, "the command itself does not look into the current folder"
