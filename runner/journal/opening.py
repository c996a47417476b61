"""Opening a journal: made if it is missing, read without writing, refused if it is another's.

The tables and triggers are here; `runner.journal.store` appends and reads events.
"""

import os
import secrets
import sqlite3
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path, PurePath
from shutil import disk_usage

from protocol.errors import BadInput
from runner.journal import database
from runner.journal.store import LOCK_WAIT_S, Journal, JournalError, RandomBytes
from runner.signals import raise_if_stopped

SCHEMA_VERSION = 3
UNSALTED_VERSION = 2
"""Journals of this schema have no salts; they are read and continued as they are."""

_READER_PATIENCE_S = 0.1
"""How long a reader waits to merge a log that a killed process has left, s."""
_INDEX_BYTES = 32_768
"""Least size of the index of a log, which SQLite writes before anything else."""
_ONE_PAGE = 4096
"""Size of a database without tables, bytes."""

Connect = Callable[[], sqlite3.Connection]

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


@contextmanager
def journal_if_used(path: Path) -> Iterator[Journal]:
    """Yield the journal at `path`, made if it is missing and removed again if it stays unused."""
    before = path.exists()
    try:
        with open_journal(path) as journal:
            yield journal
    except BaseException:
        # A session that was refused before its first event leaves no empty journal.
        if not before and path.exists() and unused(path):
            for name in (f"{path.name}-wal", f"{path.name}-shm", path.name):
                path.with_name(name).unlink(missing_ok=True)
        raise


def unused(path: Path) -> bool:
    """Return whether a journal is missing or has no events, by its size if it cannot be read."""
    if not path.exists():
        return True
    try:
        with read_journal(path) as journal:
            return not journal.sessions()
    except JournalError:
        log = database.log_of(path)
        logged = log.stat().st_size if log.exists() else 0
        return logged == 0 and path.stat().st_size <= _ONE_PAGE


def read_journal(path: Path, *, to_verify: bool = False) -> Journal:
    """Return the journal at `path` opened read-only; the file need not be writable.

    Where SQLite cannot even write its index, on a full disk for example, a copy is read.
    With `to_verify`, missing triggers are no error: `lacking_triggers` of the journal names them.
    Raises `JournalError` if it cannot be read, or if its schema is not touchbeam's.
    """
    try:
        return _read(
            path, lambda: database.connected(path, _access(path), LOCK_WAIT_S), to_verify=to_verify
        )
    except JournalError as error:
        if not database.lacks_writing(error.__cause__):
            raise
    return _read(path, lambda: database.connected_to_copy(path), to_verify=to_verify, is_copy=True)


def _read(path: Path, connect: Connect, *, to_verify: bool, is_copy: bool = False) -> Journal:
    lacking: list[str] = []
    with _opening(path, "read", connect) as connection:
        # The file is opened for writing where possible, so that its log can be removed; this
        # connection itself must change nothing.
        connection.execute("PRAGMA query_only = ON")
        with database.transaction(connection):
            version = database.checked_version(connection, _SCHEMAS, lacking if to_verify else None)
        if version > 0:
            return Journal(
                connection,
                path,
                salted=version != UNSALTED_VERSION,
                lacking_triggers=lacking,
                patience_s=_READER_PATIENCE_S,
                is_copy=is_copy,
            )
        connection.close()  # made and never filled: its process was killed
        empty = sqlite3.connect(":memory:")
        with database.closed_on_error(empty):
            for statement in _SCHEMA:
                empty.execute(statement)
        return Journal(empty, path, is_copy=True)


def _access(path: Path) -> str:
    """Return SQLite's URI parameter for reading: in a writable folder it must remove its log."""
    if database.is_writable(path):
        return "mode=rw"
    # Without a log no session runs, and SQLite needs no files beside it, which it cannot make.
    return "mode=ro" if database.log_of(path).exists() else "immutable=1"


