"""`touchbeam run` in use: interrupted, with files changed while it runs, with closed streams."""

import json
import signal
import sqlite3
import subprocess
from contextlib import closing
from pathlib import Path

import pytest

import touchbeam
from device.simulator.client import ControlClient, simulator_process
from protocol.journal.events import Event, SessionOpened, SessionResumed, TouchStarted
from runner.journal.opening import read_journal
from runner.journal.store import SessionLog
from runner.study.folder import StudyFolder
from tests.runner.command_line import TOUCHBEAM, assert_matches, typed

pytestmark = pytest.mark.waits

RUN = ("run", "study", "--participant", "P01", "--ratings")


@pytest.fixture(autouse=True)
def somewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_completed_session_is_not_run_again(capsys: pytest.CaptureFixture[str]) -> None:
    assert typed("new", "study") == 0
    arguments = ("run", "study", "--participant", "P01", "--ratings", "virtual")
    assert typed(*arguments) == 0
    assert capsys.readouterr().out.splitlines()[-1] == (
        "P01/1 is complete: 7 trials answered, device off (read back); this was a rehearsal."
    )
    assert typed(*arguments) == 2
    assert (
        "the rehearsal P01/1 is already completed; to rehearse again give another --participant"
        in capsys.readouterr().err
    )
    assert typed("run", "study", "--participant", "p1", "--ratings", "virtual") == 2
    assert "p1 resembles P01, who has a session here" in (said := capsys.readouterr().err)
    assert said.endswith("give --participant P01 if that is meant, else add --new\n")
    assert typed("report", "study") == 2
    assert "nothing but rehearsals here; add --rehearsals (in Python" in capsys.readouterr().err


