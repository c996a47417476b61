"""The log of a journal, its checkpoints, and copies of both: no event is lost."""

import gc
import sqlite3
import threading
from contextlib import closing
from pathlib import Path

import pytest

from protocol.journal.events import NoteTaken
from runner.clock import WallClock
from runner.journal.database import (
    LogNotCopiedError,
    connected,
    copied_log,
    copy_database,
    has_wal_reset_bug,
    log_of,
)
from runner.journal.opening import open_journal, read_journal
from runner.journal.session_log import SessionLog
from runner.journal.store import Journal, JournalError


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
