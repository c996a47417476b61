"""The journal: a study's events in one SQLite file, appended one by one and chained by hashes.

The one module that imports sqlite3; `runner.journal.chain` says how an event is stored.
docs/journal.md describes the file.
"""

import hashlib
import os
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from protocol.errors import WorkFailed
from protocol.journal.events import Event, StoredEvent
from runner.journal.chain import (
    FIRST_HASH,
    ChainLink,
    DamagedError,
    chain_hash,
    event_fields,
    payload_text,
    stored_event,
)

SCHEMA_VERSION = 2
LOCK_WAIT_S = 2.0
_ONE_PAGE = 4096
"""Without a table in it."""

_SCHEMA = (
    """CREATE TABLE event (
        session TEXT NOT NULL,
        seq INTEGER NOT NULL,
        tag TEXT NOT NULL,
        utc TEXT NOT NULL,
        monotonic_s REAL NOT NULL,
        payload_sha256 TEXT NOT NULL,
        hash TEXT NOT NULL,
        payload TEXT,
        PRIMARY KEY (session, seq)
    ) STRICT""",
    """CREATE TRIGGER event_is_erased_at_most BEFORE UPDATE ON event
        WHEN NEW.payload IS NOT NULL
        OR (NEW.rowid, NEW.session, NEW.seq, NEW.tag, NEW.utc, NEW.monotonic_s,
            NEW.payload_sha256, NEW.hash)
        IS NOT (OLD.rowid, OLD.session, OLD.seq, OLD.tag, OLD.utc, OLD.monotonic_s,
            OLD.payload_sha256, OLD.hash)
        BEGIN SELECT RAISE(ABORT, 'the journal is append-only'); END""",
    """CREATE TRIGGER event_is_not_replaced BEFORE INSERT ON event
        WHEN EXISTS (SELECT 1 FROM event WHERE session = NEW.session AND seq = NEW.seq)
        BEGIN SELECT RAISE(ABORT, 'the journal is append-only'); END""",
    """CREATE TRIGGER event_is_not_deleted BEFORE DELETE ON event
        BEGIN SELECT RAISE(ABORT, 'the journal is append-only'); END""",
)

_APPEND = "INSERT INTO event VALUES (?, ?, ?, ?, ?, ?, ?, ?)"
_EVENT = "SELECT seq, tag, utc, monotonic_s, payload"
_CHAIN = f"{_EVENT}, payload_sha256, hash FROM event WHERE session = ? ORDER BY seq"
_SESSIONS = "SELECT session FROM event GROUP BY session ORDER BY min(rowid)"
_TAGGED = f"{_EVENT} FROM event WHERE tag"


class JournalError(WorkFailed):
    """The journal cannot be read or written; nothing that was acknowledged is lost."""


