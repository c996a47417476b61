"""The log of a journal, its checkpoints, and copies of both: no event is lost."""

import errno
import gc
import os
import sqlite3
import tempfile
import threading
from contextlib import closing
from pathlib import Path

import pytest

from protocol.journal.events import NoteTaken
from runner.clock import WallClock
from runner.journal.database import (
    LogNotCopiedError,
    connected,
    connected_to_copy,
    copied_log,
    copy_database,
    has_wal_reset_bug,
    leave,
    log_of,
)
from runner.journal.opening import open_journal, read_journal
from runner.journal.store import Journal, JournalError, SessionLog


def noted(journal: Journal, text: str) -> None:
    SessionLog(journal, "P01/1", WallClock()).append(NoteTaken(text=text))


def events_in_main_file(path: Path) -> int:
    with closing(sqlite3.connect(f"{path.as_uri()}?immutable=1", uri=True)) as alone:
        return int(alone.execute("SELECT count(*) FROM event").fetchone()[0])


def test_a_reader_that_leaves_last_merges_the_log(study: Path) -> None:
    path = study / "study.db"
    before = events_in_main_file(path)
    with read_journal(path):
        with open_journal(path) as journal:
            noted(journal, "one more")
        assert log_of(path).exists()
    assert events_in_main_file(path) == before + 1
    assert sorted(file.name for file in study.iterdir()) == ["study.db", "study.toml"]


