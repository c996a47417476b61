"""A study that is exported to BIDS and comes back: the same data, without what is private."""

import json
import os
import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import touchbeam
from protocol.journal.events import (
    Answered,
    Event,
    NoteTaken,
    RigDescribed,
    SessionOpened,
    TrialAborted,
    TrialExcluded,
    TrialStarted,
    WatchdogTested,
    WindowChanged,
)
from protocol.journal.records import QuestionAnswer
from protocol.study.columns import COLUMNS
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study, template, text_digest
from runner.journal.opening import open_journal
from tests.analysis.chains import chain
from tests.analysis.hostile_study import sessions, study_text
from tests.analysis.reports import session_events
from tests.runner.command_line import typed

TEXT = template("extended") + (
    '\n[[question]]\nname = "effort"\nkind = "number"\nwhen = "trial"\n'
    'required = false\n[question.text]\nen = "How hard was it?"\nzh = "难吗？"\n'
)
SECRETS = ("C-17-Smith", "sneezed twice", "/dev/ttyUSB7", "mouse-path", "2026-01-01")
SESSIONS = "sourcedata/touchbeam"


def eventful(study: Study, slot: int, rng: np.random.Generator, name: str) -> Iterator[Event]:
    """A session with all that may stay behind, and with an attempt that was broken off."""
    for event in session_events(study, slot, rng, who=name):
        if isinstance(event, SessionOpened):
            yield replace(
                event, study_text=TEXT, study_sha256=text_digest(TEXT), consent="C-17-Smith"
            )
        elif isinstance(event, TrialStarted) and event.index == 4:
            yield event
            yield TrialAborted(index=4, why="the operator repeats it")
            yield NoteTaken(text="sneezed twice")
            yield event
        elif isinstance(event, Answered):
            effort = QuestionAnswer(
                name="effort", answer=event.index, reaction_time_s=0.5, trace={"mouse-path": [1]}
            )
            yield replace(event, traces=({"mouse-path": [1, 2]},), questions=(effort,))
        else:
            yield event
            if event.TAG == "device-armed":
                yield WatchdogTested(tripped=True, idn="test", address="/dev/ttyUSB7")
                yield RigDescribed(answers={"skin state": "dry"})
                yield WindowChanged(has_keys=False, is_shown=False)


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("original") / "study"
    folder.mkdir()
    (folder / "study.toml").write_text(TEXT, encoding="utf-8")
    study, rng = parsed_study(TEXT), np.random.default_rng(1)
    with open_journal(folder / "study.db") as journal, journal.alone():
        for slot, name in enumerate(("P03", "P01", "P02", "P05")):  # not in the order of names
            events = [*eventful(study, slot, rng, name)]
            events += [TrialExcluded(index=9, reason="the phone rang")] * (slot == 1)
            for stored in chain(events):
                journal.append(f"{name}/1", replace(stored, monotonic_s=stored.monotonic_s + 5e4))
    return folder


