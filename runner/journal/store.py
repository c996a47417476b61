"""The journal: a study's events in one SQLite file, appended one by one and chained by hashes.

`runner.journal.chain` defines the stored form of an event, `runner.journal.database` how the file
is opened, compared and checkpointed; docs/journal.md describes the file.
"""

import os
import secrets
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from protocol.errors import WorkFailed
from protocol.journal.events import Event, StoredEvent
from runner.journal.chain import (
    FIRST_HASH,
    NO_SALT,
    SALT_BYTES,
    ChainLink,
    DamagedError,
    chain_hash,
    chain_link,
    event_fields,
    payload_digest,
    payload_text,
    stored_event,
)
from runner.journal.database import (
    SQLITE_ERRORS,
    LogNotCopiedError,
    checked_version,
    close_keeping_log,
    closed_on_error,
    connected,
    copied_log,
    copy_database,
    is_writable,
    leave,
    log_aside,
    log_of,
    transaction,
)
from runner.signals import raise_if_stopped

SCHEMA_VERSION = 3
UNSALTED_VERSION = 2
"""Journals of this schema have no salts; they are read and continued as they are."""

LOCK_WAIT_S = 2.0
_READER_PATIENCE_S = 0.1
"""How long a reader waits to merge a log that a killed process has left, s."""
_ONE_PAGE = 4096
"""Size of a database without tables, bytes."""