def test_sqlite_makes_no_checkpoint_of_its_own_when_a_reader_leaves_last(
    study: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = study / "study.db"
    before = events_in_main_file(path)
    monkeypatch.setattr("runner.journal.database._merged", lambda _: True)
    with read_journal(path), open_journal(path) as journal:
        noted(journal, "one more")
    assert events_in_main_file(path) == before
    with read_journal(path) as reader:
        assert len(reader.events("P01/1")) == before + 1


def test_who_leaves_waits_for_a_reader_who_leaves_too(study: Path) -> None:
    path = study / "study.db"
    before, reads, leaves = events_in_main_file(path), threading.Event(), threading.Event()

    def read() -> None:
        with closing(connected(path)) as other:
            other.execute("BEGIN").execute("SELECT count(*) FROM event").fetchone()
            reads.set()
            leaves.wait(0.3)

    reader = threading.Thread(target=read)
    with open_journal(path) as journal:
        noted(journal, "one more")
        reader.start()
        reads.wait()
    merged = not log_of(path).exists()
    leaves.set()
    reader.join()
    assert merged
    assert events_in_main_file(path) == before + 1


def test_an_empty_log_that_nobody_has_removed_goes_with_the_next_to_leave(study: Path) -> None:
    """Two that close at the same moment leave it, because each waits for the other to do it."""
    path = study / "study.db"
    before = sorted(file.name for file in study.iterdir())
    log_of(path).touch()
    log_of(path).with_name("study.db-shm").touch()
    reader = connected(path, "mode=ro")
    reader.execute("SELECT count(*) FROM event").fetchone()
    leave(reader, path, 0)
    assert sorted(file.name for file in study.iterdir()) == before


def test_an_empty_log_of_somebody_who_stays_is_left_with_what_is_then_written(study: Path) -> None:
    path = study / "study.db"
    with open_journal(path) as journal:
        leave(connected(path), path, 0)
        assert log_of(path).exists()
        before = events_in_main_file(path)
        noted(journal, "one more")
    assert events_in_main_file(path) == before + 1


def test_a_log_that_cannot_be_merged_stays_and_is_tried_once(
    study: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = study / "study.db"
    tried = []

    def fails(*_: object) -> bool:
        tried.append(path)
        raise sqlite3.OperationalError("database or disk is full")

    with open_journal(path) as journal:
        noted(journal, "one more")
        log = log_of(path).read_bytes()
        monkeypatch.setattr("runner.journal.database._passively_copied", fails)
    monkeypatch.undo()
    gc.collect()  # a connection that nobody has closed would be now, and SQLite would merge
    assert tried == [path]
    assert log_of(path).read_bytes() == log


def test_an_error_other_than_busy_is_raised_by_a_checkpoint(study: Path) -> None:
    path = study / "study.db"
    with closing(connected(path)) as connection:
        connection.execute("BEGIN")
        with pytest.raises(sqlite3.OperationalError, match="within a transaction"):
            copied_log(connection, path, None)


def test_a_copy_has_what_there_was_when_it_was_begun(
    study: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An event that is appended meanwhile neither gets into it nor lets it begin anew."""
    path, copy = study / "study.db", study / "copy.db"
    with open_journal(path) as journal:
        noted(journal, "x" * 8_000_000)
        steps: list[None] = []

        def appended() -> None:
            steps.append(None)
            noted(journal, "one more")

        monkeypatch.setattr("runner.journal.database.raise_if_stopped", appended)
        with closing(connected(path)) as other:
            copy_database(other, copy)
        monkeypatch.undo()
        written = len(journal.events("P01/1"))
    with closing(sqlite3.connect(copy)) as alone:
        (copied,) = alone.execute("SELECT count(*) FROM event").fetchone()
    assert copied == written - len(steps)
    assert len(steps) >= 2


def test_a_reader_leaves_a_running_session_alone(study: Path) -> None:
    path = study / "study.db"
    before = events_in_main_file(path)
    with open_journal(path) as journal:
        noted(journal, "one more")
        with read_journal(path) as reader:
            assert len(reader.events("P01/1")) == before + 1
        assert events_in_main_file(path) == before
        noted(journal, "another")
    assert events_in_main_file(path) == before + 2


def test_the_log_starts_anew_after_a_checkpoint(study: Path) -> None:
    path = study / "study.db"
    with open_journal(path) as journal:
        sizes = set()
        for _ in range(5):
            noted(journal, "x" * 20_000)
            assert journal.checkpoint()
            sizes.add(log_of(path).stat().st_size)
    assert max(sizes) < 100_000


def test_a_checkpoint_waits_for_no_reader_and_for_a_writer_only_a_while(study: Path) -> None:
    path = study / "study.db"
    with open_journal(path) as journal, closing(sqlite3.connect(path)) as other:
        other.execute("BEGIN").execute("SELECT count(*) FROM event").fetchone()
        noted(journal, "one more")
        assert not journal.checkpoint()
        other.rollback()
        assert journal.checkpoint()
        journal._connection.execute("PRAGMA busy_timeout = 10")  # ms, for a quick test
        other.execute("BEGIN IMMEDIATE")
        assert not journal.checkpoint()


@pytest.mark.parametrize("when", ["checkpoint", "close"])
def test_events_that_the_main_file_lacks_after_a_checkpoint_are_kept_in_a_copy_of_the_log(
    study: Path, monkeypatch: pytest.MonkeyPatch, when: str
) -> None:
    path = study / "study.db"
    journal = open_journal(path)
    noted(journal, "one more")
    log = log_of(path).read_bytes()
    with monkeypatch.context() as patched:
        patched.setattr("runner.journal.database._tips", differing())
        with pytest.raises(JournalError, match="lacks events of its log, which is kept as study"):
            journal.checkpoint() if when == "checkpoint" else journal.__exit__(None, None, None)
    if when == "checkpoint":
        journal.__exit__(None, None, None)
    (kept,) = study.glob("study.db-wal-kept-*")
    assert kept.read_bytes() == log
    if when == "close":
        assert log_of(path).read_bytes() == log
    with read_journal(path) as again:
        assert again.events("P01/1")[-1].payload == {"text": "one more"}


def differing() -> object:
    answers = iter([{"P01/1": (1,)}, {"P01/1": (0,)}] * 2)
    return lambda _: next(answers)


def test_the_events_of_this_process_must_be_in_the_main_file(study: Path) -> None:
    path = study / "study.db"
    with closing(connected(path)) as connection:
        connection.execute("UPDATE event SET payload = NULL, salt = NULL WHERE seq = 3")
        with pytest.raises(LogNotCopiedError, match="lacks events of its log"):
            copied_log(connection, path, ("P01/1", "another hash"))


@pytest.mark.parametrize(
    ("version", "affected"),
    [("3.40.1", True), ("3.44.5", True), ("3.44.6", False), ("3.50.7", False), ("3.51.2", True),
     ("3.51.3", False), ("3.53.0", False), ("4.0.0", False)],
)  # fmt: skip
def test_versions_with_the_wal_reset_bug_are_known(version: str, affected: bool) -> None:
    assert has_wal_reset_bug(version) == affected


@pytest.fixture
def unindexed(study: Path) -> Path:
    """A journal with an event in its log alone, where SQLite cannot write the log's index."""
    path = study / "study.db"
    with open_journal(path) as journal, closing(connected(path)) as other:
        noted(journal, "in the log alone")
        other.execute("SELECT 1 FROM event").fetchone()
        kept = path.read_bytes(), log_of(path).read_bytes()
    path.write_bytes(kept[0])
    log_of(path).write_bytes(kept[1])
    path.with_name("study.db-shm").symlink_to("study.db-shm")  # nothing can be opened there
    return path


def test_where_nothing_can_be_written_a_copy_is_read_with_the_log(
    unindexed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    places = [tmp_path / "tmp", tmp_path / "memory"]
    for place in places:
        place.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(places[0]))
    monkeypatch.setattr("runner.journal.database.IN_MEMORY", places[1])
    before = {file: file.lstat().st_mtime_ns for file in unindexed.parent.iterdir()}
    with read_journal(unindexed) as journal:
        assert journal.events("P01/1")[-1].payload == {"text": "in the log alone"}
        assert [list(place.iterdir()) for place in places] == [[], []], "it has no name any more"
        journal.copy_to(tmp_path / "copy.db")
    assert {file: file.lstat().st_mtime_ns for file in unindexed.parent.iterdir()} == before
    with read_journal(tmp_path / "copy.db") as copy:
        assert copy.events("P01/1")[-1].payload == {"text": "in the log alone"}


def test_a_copy_goes_where_there_is_room(
    unindexed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    full, tried = [tempfile.gettempdir()], list[Path]()

    def copied(part: Path, copy: Path) -> None:
        tried.append(copy.parent)
        if str(copy.parent.parent) in full:
            raise OSError(errno.ENOSPC, "No space left on device")
        copy.write_bytes(part.read_bytes())

    monkeypatch.setattr("runner.journal.database.shutil.copyfile", copied)
    with read_journal(unindexed) as journal:
        assert journal.sessions() == ["P01/1"]
    full.append("/dev/shm")
    with pytest.raises(JournalError, match="and no other has room for a copy; set TMPDIR to a"):
        read_journal(unindexed)
    assert not any(place.exists() for place in tried)


def test_a_log_that_is_put_aside_meanwhile_is_not_read_over(unindexed: Path) -> None:
    log_of(unindexed).rename(unindexed.with_name("study.db-wal-aside"))
    with pytest.raises(sqlite3.OperationalError, match="it changes while it is read"):
        connected_to_copy(unindexed)


def test_a_pipe_in_place_of_the_log_is_not_waited_for(unindexed: Path) -> None:
    log_of(unindexed).unlink()
    os.mkfifo(log_of(unindexed))
    with pytest.raises(sqlite3.DatabaseError, match=r"study\.db-wal must be a regular file"):
        connected_to_copy(unindexed)