@pytest.fixture(scope="module")
def exported(original: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("exported") / "bids"
    assert typed("export", original, folder, "--format", "bids") == 0
    return folder


@pytest.fixture(scope="module")
def restored(exported: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("restored") / "study"
    assert typed("import", exported, folder) == 0
    return folder


@pytest.fixture(scope="module")
def reported(restored: Path) -> Path:
    """The report on what came back."""
    assert typed("report", restored) == 0
    return restored / "report"


@pytest.fixture
def changed(exported: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(exported, tmp_path / "changed"))


def test_the_report_is_the_same_but_for_the_notes(original: Path, reported: Path) -> None:
    assert typed("report", original) == 0
    before, after = original / "report", reported
    assert (before / "table4.csv").read_bytes() == (after / "table4.csv").read_bytes()
    known, found = (json.loads((path / "report.json").read_text()) for path in (before, after))
    assert list(known) == list(found)
    assert [key for key in known if known[key] != found[key]] == ["incidents"]
    incidents = [it for it in known["incidents"] if it["what"] != "note"]
    assert found["incidents"] == incidents
    assert len(incidents) < len(known["incidents"])


def test_the_tables_are_the_same(original: Path, restored: Path) -> None:
    known, found = touchbeam.load(original), touchbeam.load(restored)
    private = [column.name for column in COLUMNS if column.private]
    pd.testing.assert_frame_equal(
        known.trials.drop(columns=private), found.trials.drop(columns=private)
    )
    assert found.trials.notes.isna().all()
    assert set(found.trials.started_utc.dt.date) == {date(1970, 1, 1)}
    pd.testing.assert_frame_equal(known.touches, found.touches)
    pd.testing.assert_frame_equal(known.traces(), found.traces())
    pd.testing.assert_frame_equal(known.scores, found.scores)
    pd.testing.assert_frame_equal(known.sessions, found.sessions)
    pd.testing.assert_frame_equal(known.plan("P01"), found.plan("P01"))
    assert found.trials.effort.notna().all()
    assert not found.traces().empty


def test_the_journal_and_a_second_export_are_whole(
    restored: Path, exported: Path, tmp_path: Path
) -> None:
    assert typed("verify", restored) == 0
    assert typed("export", restored, tmp_path / "again", "--format", "bids") == 0
    for file in sorted(path for path in exported.rglob("*") if path.is_file()):
        again = tmp_path / "again" / file.relative_to(exported)
        if file.name not in {"README.md", "dataset_description.json"}:  # they name the journal
            assert again.read_bytes() == file.read_bytes(), file


def test_what_is_private_stays_behind(original: Path, exported: Path) -> None:
    journal = (original / "study.db").read_bytes()
    assert all(secret.encode() in journal for secret in SECRETS)
    for file in exported.rglob("*"):
        if file.is_file():
            assert not [secret for secret in SECRETS if secret.encode() in file.read_bytes()], file


def test_every_kind_of_session_comes_back_but_those_that_left(tmp_path: Path) -> None:
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / "study.toml").write_text(study_text(), encoding="utf-8")
    with open_journal(tmp_path / "study" / "study.db") as journal:
        for session in sessions(study_text()):
            end = " (rehearsal)" if session.kind == "rehearsal" else ""
            for event in session.events:
                journal.append(f"{session.participant}/{session.number}{end}", event)
    out = tmp_path / "bids"
    assert typed("export", tmp_path / "study", out, "--format", "bids", "--rehearsals") == 0
    assert typed("import", out, tmp_path / "back") == 0
    assert typed("verify", tmp_path / "back") == 0
    known = touchbeam.load(tmp_path / "study", rehearsals=True)
    found = touchbeam.load(tmp_path / "back", rehearsals=True)
    begun = known.sessions[known.sessions.participant != "D02"].reset_index(drop=True)
    pd.testing.assert_frame_equal(begun, found.sessions)
    pd.testing.assert_frame_equal(known.touches, found.touches)
    assert "W01" not in "".join(path.read_text() for path in out.rglob("*") if path.is_file())
    with open_journal(tmp_path / "back" / "study.db") as journal:
        assert "R01/1 (rehearsal)" in journal.sessions()


def test_published_scores_come_back(tmp_path: Path) -> None:
    scores = Path(__file__).parents[1] / "data" / "published_scores.csv"
    assert typed("import", scores, tmp_path / "published") == 0
    assert typed("export", tmp_path / "published", tmp_path / "bids", "--format", "bids") == 0
    assert typed("import", tmp_path / "bids", tmp_path / "back") == 0
    known, found = touchbeam.load(tmp_path / "published"), touchbeam.load(tmp_path / "back")
    pd.testing.assert_frame_equal(known.scores, found.scores)


def test_a_folder_that_touchbeam_has_not_exported_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed("import", tmp_path, tmp_path / "study") == 2
    said = capsys.readouterr().err
    assert "must be what touchbeam export --format bids wrote" in said
    assert not (tmp_path / "study").exists()


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('{"place": 0}', '{"place": "first"}', "cannot be read as a session of touchbeam"),
        ('{"place": 0}', "", "cannot be read as a session of touchbeam"),
        ('["session-opened"', '["session-closed"', "cannot be read as a session"),
        ('["device-armed"', '["session-completed"', "cannot be read as a session"),
        ('"trace": [[', '"trace": [[NaN, ', "cannot be read as a session"),
        ('"trace": [[', '"trace": [[0, ', "cannot be read as a session"),
        ('"trace": [[0.0', '"trace": [["now"', "of touchbeam (touch-ended, trace has a "),
        ('"condition": "voltage"', '"condition": null', "one of the session's conditions, trial "),
        ('"frequency_hz": 24000.0', '"frequency_hz": 0', "(resonance-measured, frequency_hz: 0)"),
        ('"participant": "P03"', '"participant": null', "(session-opened, participant has a "),
        ('"participant": "P03"', '"participant": "../../x1"', "must be a pseudonym"),
        ('"participant": "P03"', '"participant": "@study"', "must be a pseudonym"),
        ('"session": 1', '"session": 0', "must be a numbered session of a participant"),
        ('"kind": "participant"', '"kind": "slide"', "must be a numbered session of a participant"),
        (
            '{"place": 0}',
            "[" * 100_000,
            "as a session of touchbeam (line 1 is not one of",
        ),
        ('"participant": "P03"', '"participant": "P01"', "must hold each session once"),
        ('"participant": "P03", ', "", "(session-opened, participant is missing)"),
    ],
)
def test_a_session_that_was_changed_so_that_it_is_none_is_refused(
    old: str, new: str, problem: str, changed: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = changed / SESSIONS / "sub-P03.jsonl"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    study = changed.parent / "study"
    assert typed("import", changed, study) == 2
    said = capsys.readouterr().err
    assert problem in said
    assert said.count("\n") == 1
    assert len(said) < 500
    assert not study.exists()


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        (r'"score": \d+', '"score": 99', "score: must be from 0 to 10, got 99"),
        (r'"score": \d+', '"score": -1', "score: must be from 0 to 10, got -1"),
        (r'"change": "\w+"', '"change": "=1+1"', "change: must be one of "),
        (r'"agrees": true', '"agrees": false', "agrees: must say whether "),
        (r'"index": \d+', '"index": 999', "index: must be a trial of the session's plan, got 999"),
        (
            r'"reaction_time_s": 0.5',
            '"reaction_time_s": -0.5',
            "reaction_time_s: must be at least 0, got -0.5",
        ),
    ],
)
def test_an_answer_that_nobody_can_have_given_is_refused(
    old: str, new: str, problem: str, changed: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = changed / SESSIONS / "sub-P03.jsonl"
    lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
    at = next(
        number
        for number, line in enumerate(lines)
        if line.startswith('["answered"') and re.search(old, line)
    )
    lines[at] = re.sub(old, new, lines[at], count=1)
    file.write_text("".join(lines), encoding="utf-8")
    assert typed("import", changed, changed.parent / "study") == 2
    said = capsys.readouterr().err
    assert f"sub-P03.jsonl: line {at + 1}, answered, {problem}" in said
    assert said.count("\n") == 1
    assert not (changed.parent / "study").exists()


def test_scores_before_an_amendment_of_the_scale_come_back(
    original: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = Path(shutil.copytree(original, tmp_path / "amended"))
    bands = re.compile(r"bands = \[.*?^\]$", re.DOTALL | re.MULTILINE)
    amended = bands.sub("minimum = 11\nmaximum = 20", TEXT)
    (study / "study.toml").write_text(amended, encoding="utf-8")
    assert typed("amend", study, "--reason", "a shorter scale") == 0, capsys.readouterr().err
    assert typed("export", study, tmp_path / "bids", "--format", "bids") == 0
    assert typed("import", tmp_path / "bids", tmp_path / "back") == 0, capsys.readouterr().err


def a_pipe(file: Path) -> None:
    os.mkfifo(file)


def endless(file: Path) -> None:
    file.symlink_to("/dev/zero")


def large(file: Path) -> None:
    with file.open("wb") as hollow:
        hollow.truncate(2**40)


BAD_FILES = pytest.mark.parametrize(
    ("make", "problem"),
    [
        (a_pipe, "must be a file, got a pipe or a device"),
        (endless, "must be a file, got a pipe or a device"),
        (large, "bytes, got 1099511627776"),
    ],
)


@BAD_FILES
@pytest.mark.parametrize("name", ["study.toml", "registration.toml", "sub-P03.jsonl"])
def test_a_file_that_never_ends_or_is_too_long_is_refused(
    make: Callable[[Path], None],
    problem: str,
    name: str,
    changed: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (changed / SESSIONS / name).unlink(missing_ok=True)
    make(changed / SESSIONS / name)
    assert typed("import", changed, changed.parent / "study") == 2
    said = capsys.readouterr().err
    assert f"{name}: must " in said
    assert problem in said
    assert not (changed.parent / "study").exists()


@BAD_FILES
def test_such_a_table_of_scores_is_refused(
    make: Callable[[Path], None], problem: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make(tmp_path / "scores.csv")
    assert typed("import", tmp_path / "scores.csv", tmp_path / "study") == 2
    assert problem in capsys.readouterr().err
    assert not (tmp_path / "study").exists()


def test_a_session_without_events_is_refused(
    changed: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (changed / SESSIONS / "sub-P03.jsonl").write_text('{"place": 0}\n')
    assert typed("import", changed, changed.parent / "study") == 2
    assert "must begin with the opening of a session" in capsys.readouterr().err


def test_a_participant_whose_files_are_deleted_does_not_come_back(changed: Path) -> None:
    (changed / SESSIONS / "sub-P03.jsonl").unlink()
    shutil.rmtree(changed / "sub-P03")
    assert typed("import", changed, changed.parent / "study") == 0
    left = touchbeam.load(changed.parent / "study").sessions.participant.tolist()
    assert left == ["P01", "P02", "P05"]
