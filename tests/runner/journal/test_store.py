"""The journal: append-only, chained, private, and never half-written."""

import os
import resource
import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from protocol.journal.events import StoredEvent
from runner.journal.database import log_of
from runner.journal.opening import (
    SCHEMA_VERSION,
    journal_if_used,
    open_journal,
    read_journal,
    unused,
)
from runner.journal.store import FIRST_HASH, SALT_BYTES, Journal, JournalError, chain_hash
from runner.journal.verification import verdicts
from tests.runner.journal.tampering import tampering
from tests.runner.journal.unsalted import make_unsalted

NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)
TYPED = "粗糙 \"quoted\" '=cmd()'"


def event(seq: int, **payload: object) -> StoredEvent:
    return StoredEvent(seq=seq, tag="note", utc=NOON, monotonic_s=1.5, payload=payload)


def filled(path: Path) -> Journal:
    journal = open_journal(path)
    journal.append("P01/1", event(0, text=TYPED))
    journal.append("P01/1", event(1, value=1.25))
    journal.append("P02/1", event(0))
    return journal


def connected(
    path: Path, kind: type[sqlite3.Connection] = sqlite3.Connection
) -> sqlite3.Connection:
    """Return SQLite's connection to a filled journal whose log exists."""
    filled(path).__exit__(None, None, None)
    connection = sqlite3.connect(path, isolation_level=None, factory=kind)
    connection.execute("SELECT count(*) FROM event")  # the first query creates the log
    return connection


def test_events_are_read_as_they_were_written(tmp_path: Path) -> None:
    with filled(tmp_path / "study.db"):
        pass
    with open_journal(tmp_path / "study.db") as journal:
        assert journal.sessions() == ["P01/1", "P02/1"]
        assert journal.events("P01/1") == [event(0, text=TYPED), event(1, value=1.25)]


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE event SET tag = 'x'",
        "UPDATE event SET payload = '{}'",
        "UPDATE event SET payload = NULL",
        "UPDATE event SET salt = NULL",
        "UPDATE event SET payload = NULL, salt = zeroblob(16)",
        "UPDATE event SET payload = NULL, salt = NULL, utc = '2027-01-01T00:00:00+00:00'",
        "UPDATE event SET payload = NULL, salt = NULL, rowid = rowid + 10",
        "DELETE FROM event",
        "INSERT OR REPLACE INTO event SELECT * FROM event WHERE seq = 0",
    ],
)
def test_events_cannot_be_changed(tmp_path: Path, statement: str) -> None:
    path = tmp_path / "study.db"
    with (
        filled(path),
        closing(sqlite3.connect(path)) as other,
        pytest.raises(sqlite3.IntegrityError, match="append-only"),
    ):
        other.execute(statement)


def test_each_event_is_chained_to_the_one_before(tmp_path: Path) -> None:
    path = tmp_path / "study.db"
    with filled(path), closing(sqlite3.connect(path)) as other:
        rows = other.execute("SELECT * FROM event WHERE session = 'P01/1' ORDER BY seq").fetchall()
    first, second = ((row[:6], row[6]) for row in rows)
    assert first[1] == chain_hash(FIRST_HASH, first[0])
    assert second[1] == chain_hash(first[1], second[0])


def test_a_repeated_event_is_refused_and_not_stored(tmp_path: Path) -> None:
    with filled(tmp_path / "study.db") as journal:
        with pytest.raises(JournalError, match=r"cannot be written \(the journal is append-only"):
            journal.append("P01/1", event(1))
        assert len(journal.events("P01/1")) == 2
        journal.append("P01/1", event(2))


def test_a_gap_is_refused(tmp_path: Path) -> None:
    journal = filled(tmp_path / "study.db")
    with journal, pytest.raises(JournalError, match="P01/1 has no event 4"):
        journal.append("P01/1", event(5))


def test_equal_events_have_digests_that_differ(tmp_path: Path) -> None:
    """Each has a salt of its own, so that nobody can guess what was erased."""
    path = tmp_path / "study.db"
    with open_journal(path) as journal, closing(sqlite3.connect(path)) as other:
        for number in range(2):
            journal.append(f"P0{number}/1", event(0, text=TYPED))
        rows = other.execute("SELECT payload, payload_sha256, salt FROM event").fetchall()
    (payload, digest, salt), again = rows
    assert again[0] == payload
    assert again[1] != digest
    assert again[2] != salt
    assert len(salt) == SALT_BYTES


def test_a_journal_without_salts_is_written_without(tmp_path: Path) -> None:
    path = tmp_path / "study.db"
    make_unsalted(path)
    with open_journal(path) as journal:
        journal.append("P01/1", event(0, text=TYPED))
        assert all(verdict.chain_ok for verdict in verdicts(journal))
        (link,) = journal.chain("P01/1")
    assert link.event == event(0, text=TYPED)