_SCHEMA = (
    """CREATE TABLE event (
        session TEXT NOT NULL,
        seq INTEGER NOT NULL,
        tag TEXT NOT NULL,
        utc TEXT NOT NULL,
        monotonic_s REAL NOT NULL,
        payload_sha256 TEXT NOT NULL,
        hash TEXT NOT NULL,
        salt BLOB,
        payload TEXT,
        PRIMARY KEY (session, seq)
    ) STRICT""",
    """CREATE TRIGGER event_is_erased_at_most BEFORE UPDATE ON event
        WHEN NEW.payload IS NOT NULL OR NEW.salt IS NOT NULL
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


_SCHEMAS = {
    UNSALTED_VERSION: [
        statement.replace("        salt BLOB,\n", "").replace(" OR NEW.salt IS NOT NULL", "")
        for statement in _SCHEMA
    ],
    SCHEMA_VERSION: _SCHEMA,
}

_EVENT = "SELECT seq, tag, utc, monotonic_s, payload"
_SESSIONS = "SELECT session FROM event GROUP BY session ORDER BY min(rowid)"
_TAGGED = f"{_EVENT} FROM event WHERE tag"


class _Statements(NamedTuple):
    """The SQL in which the schemas differ."""

    append: str
    erase: str
    chain: str


_SALTED = _Statements(
    "INSERT INTO event VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
    "UPDATE event SET payload = NULL, salt = NULL WHERE session = ?",
    f"{_EVENT}, payload_sha256, hash, salt FROM event WHERE session = ? ORDER BY seq",
)
_UNSALTED = _Statements(
    "INSERT INTO event VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
    "UPDATE event SET payload = NULL WHERE session = ?",
    f"{_EVENT}, payload_sha256, hash, x'' FROM event WHERE session = ? ORDER BY seq",
)

RandomBytes = Callable[[int], bytes]
"""Returns that number of random bytes."""


class JournalError(WorkFailed):
    """The journal cannot be read or written; no acknowledged event is lost."""


class Journal:
    """The events of all sessions of one study.

    `salted` is false for schema 2, whose erased payloads can be guessed from their digests.
    """

    def __init__(
        self,
        connection: sqlite3.Connection,
        path: Path,
        *,
        salted: bool = True,
        random_bytes: RandomBytes = secrets.token_bytes,
        lacking_triggers: Sequence[str] = (),
        patience_s: float = LOCK_WAIT_S,
    ) -> None:
        self.salted = salted
        self.lacking_triggers = tuple(lacking_triggers)
        self._sql = _SALTED if salted else _UNSALTED
        self._random_bytes = random_bytes
        self._connection = connection
        self._path = path
        self._patience_s = patience_s
        self._places = (str(path), str(log_of(path)))
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
        # An error of the body takes precedence; the log keeps every event.
        hidden = nullcontext() if error is None else suppress(JournalError)
        with hidden, self._errors_explained("written"):
            leave(self._connection, self._path, self._patience_s)

    def sessions(self) -> list[str]:
        """Return the names of all chains, oldest first."""
        with self._errors_explained("read"):
            names = [name for (name,) in self._connection.execute(_SESSIONS)]
            if not all(isinstance(name, str) for name in names):
                raise DamagedError("the name of a session is damaged")
            return names

    def events(self, session: str) -> list[StoredEvent]:
        """Return the events of `session` in order."""
        return [link.event for link in self.chain(session)]

    def events_of(self, *kinds: type[Event]) -> list[StoredEvent]:
        """Return the events of these kinds in all sessions, in the order of writing."""
        tags = [kind.TAG for kind in kinds]
        names = ", ".join("?" * len(tags))
        with self._errors_explained("read"):
            rows = self._connection.execute(f"{_TAGGED} IN ({names}) ORDER BY rowid", tags)
            return [stored_event(row) for row in rows]

    def chain(self, session: str) -> Iterator[ChainLink]:
        """Yield the events of `session` with their hashes."""
        with self._errors_explained("read"):
            for row in self._connection.execute(self._sql.chain, (session,)):
                yield chain_link(row)

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Exclude other writers while the body reads and then appends, all or nothing."""
        try:
            with self._errors_explained("written"), self._connection:
                self._connection.execute("BEGIN IMMEDIATE")  # takes the write lock before reading
                yield
        except BaseException:
            self._last_hashes.clear()  # of events that were rolled back
            raise

    def append(self, session: str, event: StoredEvent) -> None:
        """Add `event` to the chain of `session`; it is on the disk when this returns.

        Raises:
            JournalError: the event could not be written; the chain is unchanged.
        """
        self._require_in_place()
        body = payload_text(event)
        salt = self._random_bytes(SALT_BYTES) if self.salted else NO_SALT
        fields = event_fields(session, event, payload_digest(body, salt))
        with self._errors_explained("written"):
            chained = chain_hash(self._hash_before(session, event.seq), fields)
            stored = (salt, body) if self.salted else (body,)
            self._connection.execute(self._sql.append, (*fields, chained, *stored))
        if event.seq == 0:  # another process may have removed an unused journal: journal_if_used
            self._require_in_place()
        self._last_hashes = {(session, event.seq): chained}

    def erase_payloads(self, sessions: Iterable[str]) -> None:
        """Erase payloads and salts of `sessions`; `forget_erased` must follow to clear the disk."""
        with self._errors_explained("written"):
            self._connection.executemany(self._sql.erase, [(name,) for name in sessions])

    def forget_erased(self) -> None:
        """Remove all copies of erased payloads from the disk.

        Raises:
            JournalError: it failed; an old copy may remain.
        """
        with self._errors_explained("written"):
            self._connection.execute("VACUUM")  # free pages still hold erased payloads
        if not (self.checkpoint() and self._emptied_log()):  # and so does the write-ahead log
            raise JournalError(
                f"{self._path}: erased, but an old copy remains while another program reads it; "
                "end that program and repeat the command"
            )

    def checkpoint(self) -> bool:
        """Copy the write-ahead log into the main file; the next event starts the log anew.

        Returns:
            False if a reader or another process prevents it; the log then goes on growing.

        Raises:
            JournalError: it failed, or the main file alone lacks events afterwards.
        """
        self._require_in_place()
        last = [(session, chained) for (session, _), chained in self._last_hashes.items()]
        with self._errors_explained("written"):
            return copied_log(self._connection, self._path, last[0] if last else None)

    def copy_to(self, new: Path) -> None:
        """Copy the journal as it is now into the empty file `new`.

        Raises:
            JournalError: it cannot be copied.
        """
        with self._errors_explained("copied"):
            copy_database(self._connection, new)

    def _emptied_log(self) -> bool:
        with self._errors_explained("written"):
            busy, _, _ = self._connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
            return not busy

    def _require_in_place(self) -> None:
        """Require that the open files are still the ones at their paths.

        SQLite does not notice a change, and would write to files that have lost their names.
        """
        if _files_at(self._places) != self._files:
            raise JournalError(
                f"{self._path}: the journal file or its log {log_of(self._path).name} was "
                "deleted, moved or replaced while in use; restore both before you continue"
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
    def _errors_explained(self, what: str) -> Iterator[None]:
        try:
            yield
        except (*SQLITE_ERRORS, DamagedError, LogNotCopiedError) as error:
            raise_if_stopped()  # SQLite takes the exception of a signal for its own interruption
            raise JournalError(f"{self._path}: cannot be {what} ({error})") from error


def _files_at(places: Iterable[str]) -> list[tuple[int, int]]:
    """Return the device and inode numbers of the files that exist at `places`.

    The log counts too: until a checkpoint, part of the events are only in the log.
    """
    files = []
    for place in places:
        with suppress(OSError):
            found = os.stat(place)  # noqa: PTH116 - Path.stat takes twice as long
            files.append((found.st_dev, found.st_ino))
    return files


@contextmanager
def journal_if_used(path: Path) -> Iterator[Journal]:
    """Yield the journal at `path`; create it if missing, remove it again if nothing was written.

    Another process that has opened it in between gets an error when it appends.

    Raises:
        JournalError: the journal cannot be opened.
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
    """Return whether the journal at `path` is missing or has no events.

    If it cannot be read, for example because the disk is full, its size decides.
    """
    if not path.exists():
        return True
    try:
        with read_journal(path) as journal:
            return not journal.sessions()
    except JournalError:
        log = log_of(path)
        logged = log.stat().st_size if log.exists() else 0
        return logged == 0 and path.stat().st_size <= _ONE_PAGE


def read_journal(path: Path, *, to_verify: bool = False) -> Journal:
    """Return the journal at `path` opened read-only; the file need not be writable.

    With `to_verify`, missing triggers are no error: `lacking_triggers` of the journal names them.

    Raises:
        JournalError: it cannot be read, or its schema is not touchbeam's.
    """
    lacking: list[str] = []
    with _opening(path, "read", _access(path)) as connection:
        connection.execute("PRAGMA query_only = ON")
        with transaction(connection):
            version = checked_version(connection, _SCHEMAS, lacking if to_verify else None)
        if version > 0:
            return Journal(
                connection,
                path,
                salted=version != UNSALTED_VERSION,
                lacking_triggers=lacking,
                patience_s=_READER_PATIENCE_S,
            )
        connection.close()  # made and never filled: its process was killed
        empty = sqlite3.connect(":memory:")
        with closed_on_error(empty):
            for statement in _SCHEMA:
                empty.execute(statement)
        return Journal(empty, path)


def _access(path: Path) -> str:
    """Return SQLite's URI parameter for reading the journal, whose folder may be read-only.

    In a writable folder SQLite opens it read-write, so that it can remove its log afterwards.
    """
    if is_writable(path):
        return "mode=rw"
    return "mode=ro" if log_of(path).exists() else "immutable=1"


@contextmanager
def _opening(
    path: Path, what: str, access: str = "mode=rw", *, create: bool = False
) -> Iterator[sqlite3.Connection]:
    """Yield a connection to the journal at `path`, closed again only if the body fails.

    Raises:
        JournalError: the body has raised an error of SQLite or of the system, or the log is aside.
    """
    if (aside := log_aside(path)).exists():  # opened without its log, the journal would lack events
        raise JournalError(
            f"{path}: its log is {aside.name}, because a process was killed while it closed the "
            f"journal; rename it to {log_of(path).name}"
        )
    try:
        if create:  # SQLite itself would make a file that others may read, as the umask has it
            with suppress(FileExistsError):
                os.close(os.open(path, os.O_CREAT | os.O_EXCL, 0o600))
        connection = connected(path, access, LOCK_WAIT_S)
        try:
            yield connection
        except BaseException:
            close_keeping_log(connection, path)
            raise
    except (OSError, *SQLITE_ERRORS) as error:
        raise_if_stopped()
        raise JournalError(f"{path}: cannot be {what} as a journal ({error})") from error


def open_journal(path: Path, random_bytes: RandomBytes = secrets.token_bytes) -> Journal:
    """Return the journal at `path` opened for writing; create it if missing.

    Events go to the write-ahead log. Only `Journal.checkpoint` and the close copy them into the
    main file, so that a copy of it is consistent at any moment.

    Args:
        path: the file.
        random_bytes: the source of the salts, which must be unpredictable.

    Raises:
        JournalError: it cannot be opened, or its schema is not touchbeam's; it is unchanged.
    """
    if log_of(path).exists() and not path.exists():
        raise JournalError(
            f"{path}: is missing, but its log {log_of(path).name} exists and holds the latest "
            "events; restore the journal beside it"
        )
    with _opening(path, "opened", create=True) as connection:
        with transaction(connection):
            checked_version(connection, _SCHEMAS)
        _log_ahead(connection)
        # In this order: a stored event outlasts a power cut; what a participant takes back is
        # overwritten; only `checkpoint` and the close move events into the file.
        for setting in ("synchronous = FULL", "secure_delete = ON", "wal_autocheckpoint = 0"):
            connection.execute(f"PRAGMA {setting}")
        version = _ensured_schema(connection)
        return Journal(
            connection, path, salted=version != UNSALTED_VERSION, random_bytes=random_bytes
        )


def _log_ahead(connection: sqlite3.Connection) -> None:
    """Turn the write-ahead log on.

    If two processes do so at once, SQLite refuses one of them without waiting for its timeout. It
    does wait for BEGIN, which therefore comes before the next attempt.
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


def _ensured_schema(connection: sqlite3.Connection) -> int:
    """Create the tables unless they exist; return the version of the schema."""
    with transaction(connection, "IMMEDIATE"):  # another process may be creating them too
        version = checked_version(connection, _SCHEMAS)
        if version == 0:
            for statement in _SCHEMA:
                connection.execute(statement)
            connection.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
    return version or SCHEMA_VERSION


def session_name(participant: str, number: int) -> str:
    """Return the name of a session in the journal."""
    return f"{participant}/{number}"