class Journal:
    """The events of all sessions of one study."""

    def __init__(self, connection: sqlite3.Connection, path: Path) -> None:
        self._connection = connection
        self._path = path
        self._places = (str(path), str(_log_of(path)))
        self._files = _files_at(self._places)
        self._last_hashes: dict[tuple[str, int], str] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._connection.close()

    def sessions(self) -> list[str]:
        """Return the names of all chains in the order in which they were begun."""
        with self._explained("read"):
            rows = self._connection.execute(_SESSIONS)
            return [row[0] for row in rows]

    def events(self, session: str) -> list[StoredEvent]:
        """Return the events of `session` in their order."""
        return [link.event for link in self.chain(session)]

    def events_of(self, *kinds: type[Event]) -> list[StoredEvent]:
        """Return the events of these kinds, of all sessions, in the order of writing."""
        tags = [kind.TAG for kind in kinds]
        names = ", ".join("?" * len(tags))
        with self._explained("read"):
            rows = self._connection.execute(f"{_TAGGED} IN ({names}) ORDER BY rowid", tags)
            return [stored_event(row) for row in rows]

    def chain(self, session: str) -> Iterator[ChainLink]:
        """Yield the events of `session` with what ties them together."""
        with self._explained("read"):
            for row in self._connection.execute(_CHAIN, (session,)):
                yield ChainLink(stored_event(row[:5]), *row[4:])

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Keep other writers out while the body looks and then appends."""
        try:
            with self._explained("written"), self._connection:
                self._connection.execute("BEGIN IMMEDIATE")
                yield
        except BaseException:
            self._last_hashes.clear()  # nothing of it was written
            raise

    def append(self, session: str, event: StoredEvent) -> None:
        """Add `event` to the chain of `session`; it is on the disk when this returns.

        Raises:
            JournalError: it could not be written; nothing of it was.
        """
        self._require_in_place()
        body = payload_text(event)
        fields = event_fields(session, event, hashlib.sha256(body.encode()).hexdigest())
        with self._explained("written"):
            chained = chain_hash(self._hash_before(session, event.seq), fields)
            self._connection.execute(_APPEND, (*fields, chained, body))
        if event.seq == 0:  # an unused journal may be taken away: see journal_if_used
            self._require_in_place()
        self._last_hashes = {(session, event.seq): chained}

    def erase_payloads(self, sessions: Iterable[str]) -> None:
        """Erase what stands in the payloads of `sessions`; `forget_erased` makes it final."""
        with self._explained("written"):
            self._connection.executemany(
                "UPDATE event SET payload = NULL WHERE session = ?", [(name,) for name in sessions]
            )

    def forget_erased(self) -> None:
        """Leave nothing on the disk of what was erased.

        Raises:
            JournalError: it could not be done; an old copy may still be there.
        """
        with self._explained("written"):
            self._connection.execute("VACUUM")
        if not self.checkpoint():
            raise JournalError(
                f"{self._path}: erased, but another program that reads it keeps an old copy alive; "
                "end that program and do it again"
            )

    def checkpoint(self) -> bool:
        """Bring everything into the one file; return False if a reader is in the way."""
        self._require_in_place()
        with self._explained("written"):
            busy, _, _ = self._connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
            return not busy

    def _require_in_place(self) -> None:
        """Nothing is kept that is written to a file that is deleted, moved or replaced."""
        if _files_at(self._places) != self._files:
            raise JournalError(
                f"{self._path}: is not the journal any more that was opened there, or its log "
                f"{_log_of(self._path).name} is not (deleted, moved or replaced by another); put "
                "both back before anything else"
            )

    def _hash_before(self, session: str, seq: int) -> str:
        if seq == 0:
            return FIRST_HASH
        if (session, seq - 1) in self._last_hashes:  # events never change
            return self._last_hashes[session, seq - 1]
        row = self._connection.execute(
            "SELECT hash FROM event WHERE session = ? AND seq = ?", (session, seq - 1)
        ).fetchone()
        if row is None:
            raise JournalError(f"{self._path}: session {session} has no event {seq - 1}")
        return str(row[0])

    @contextmanager
    def _explained(self, what: str) -> Iterator[None]:
        try:
            yield
        except (sqlite3.Error, DamagedError) as error:
            raise JournalError(f"{self._path}: cannot be {what} ({error})") from error


def _log_of(path: Path) -> Path:
    return path.with_name(f"{path.name}-wal")


def _files_at(places: Iterable[str]) -> list[tuple[int, int]]:
    """What tells the journal and its log from other files: until a session ends, all is in both."""
    files = []
    for place in places:
        with suppress(OSError):
            found = os.stat(place)  # noqa: PTH116 - a path would take as long again
            files.append((found.st_dev, found.st_ino))
    return files


@contextmanager
def journal_if_used(path: Path) -> Iterator[Journal]:
    """Yield the journal at `path`, made if it is missing; one made for nothing does not stay.

    Whoever has opened it meanwhile is told so at the next event.

    Raises:
        JournalError: it cannot be opened.
    """
    before = path.exists()
    try:
        with open_journal(path) as journal:
            yield journal
    except BaseException:
        if not before and path.exists() and unused(path):
            for name in (f"{path.name}-wal", f"{path.name}-shm", path.name):
                path.with_name(name).unlink(missing_ok=True)
        raise


def unused(path: Path) -> bool:
    """Return whether nothing was ever written to the journal at `path`, if there is one.

    A full disk may keep it from being read: then its size tells.
    """
    if not path.exists():
        return True
    try:
        with read_journal(path) as journal:
            return not journal.sessions()
    except JournalError:
        log = _log_of(path)
        logged = log.stat().st_size if log.exists() else 0
        return logged == 0 and path.stat().st_size <= _ONE_PAGE


def read_journal(path: Path) -> Journal:
    """Return the journal at `path` for reading only; it need not be writable.

    Raises:
        JournalError: it cannot be read, or another version of touchbeam made it.
    """
    try:
        connection = sqlite3.connect(f"{path.absolute().as_uri()}?{_access(path)}", uri=True)
        connection.execute("PRAGMA query_only = ON")
        try:
            version = connection.execute("PRAGMA user_version").fetchone()[0]
            if version not in {0, SCHEMA_VERSION}:
                raise sqlite3.DatabaseError(_other_schema(version))
            if version == 0:  # made and never filled: its process was killed
                _require_empty(connection)
                connection.close()
                connection = sqlite3.connect(":memory:")
                for statement in _SCHEMA:
                    connection.execute(statement)
        except sqlite3.Error:
            connection.close()
            raise
    except sqlite3.Error as error:
        raise JournalError(f"{path}: cannot be read as a journal ({error})") from error
    return Journal(connection, path)


def _access(path: Path) -> str:
    """How to open a journal that is only read: its folder may not be writable at all.

    Where it is, SQLite tidies up its log behind us.
    """
    if os.access(path, os.W_OK) and os.access(path.parent, os.W_OK):
        return "mode=rw"
    return "mode=ro" if _log_of(path).exists() else "immutable=1"


def _other_schema(version: int) -> str:
    return (
        f"schema {version}; this touchbeam knows {SCHEMA_VERSION}; "
        "use the touchbeam that made the journal"
    )


def open_journal(path: Path) -> Journal:
    """Return the journal at `path`, made if it is missing, ready to be written.

    It grows in its write-ahead log and is checkpointed at the end of a session, so that a copy of
    the file is consistent at any moment.

    Raises:
        JournalError: it cannot be opened, or another version of touchbeam made it.
    """
    if _log_of(path).exists() and not path.exists():
        raise JournalError(
            f"{path}: is missing, and its log {_log_of(path).name} is there, which holds what was "
            "recorded last; put the journal back beside it"
        )
    try:
        # SQLite itself would make a file that others may read, as the umask has it.
        os.close(os.open(path, os.O_CREAT | os.O_RDWR, 0o600))
        # Without an isolation level Python begins no transactions: each event is its own.
        connection = sqlite3.connect(path, timeout=LOCK_WAIT_S, isolation_level=None)
    except (OSError, sqlite3.Error) as error:
        raise JournalError(f"{path}: cannot be opened as a journal ({error})") from error
    try:
        _log_ahead(connection)
        # In this order: a stored event outlasts a power cut; what a participant takes back is
        # overwritten; only `checkpoint` moves events into the file.
        for setting in ("synchronous = FULL", "secure_delete = ON", "wal_autocheckpoint = 0"):
            connection.execute(f"PRAGMA {setting}")
        _ensure_schema(connection)
    except sqlite3.Error as error:
        connection.close()
        raise JournalError(f"{path}: cannot be opened as a journal ({error})") from error
    return Journal(connection, path)


def _log_ahead(connection: sqlite3.Connection) -> None:
    """Turn the write-ahead log on.

    Of two processes that do so at once SQLite refuses one without waiting; it does wait to begin.
    """
    for _ in range(10):
        try:
            connection.execute("PRAGMA journal_mode = WAL")
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode != sqlite3.SQLITE_BUSY:
                raise
            connection.execute("BEGIN IMMEDIATE")
            connection.execute("ROLLBACK")
        else:
            return
    raise sqlite3.OperationalError("database is locked")


def _require_empty(connection: sqlite3.Connection) -> None:
    if connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
        raise sqlite3.DatabaseError("it has tables that no touchbeam has made, or is damaged")


def _ensure_schema(connection: sqlite3.Connection) -> None:
    """Make the tables unless they are there; another process may be making them just now."""
    with connection:
        connection.execute("BEGIN IMMEDIATE")
        version = connection.execute("PRAGMA user_version").fetchone()[0]
        if version == 0:
            _require_empty(connection)
            for statement in _SCHEMA:
                connection.execute(statement)
            connection.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
        elif version != SCHEMA_VERSION:
            raise sqlite3.DatabaseError(_other_schema(version))


def session_name(participant: str, number: int) -> str:
    """Return what a session is called in the journal."""
    return f"{participant}/{number}"