def test_a_session_whose_name_is_damaged_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SQLite gives what a damaged page has, whatever the table allows."""
    monkeypatch.setattr("runner.journal.store._SESSIONS", "SELECT x'00ff'")
    with (
        filled(tmp_path / "study.db") as journal,
        pytest.raises(JournalError, match="the name of a session is damaged"),
    ):
        journal.sessions()


def test_a_checkpoint_needs_no_event_of_its_own(tmp_path: Path) -> None:
    path = tmp_path / "study.db"
    filled(path).__exit__(None, None, None)
    with open_journal(path) as journal:
        assert journal.checkpoint()


def test_events_that_could_not_be_committed_are_forgotten(tmp_path: Path) -> None:
    path = tmp_path / "study.db"
    connection = connected(path)
    with Journal(connection, path) as journal:
        connection.execute("PRAGMA foreign_keys = ON")
        connection.execute("CREATE TABLE known (number INTEGER PRIMARY KEY)")
        connection.execute(
            "CREATE TABLE wrong (number REFERENCES known DEFERRABLE INITIALLY DEFERRED)"
        )
        connection.execute(
            "CREATE TRIGGER breaks AFTER INSERT ON event BEGIN INSERT INTO wrong VALUES (1); END"
        )
        with pytest.raises(JournalError, match="FOREIGN KEY constraint failed"), journal.alone():
            journal.append("P01/1", event(2))
        assert len(journal.events("P01/1")) == 2
        with pytest.raises(JournalError, match="P01/1 has no event 2"):
            journal.append("P01/1", event(3))


def test_the_journal_is_readable_only_by_its_owner(tmp_path: Path) -> None:
    with filled(tmp_path / "study.db"):
        files = list(tmp_path.glob("study.db*"))
        assert len(files) == 3, "the journal, its log and its index"
        assert all(file.stat().st_mode & 0o077 == 0 for file in files)


def test_a_journal_that_cannot_be_written_is_said_to_be_read_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "study.db"
    open_journal(path).__exit__(None, None, None)
    log_of(path).mkdir()  # SQLite can open no log, as in a folder that it cannot write
    with pytest.raises(JournalError, match=r"journal \(unable to open database file\)$"):
        open_journal(path)
    # Root may write in every folder but one of a read-only disk.
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(JournalError, match=r"journal \(it or its folder is read-only\)$"):
        open_journal(path)


def test_a_file_that_is_not_a_journal_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "study.db"
    path.write_text("scores, scores, scores" * 100)
    with pytest.raises(JournalError, match="cannot be opened as a journal"):
        open_journal(path)
    assert path.read_text().startswith("scores")


def test_a_journal_of_another_version_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "study.db"
    with closing(sqlite3.connect(path)) as other:
        other.execute("PRAGMA user_version = 99")
    with pytest.raises(JournalError, match="schema must be 2 or 3, got 99"):
        open_journal(path)


def test_a_journal_that_has_lost_its_version_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "study.db"
    with filled(path), closing(sqlite3.connect(path)) as other:
        other.execute("PRAGMA user_version = 0")
    for opened in (open_journal, read_journal):
        with pytest.raises(JournalError, match="damaged, or has tables that are not touchbeam's"):
            opened(path)


def test_two_processes_may_create_the_journal_at_once(tmp_path: Path) -> None:
    """Before each journal both wait until the other one is there too."""
    program = (
        "import sys; from pathlib import Path; from runner.journal.opening import open_journal\n"
        "for n in range(20):\n"
        "    print('ready', flush=True)\n"
        "    sys.stdin.readline()\n"
        "    open_journal(Path(sys.argv[1], f'{n}.db')).__exit__(None, None, None)"
    )
    both = [
        subprocess.Popen(
            [sys.executable, "-c", program, str(tmp_path)],
            text=True,
            bufsize=1,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        for _ in range(2)
    ]
    with both[0], both[1]:
        for _ in range(20):
            ready = [process.stdout and process.stdout.readline() for process in both]
            assert ready == ["ready\n"] * 2
            for process in both:
                assert process.stdin
                process.stdin.write("go\n")
        assert [process.communicate()[1] for process in both] == ["", ""]
    assert [process.returncode for process in both] == [0, 0]
    made = sorted(tmp_path.iterdir())
    assert {file.name for file in made} == {f"{number}.db" for number in range(20)}
    for file in made:
        with read_journal(file) as journal, closing(sqlite3.connect(file)) as other:
            assert journal.sessions() == []
            assert other.execute("PRAGMA user_version").fetchone() == (SCHEMA_VERSION,)


@pytest.mark.parametrize("what", ["deleted", "replaced", "log deleted", "moved with its folder"])
def test_a_deleted_moved_or_replaced_journal_is_an_error(tmp_path: Path, what: str) -> None:
    folder = tmp_path / "study"
    folder.mkdir()
    path = folder / "study.db"
    with filled(path) as journal:
        if what == "deleted":
            path.unlink()
        elif what == "log deleted":
            (folder / "study.db-wal").unlink()
        elif what == "replaced":
            path.rename(folder / "old.db")
            path.write_bytes((folder / "old.db").read_bytes())
        else:
            folder.rename(tmp_path / "elsewhere")
        with pytest.raises(JournalError, match=r"study\.db: the journal file .*replaced while in"):
            journal.append("P01/1", event(2))
        with pytest.raises(JournalError, match="restore both"):
            journal.checkpoint()
        if what == "moved with its folder":
            (tmp_path / "elsewhere").rename(folder)
            journal.append("P01/1", event(2))


@pytest.mark.parametrize(
    "payload",
    ['{"a": NaN}', '{"a": 1e999}', '{"a": "\\ud800"}', "[" * 30_000, '{"a": ' * 30_000, "[]", ""],
)
def test_a_damaged_payload_affects_only_its_session(tmp_path: Path, payload: str) -> None:
    path = tmp_path / "study.db"
    with filled(path) as journal:
        journal.checkpoint()
    with tampering(path) as other:
        other.execute("UPDATE event SET payload = ? WHERE session = 'P01/1' AND seq = 1", [payload])
    with open_journal(path) as journal:
        first, second = verdicts(journal)
    assert (first.participant, first.chain_ok) == ("P01", False)
    assert (second.participant, second.chain_ok) == ("P02", True)


def test_a_time_without_a_zone_is_utc(tmp_path: Path) -> None:
    path = tmp_path / "study.db"
    filled(path).__exit__(None, None, None)
    with tampering(path) as other:
        other.execute("UPDATE event SET utc = '2026-01-01T12:00:00' WHERE session = 'P01/1'")
    with open_journal(path) as journal:
        assert journal.events("P01/1")[0].utc == NOON
        assert [verdict.chain_ok for verdict in verdicts(journal)] == [True, True]


def test_a_missing_journal_whose_log_exists_is_not_replaced(tmp_path: Path) -> None:
    """SQLite would delete the log, and with it all events since the last checkpoint."""
    path, moved = tmp_path / "study.db", tmp_path / "moved.db"
    journal = filled(path)
    path.rename(moved)
    held = (tmp_path / "study.db-wal").read_bytes()
    with pytest.raises(JournalError, match=r"is missing, but its log study\.db-wal exists"):
        open_journal(path)
    assert (tmp_path / "study.db-wal").read_bytes() == held
    assert not path.exists()
    moved.rename(path)
    with journal, read_journal(path) as again:
        assert again.sessions() == ["P01/1", "P02/1"]


class FailedError(Exception):
    """What was to be done with the journal has failed."""


@contextmanager
def room_for(size: int) -> Iterator[None]:
    """Limit files to `size` bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("size", [0, 4096, 8192])