def test_the_end_of_a_session_says_how_many_touches_had_no_finger(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("protocol.journal.records.LIFTED_N", 1e6)
    typed("new", "study")
    assert typed(*RUN, "virtual") == 0
    assert capsys.readouterr().out.splitlines()[-1] == (
        "P01/1 is complete: 7 trials answered, device off (read back); 12 touches without a "
        "finger on the surface; this was a rehearsal."
    )


def test_a_dry_run_on_a_real_device_is_a_rehearsal_with_the_same_watchdog(
    capsys: pytest.CaptureFixture[str],
) -> None:
    typed("new", "study")
    with (
        simulator_process((TOUCHBEAM,), seed=1, wire="tcp", keep=True) as simulator,
        ControlClient(simulator.control) as control,
    ):
        control.fault("watchdog-dead")
        capsys.readouterr()
        assert typed(*RUN, "virtual", "--device", simulator.url) == 1
        assert control.state()["output"] is False
    shown = capsys.readouterr()
    assert f"DRY RUN on {simulator.url}: the device is driven. Nobody may touch" in shown.out
    assert "watchdog did not trip" in shown.err
    with read_journal(Path("study/study.db")) as journal:
        assert journal.sessions() == ["P01/1 (rehearsal)"]


def test_a_rehearsal_of_a_changed_study_goes_on_and_says_so(
    capsys: pytest.CaptureFixture[str],
) -> None:
    typed("new", "study")
    study = Path("study/study.toml")
    study.write_text(study.read_text().replace("= 24221 ", "= 12000 "))
    arguments = ("run", "study", "--participant", "P01", "--ratings", "virtual")
    assert typed(*arguments) == 1
    assert "no resonance between 11400 and 12600 Hz" in capsys.readouterr().err
    study.write_text(study.read_text().replace("= 12000 ", "= 24221 "))
    assert typed(*arguments) == 0
    assert "study.toml has changed since the last rehearsal." in capsys.readouterr().out


def test_a_report_of_rehearsals_shows_those_of_the_present_study(
    capsys: pytest.CaptureFixture[str],
) -> None:
    typed("new", "study")
    assert typed(*RUN, "virtual") == 0
    study = Path("study/study.toml")
    study.write_text(study.read_text().replace("hold_s = 2.0", "hold_s = 2.5"))
    report = ("report", "study", "--rehearsals", "--sections", "trials")
    assert typed(*report) == 2
    assert "nothing but rehearsals of another study.toml here (1)" in capsys.readouterr().err
    assert typed("run", "study", "--participant", "P02", "--ratings", "virtual") == 0
    assert typed(*report) == 0
    assert "Left out: rehearsals of another study.toml: 1" in capsys.readouterr().out
    trials = json.loads(Path("study/report/report.json").read_text(encoding="utf-8"))["trials"]
    assert {trial["subject"] for trial in trials} == {"P02"}
    loaded = touchbeam.load("study", rehearsals=True)
    assert list(loaded.scores.index) == ["P02"]
    assert set(loaded.trials["participant"]) == {"P01", "P02"}


def test_an_export_holds_rehearsals_on_one_scale(capsys: pytest.CaptureFixture[str]) -> None:
    typed("new", "study")
    assert typed(*RUN, "virtual") == 0
    study = Path("study/study.toml")
    study.write_text(study.read_text().replace("hold_s = 2.0", "hold_s = 2.5"))
    assert typed("run", "study", "--participant", "P02", "--ratings", "virtual") == 0
    export = ("export", "study", "--format", "csv", "--rehearsals")
    assert typed(*export, "both") == 0
    assert "14 trials of 2 participants" in capsys.readouterr().out
    wider = study.read_text().replace("[rating]", "[rating]\nmaximum = 9", 1)
    study.write_text(wider.replace("from = 8, to = 10", "from = 8, to = 9"))
    assert typed(*export, "none") == 2
    told = "nothing but rehearsals on another scale than that of study.toml here; restore it"
    assert told in capsys.readouterr().err
    assert typed("run", "study", "--participant", "P03", "--ratings", "virtual") == 0
    assert typed(*export, "one") == 0
    assert "7 trials of 1 participant (0 trials excluded, marked); left out: 2 rehearsals" in (
        capsys.readouterr().out
    )


def test_a_session_is_resumed_by_the_virtual_person_who_began_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    typed("new", "study")
    leaver, other = Path("leaver.toml"), Path("other.toml")
    leaver.write_text("[person]\nbias = 1.5\ndropout = 1\n")
    other.write_text("[person]\nbias = 9.5\n")
    arguments = ("run", "study", "--participant", "P01", "--ratings", "virtual")
    assert typed(*arguments, "--people", leaver) == 1
    assert typed(*arguments) == 1
    assert typed(*arguments, "--people", leaver) == 1
    capsys.readouterr()
    assert typed(*arguments, "--people", other) == 2
    said = capsys.readouterr().err
    assert "--people gives P01/1 another virtual person than began it; resume it without" in said
    with read_journal(Path("study/study.db")) as journal:
        records = [event.record for event in journal.events("P01/1 (rehearsal)")]
    begun = [it for it in records if isinstance(it, SessionOpened | SessionResumed)]
    truths = [it.virtual for it in begun]
    assert len(truths) == 3
    assert [(it.bias, it.dropout) for it in truths if it] == [(1.5, 1.0)] * 3


def test_a_virtual_session_is_resumed_at_the_beam_that_it_began_with(
    capsys: pytest.CaptureFixture[str],
) -> None:
    typed("new", "study")
    leaver = Path("leaver.toml")
    leaver.write_text("[person]\ndropout = 1\n")
    arguments = ("run", "study", "--participant", "P01", "--ratings", "virtual")
    beam = ("--law", "coulomb", "--rung", "own-mode", "--damping", "0.01", "--seed", "7")
    assert typed(*arguments, "--people", leaver, *beam) == 1
    assert typed(*arguments) == 1
    assert typed(*arguments, *beam) == 1
    capsys.readouterr()
    for option, value, began in (
        ("--law", "printed", "coulomb"),
        ("--damping", "0.02", "0.01"),
        ("--seed", "8", "7"),
    ):
        assert typed(*arguments, option, value) == 2
        said = capsys.readouterr().err
        assert f"{option} {value} gives P01/1 another simulated beam than it began with" in said
        assert f"{began}; resume it without {option}" in said
    with read_journal(Path("study/study.db")) as journal:
        records = [event.record for event in journal.events("P01/1 (rehearsal)")]
    begun = [it for it in records if isinstance(it, SessionOpened | SessionResumed)]
    truths = {it.virtual for it in begun}
    assert len(begun) == 3
    assert {it.seed for it in begun} == {7}
    (truth,) = truths
    assert truth is not None
    assert (truth.law, truth.rung, truth.damping_ratio) == ("coulomb", "own-mode", 0.01)


def test_amend_refuses_a_study_that_run_would_refuse(capsys: pytest.CaptureFixture[str]) -> None:
    typed("new", "study")
    assert typed(*RUN, "virtual") == 0
    study, before = Path("study/study.toml"), recorded()
    study.write_text(study.read_text().replace("0.0414", "0.2", 1))
    capsys.readouterr()
    assert typed("amend", "study", "--reason", "further out") == 2
    assert "must lie on the beam, which ends at 0.1 m" in capsys.readouterr().err
    assert recorded() == before


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_turns_the_device_off_and_the_session_resumes_later(number: int) -> None:
    typed("new", "study")
    command = [TOUCHBEAM, *RUN, "virtual"]
    with subprocess.Popen(
        [*command, "--pace", "wall"], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            lines = iter(process.stdout)
            begun = any("touching" in line and "output ON" in line for line in lines)
            assert begun, "no touch began"
            process.send_signal(number)
            _, said = process.communicate(timeout=20)
        finally:
            process.kill()
    assert process.returncode == 1
    assert said.strip() == f"touchbeam: stopped by {signal.Signals(number).name}; " + (
        "output off, read back; run the same command again to resume; this run is a rehearsal"
    )
    assert recorded()[-2:] == ["trial-aborted", "device-off"]
    assert subprocess.run(command, check=True, capture_output=True, text=True).stderr == ""
    tags = recorded()
    assert (tags.count("answered"), tags[-1]) == (7, "session-completed")


def test_the_journal_records_the_study_that_was_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """The study file is read once, even if it is saved while the session starts."""
    typed("new", "study")
    study = Path("study/study.toml")
    first = study.read_text()
    text = StudyFolder.text

    def text_then_save(folder: StudyFolder) -> str:
        read = text(folder)
        study.write_text(first.replace("voltage_v = 100", "voltage_v = 40"))
        return read

    monkeypatch.setattr(StudyFolder, "text", text_then_save)
    assert typed(*RUN, "virtual") == 0
    with read_journal(Path("study/study.db")) as journal:
        opened, *events = journal.events("P01/1 (rehearsal)")
    commanded = [e.payload["commanded"] for e in events if e.tag == "touch-started"]
    assert opened.payload["study_text"] == first
    assert {drive["voltage_v"] for drive in commanded} == {0, 100}


def test_deleting_the_journal_ends_the_session(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    typed("new", "study")
    append = SessionLog.append

    def append_and_delete(log: SessionLog, event: Event) -> None:
        append(log, event)
        if isinstance(event, TouchStarted):
            Path("study/study.db").unlink(missing_ok=True)

    monkeypatch.setattr(SessionLog, "append", append_and_delete)
    assert typed(*RUN, "virtual") == 1
    said = capsys.readouterr()
    assert_matches(
        r"study\.db: the journal file .* restore both before you continue; output off, read",
        said.err,
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
def test_a_closed_stream_causes_no_internal_error(closed: str, arguments: str, code: int) -> None:
    typed("new", "study")
    command = f"{TOUCHBEAM} run study --participant P01 {arguments} {closed}"
    done = subprocess.run(["sh", "-c", command], stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == code
    assert "internal error" not in done.stderr
    assert (code == 2) == ("standard input must be open" in done.stderr)
    assert Path("study/study.db").exists() == (code == 0)


@pytest.mark.parametrize("tag", ["device-off", "session-completed"])
def test_a_signal_after_the_last_answer_finds_the_session_complete(
    tag: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    typed("new", "study")
    append = SessionLog.append

    def append_and_signal(log: SessionLog, event: Event) -> None:
        if tag == event.TAG:
            signal.raise_signal(signal.SIGTERM)
        append(log, event)

    monkeypatch.setattr(SessionLog, "append", append_and_signal)
    assert typed(*RUN, "virtual") == 1
    assert capsys.readouterr().err == (
        "touchbeam: stopped by SIGTERM; output off, read back; the session is complete; "
        "this run is a rehearsal\n"
    )
    assert recorded()[-2:] == ["device-off", "session-completed"]
    assert typed("verify", "study") == 0


def recorded() -> list[str]:
    with closing(sqlite3.connect("study/study.db", timeout=5)) as journal:
        try:
            return [tag for (tag,) in journal.execute("SELECT tag FROM event ORDER BY rowid")]
        except sqlite3.OperationalError:  # the file exists, its table not yet
            return []