@contextmanager
def _opening(
    path: Path, what: str, connect: Connect, *, create: bool = False
) -> Iterator[sqlite3.Connection]:
    """Yield what `connect` returns, closed only if the body fails; errors become `JournalError`."""
    # Opened without its log, the journal would lack events.
    if (aside := database.log_aside(path)).exists():
        raise JournalError(
            f"{path}: its log is {aside.name}, because a process was killed while it closed the "
            f"journal; rename it to {database.log_of(path).name}"
        )
    try:
        if create:  # SQLite itself would make a file that others may read, as the umask has it
            with suppress(FileExistsError):
                os.close(os.open(path, os.O_CREAT | os.O_EXCL, 0o600))
        connection = connect()
        try:
            yield connection
        except BaseException:
            database.close_keeping_log(connection, path)
            raise
    except (OSError, *database.SQLITE_ERRORS) as error:
        # SQLite reports a signal as its own interruption.
        raise_if_stopped()
        # Of a full disk SQLite says "disk I/O error", too.
        failed = getattr(error, "sqlite_errorcode", 0) & 0xFF == sqlite3.SQLITE_IOERR
        full = failed and path.exists() and disk_usage(path).free < _INDEX_BYTES
        barred = database.lacks_writing(error) and path.exists() and not database.is_writable(path)
        if full:
            why: object = "the disk is full"
        elif barred and what == "opened":
            why = "it or its folder is read-only"
        else:
            why = getattr(error, "strerror", None) or error
        told = f"{path}: cannot be {what} as a journal ({why}){database.way_out(error)}"
        raise JournalError(told) from error


def open_journal(path: Path, random_bytes: RandomBytes = secrets.token_bytes) -> Journal:
    """Return the journal at `path` opened for writing; create it if missing.

    Only `Journal.checkpoint` and the close copy events from the write-ahead log into the main file,
    so that a copy of it is consistent at any moment. `random_bytes` gives the salts, which must be
    unpredictable. Raise `JournalError` if it cannot be opened, or its schema is not touchbeam's.
    """
    # A new journal would make SQLite delete this log.
    if (log := database.log_of(path)).exists() and not path.exists():
        raise JournalError(
            f"{path}: is missing, but its log {log.name} exists and holds the latest events; "
            "restore the journal beside it"
        )
    with _opening(
        path, "opened", lambda: database.connected(path, timeout_s=LOCK_WAIT_S), create=True
    ) as connection:
        with database.transaction(connection):
            database.checked_version(connection, _SCHEMAS)
        # Only now that the schema was checked: this writes, and a stranger's file is left as it is.
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
    for left in reversed(range(10)):
        try:
            connection.execute("PRAGMA journal_mode = WAL")
        except sqlite3.OperationalError:
            if not left:
                raise
            connection.execute("BEGIN IMMEDIATE")
            connection.execute("ROLLBACK")
        else:
            return


def _ensured_schema(connection: sqlite3.Connection) -> int:
    """Create the tables unless they exist; return the version of the schema."""
    with database.transaction(connection, "IMMEDIATE"):  # another process may be creating them too
        version = database.checked_version(connection, _SCHEMAS)
        if version == 0:
            for statement in _SCHEMA:
                connection.execute(statement)
            connection.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
    return version or SCHEMA_VERSION


NETWORK_TYPES = {
    "9p", "afs", "ceph", "cifs", "davfs", "fuse.gvfsd-fuse", "fuse.rclone", "fuse.sshfs",
    "glusterfs", "ncpfs", "nfs", "nfs4", "smb3", "smbfs",
}  # fmt: skip
CLOUD_FOLDERS = (
    "box sync", "dropbox", "google drive", "googledrive", "icloud drive", "mobile documents",
    "my drive", "nextcloud", "onedrive", "owncloud", "seafile",
)  # fmt: skip

Mount = tuple[str, str]
"""A mount point and the type of its file system."""


def checked_place(folder: Path, mounts: Iterable[Mount]) -> Path:
    """Return the absolute path of `folder`; raises `BadInput` on a network or in a cloud folder."""
    # A link in a local folder may lead to a network.
    absolute = folder.resolve()
    for part in absolute.parts:
        # Such as "OneDrive - University", hence the beginning alone.
        if part.casefold().startswith(CLOUD_FOLDERS):
            raise BadInput(_refusal(folder, f"synchronised by a cloud service ({part})"))
    holding = [(place, kind) for place, kind in mounts if absolute.is_relative_to(place)]
    # Of several mounts at one place the last hides the others, such as an automounter's.
    by_depth = sorted(holding, key=lambda mount: len(PurePath(mount[0]).parts))
    kind = by_depth[-1][1] if by_depth else ""
    if kind in NETWORK_TYPES:
        raise BadInput(_refusal(folder, f"on a network ({kind})"))
    return absolute


def mounts_of_this_machine() -> list[Mount]:
    """Return the mounts of this machine; an empty list if the system does not list them."""
    import psutil

    try:
        return [(entry.mountpoint, entry.fstype) for entry in psutil.disk_partitions(all=True)]
    except OSError:
        return []


def _refusal(folder: Path, why: str) -> str:
    return f"{folder}: must not be {why}, where journals get damaged; use a folder on a local disk"