def test_a_journal_that_does_not_fit_on_the_disk_is_removed(tmp_path: Path, size: int) -> None:
    with (
        room_for(size),
        pytest.raises(JournalError, match="cannot be opened as a journal"),
        journal_if_used(tmp_path / "study.db"),
    ):
        pass
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("free", "why"), [(32_767, r"\(the disk is full\)"), (32_768, r"\(disk I/O error\)")]
)
def test_a_full_disk_is_told_as_such(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, free: int, why: str
) -> None:
    monkeypatch.setattr("runner.journal.opening.disk_usage", lambda _: SimpleNamespace(free=free))
    with room_for(4096), pytest.raises(JournalError, match=why):
        open_journal(tmp_path / "study.db")


def test_the_log_is_turned_on_at_the_tenth_attempt_or_sqlite_says_why_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refusals = 10 * [sqlite3.OperationalError("locking protocol")]

    class Refusing(sqlite3.Connection):
        def execute(self, statement: str, *given: Any) -> sqlite3.Cursor:
            if "journal_mode" in statement and refusals:
                raise refusals.pop()
            return super().execute(statement, *given)

    connect = sqlite3.connect
    monkeypatch.setattr(
        sqlite3, "connect", lambda *given, **more: connect(*given, **more, factory=Refusing)
    )
    with pytest.raises(JournalError, match=r"cannot be opened as a journal \(locking protocol\)"):
        open_journal(tmp_path / "study.db")
    refusals += 9 * [sqlite3.OperationalError("database is locked")]
    open_journal(tmp_path / "study.db").__exit__(None, None, None)
    assert refusals == []


