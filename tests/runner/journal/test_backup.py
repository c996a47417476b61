"""Backups: whole verified copies that replace nothing, also while a session writes."""

import json
import os
import sqlite3
import threading
from contextlib import closing
from pathlib import Path

import pytest

from protocol.errors import BadInput
from protocol.journal.events import NoteTaken
from runner.clock import WallClock
from runner.journal.opening import open_journal, read_journal
from runner.journal.store import Journal, SessionLog
from runner.journal.verification import SessionVerdict, backed_up, verdicts
from tests.runner.command_line import typed
from tests.runner.journal.tampering import tampering
from tests.runner.journal.test_store import room_for


def test_a_backup_is_a_private_verified_copy(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed("backup", study, "copy.db") == 0
    copy = tmp_path / "copy.db"
    with read_journal(study / "study.db") as journal, read_journal(copy) as again:
        events = journal.events("P01/1")
        assert again.events("P01/1") == events
    said = f"Written and verified: copy.db, 1 session, {len(events)} events\n"
    assert capsys.readouterr() == (said, "")
    assert copy.stat().st_mode & 0o777 == 0o600
    assert sorted(file.name for file in tmp_path.iterdir()) == ["copy.db", "study"]
    assert typed("verify", copy) == 0
    assert capsys.readouterr().out.startswith("ok    P01/1  completed")
    assert typed("backup", study, "second.db", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["ok"], found["file"], found["events"]) == (True, "second.db", len(events))
    assert found["sessions"][0]["chain_ok"]


@pytest.mark.parametrize("what", ["file", "folder", "link to nothing"])
def test_a_backup_replaces_nothing(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], what: str
) -> None:
    copy = tmp_path / "copy.db"
    if what == "file":
        copy.write_text("precious")
    elif what == "folder":
        copy.mkdir()
    else:
        copy.symlink_to("elsewhere")
    assert typed("backup", study, "copy.db") == 2
    said = "touchbeam: copy.db: exists and is not overwritten; choose another name\n"
    assert capsys.readouterr() == ("", said)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["copy.db", "study"]
    if what == "file":
        assert copy.read_text() == "precious"


def test_a_backup_into_a_missing_folder_names_the_file(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed("backup", study, "none/copy.db") == 2
    assert capsys.readouterr().err == "touchbeam: none/copy.db: No such file or directory\n"


def test_a_backup_that_does_not_fit_leaves_nothing(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with room_for(40_000):
        assert typed("backup", study, "copy.db") == 1
    assert "study.db: cannot be copied to " in capsys.readouterr().err
    assert [file.name for file in tmp_path.iterdir()] == ["study"]


def test_a_backup_of_a_changed_journal_is_kept_and_fails(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with tampering(study / "study.db") as other:
        other.execute("UPDATE event SET payload = NULL WHERE seq = 3")
    assert typed("backup", study, "copy.db") == 1
    shown = capsys.readouterr().out
    assert shown.startswith("Written and verified with problems: see touchbeam verify copy.db: ")
    assert typed("verify", "copy.db") == 1


def test_a_name_that_is_taken_is_refused_before_anything_is_read(tmp_path: Path) -> None:
    taken = tmp_path / "copy.db"
    taken.write_text("precious")
    with pytest.raises(BadInput, match="exists and is not overwritten"):
        backed_up(tmp_path / "no journal.db", taken)


def test_a_name_that_is_taken_meanwhile_is_refused_too(
    study: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy = study / "copy.db"

    def taken_meanwhile(journal: Journal) -> list[SessionVerdict]:
        copy.write_text("precious")
        return verdicts(journal)

    monkeypatch.setattr("runner.journal.verification.verdicts", taken_meanwhile)
    with pytest.raises(BadInput, match="exists and is not overwritten"):
        backed_up(study / "study.db", copy)
    assert copy.read_text() == "precious"
    assert sorted(file.name for file in study.iterdir()) == ["copy.db", "study.db", "study.toml"]


def test_a_backup_never_has_its_name_without_its_content(
    study: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whenever the process is killed, no empty file stands where people look for a backup."""
    copy, close = study / "copy.db", os.close

    def closing_none(number: int) -> None:
        assert not copy.exists() or copy.stat().st_size > 0
        close(number)

    monkeypatch.setattr(os, "close", closing_none)
    backed_up(study / "study.db", copy)
    assert sorted(file.name for file in study.iterdir()) == ["copy.db", "study.db", "study.toml"]


def test_a_backup_can_be_made_where_there_are_no_links(
    study: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(Path, "hardlink_to", refused)
    _, (verdict,) = backed_up(study / "study.db", study / "copy.db")
    assert verdict.ok
    assert sorted(file.name for file in study.iterdir()) == ["copy.db", "study.db", "study.toml"]


def test_a_journal_that_lacks_a_trigger_can_be_backed_up(study: Path) -> None:
    with closing(sqlite3.connect(study / "study.db")) as other:
        other.execute("DROP TRIGGER event_is_not_deleted")
    lacking, (verdict,) = backed_up(study / "study.db", study / "copy.db")
    assert lacking == ("event_is_not_deleted",)
    assert verdict.ok


def test_copy_and_name_are_on_the_disk_when_a_backup_is_made(
    study: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy = study / "copy.db"
    synced: list[tuple[str, bytes]] = []
    fsync = os.fsync

    def noting(number: int) -> None:
        """Note what is synced, and what the copy has at that moment under its final name."""
        name = Path(f"/proc/self/fd/{number}").readlink().name
        synced.append((name, copy.read_bytes() if copy.exists() else b""))
        fsync(number)

    monkeypatch.setattr(os, "fsync", noting)
    before = len(list(Path("/proc/self/fd").iterdir()))
    backed_up(study / "study.db", copy)
    assert len(list(Path("/proc/self/fd").iterdir())) == before
    (copied, unnamed), folder = synced
    assert copied.startswith(".touchbeam-")
    assert unnamed == b""
    assert folder == ("study", copy.read_bytes())


def test_backups_during_a_session_have_every_event_so_far(study: Path, tmp_path: Path) -> None:
    path = study / "study.db"
    written = threading.Event()
    appended: list[int] = []
    at_least: dict[Path, int] = {}

    def copies() -> None:
        ended = False
        while not ended:
            ended = written.is_set()  # the last copy begins while the log has events
            copy = tmp_path / f"copy-{len(at_least)}.db"
            so_far = len(appended)
            lacking, (verdict,) = backed_up(path, copy)
            assert not lacking
            assert verdict.chain_ok
            at_least[copy] = so_far

    with open_journal(path) as journal:
        before = len(journal.events("P01/1"))
        log = SessionLog(journal, "P01/1", WallClock())
        copier = threading.Thread(target=copies)
        copier.start()
        for number in range(100):
            log.append(NoteTaken(text=f"{number}" * 1000))
            appended.append(number)
            if number % 10 == 0:
                journal.checkpoint()
        written.set()
        copier.join()
        whole = journal.events("P01/1")
    assert max(at_least.values()) == len(appended)
    for copy, so_far in at_least.items():
        with read_journal(copy) as again:
            events = again.events("P01/1")
        assert events == whole[: len(events)]
        assert len(events) >= before + so_far