@pytest.mark.parametrize(("size", "empty"), [(4096, True), (4097, False)])
def test_what_cannot_be_read_is_unused_if_it_has_no_room_for_a_table(
    tmp_path: Path, size: int, empty: bool
) -> None:
    path = tmp_path / "study.db"
    assert unused(path)
    path.write_bytes(size * b"x")
    assert unused(path) is empty


def test_an_unused_journal_is_removed(tmp_path: Path) -> None:
    path = tmp_path / "study.db"
    with pytest.raises(FailedError), journal_if_used(path):
        raise FailedError
    assert list(tmp_path.iterdir()) == []


def test_a_journal_with_events_or_an_existing_one_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "study.db"

    def fails_later() -> None:
        with journal_if_used(path) as journal:
            journal.append("P01/1", event(0))
            raise FailedError

    with pytest.raises(FailedError):
        fails_later()
    with read_journal(path) as journal:
        assert journal.sessions() == ["P01/1"]
    empty = tmp_path / "empty.db"
    open_journal(empty).__exit__(None, None, None)
    with pytest.raises(FailedError), journal_if_used(empty):
        raise FailedError
    assert empty.exists()


def test_a_journal_that_was_made_and_never_filled_is_read_as_empty(tmp_path: Path) -> None:
    """Its process was killed; what stands for its tables is closed like any other journal."""
    path = tmp_path / "study.db"
    path.touch()
    with read_journal(path) as journal:
        assert journal.sessions() == []
    with pytest.raises(JournalError, match="closed database"):
        journal.sessions()
    assert list(tmp_path.iterdir()) == [path]


def test_appending_to_a_journal_that_was_removed_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "study.db"
    others: list[Journal] = []

    def opened_by_two() -> None:
        with journal_if_used(path):
            others.append(open_journal(path))
            raise FailedError

    with pytest.raises(FailedError):
        opened_by_two()
    (other,) = others
    with other, pytest.raises(JournalError, match="deleted, moved or replaced while in use"):
        other.append("P01/1", event(0))


def test_a_first_event_counts_only_if_the_file_still_exists_afterwards(tmp_path: Path) -> None:
    """Another process may remove an unused journal between the check and the write."""
    path = tmp_path / "study.db"

    class DeletedMeanwhile(sqlite3.Connection):
        def execute(self, sql: str, *parameters: Any) -> sqlite3.Cursor:
            if sql.startswith("INSERT"):
                path.unlink()
            return super().execute(sql, *parameters)

    with (
        Journal(connected(path, DeletedMeanwhile), path) as journal,
        pytest.raises(JournalError, match="deleted, moved or replaced while in use"),
    ):
        journal.append("P03/1", event(0))


@pytest.mark.parametrize("opened", [open_journal, read_journal])
@pytest.mark.parametrize("error", [KeyboardInterrupt("stopped"), sqlite3.DatabaseError("disk")])
def test_a_journal_that_could_not_be_opened_leaves_no_connection(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    opened: Callable[[Path], Journal],
    error: BaseException,
) -> None:
    with open_journal(tmp_path / "study.db"):
        pass
    closed: list[bool] = []

    class Interrupted(sqlite3.Connection):
        def execute(self, statement: str, *_: object) -> sqlite3.Cursor:
            raise error

        def close(self) -> None:
            closed.append(True)
            super().close()

    connect = sqlite3.connect
    monkeypatch.setattr(
        sqlite3, "connect", lambda *given, **more: connect(*given, **more, factory=Interrupted)
    )
    with pytest.raises((KeyboardInterrupt, JournalError), match=r"stopped|disk"):
        opened(tmp_path / "study.db")
    assert closed == [True]


@pytest.mark.parametrize("opened", [open_journal, read_journal])
def test_a_journal_is_not_opened_without_the_log_that_a_killed_process_left_aside(
    tmp_path: Path, opened: Callable[[Path], Journal]
) -> None:
    path, log = tmp_path / "study.db", tmp_path / "study.db-wal"
    aside = tmp_path / "study.db-wal-aside"
    with filled(path) as journal:
        events = journal.events("P01/1")
        shutil.copy(log, aside)
    with pytest.raises(JournalError, match=r"wal-aside, .* killed .*; rename it to study.db-wal$"):
        opened(path)
    aside.rename(log)
    with opened(path) as again:
        assert again.events("P01/1") == events


def test_a_damaged_payload_is_not_shown(tmp_path: Path) -> None:
    path = tmp_path / "study.db"
    filled(path).__exit__(None, None, None)
    with tampering(path) as other:
        other.execute("UPDATE event SET payload = CAST(x'736563726574ff' AS TEXT)")
    with read_journal(path) as journal, pytest.raises(JournalError) as refused:
        journal.events("P01/1")
    assert "Could not decode" in str(refused.value)
    assert "secret" not in str(refused.value)
