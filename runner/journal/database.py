"""The SQLite file of a journal: hardened connections, the expected schema, and checkpoints.

Before 3.51.3, SQLite can lose committed transactions if one connection commits while another one
checkpoints (https://sqlite.org/wal.html#walresetbug). No commit therefore runs beside a checkpoint
here, whatever the version: `copied_log` holds the write lock, and `merge_log` is alone with the
file. SQLite's own checkpoint at the close of a last connection never runs on a log with events.
"""

import errno
import os
import shutil
import sqlite3
import stat
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from functools import cache
from pathlib import Path
from random import uniform
from tempfile import TemporaryDirectory, gettempdir

from protocol.errors import page
from runner.signals import raise_if_stopped, stops_deferred

SQLITE_VERSION = sqlite3.sqlite_version
SQLITE_ERRORS = (sqlite3.Error, UnicodeDecodeError)
"""What SQLite raises on a damaged file; names in its messages may be damaged, too."""
_OF_DAMAGE = {sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB}
RESTORE = f"restore the journal from a backup, see {page('Journal')}"
"""The way out of damage: to go on without what is damaged would be to lose it unseen."""
# Of SQLite's virtual machine: Ctrl-C must end the reading of a damaged file, which may never end.
_STEPS_BETWEEN_SIGNALS = 10_000
_MOST_OBJECTS = 100
_ATTEMPTS = 10
_SWEEPS = 3
_BLOCK = 1 << 20
IN_MEMORY = Path("/dev/shm")  # noqa: S108 - the copy is in a folder that only the user can open
_NAMES_A_FILE = bytes.fromhex("d9d505f920a163d7")
"""The end of a rollback journal that names a super-journal, as only ATTACH makes them."""
_FIXED_BRANCHES = {(3, 44): 6, (3, 50): 7}
"""Older branches of SQLite to which the fix of the WAL-reset bug was carried back."""

Schemas = Mapping[int, Sequence[str]]
"""The statements that create each version of the schema."""
Tips = dict[str, tuple[object, ...]]
"""Numbers of events and payloads, last number and last hash of each chain."""


class LogNotCopiedError(Exception):
    """After a checkpoint the main file lacks events of the log, which is kept."""


def has_wal_reset_bug(version: str) -> bool:
    """Return whether this version of SQLite can lose transactions when a log is reset."""
    major, minor, patch = (int(part) for part in version.split(".")[:3])
    return (major, minor, patch) < (3, 51, 3) and patch < _FIXED_BRANCHES.get((major, minor), 99)


def connected(path: Path, access: str = "mode=rw", timeout_s: float = 5.0) -> sqlite3.Connection:
    """Return a connection to an existing file, whose schema and pages are not trusted.

    Each statement is a transaction of its own. Signals take effect while SQLite is at work. Raise
    `sqlite3.Error` if it cannot be opened, or SQLite would reach a file elsewhere through it.
    """
    # Before SQLite sees the file: to recover a rollback journal it needs only to open it.
    _require_reaching_no_other(path)
    uri = f"{path.absolute().as_uri()}?{access}"
    # Whichever thread turns a rig off ends its session; SQLite itself serves one after another.
    connection = sqlite3.connect(
        uri, uri=True, timeout=timeout_s, isolation_level=None, check_same_thread=False
    )
    with closed_on_error(connection):
        # Python runs the handlers of signals between two of its instructions: this is one.
        connection.set_progress_handler(lambda: 0, _STEPS_BETWEEN_SIGNALS)
        # A stranger's views and triggers may then call no function with effects outside the file.
        connection.execute("PRAGMA trusted_schema = OFF")
        # Damaged pages are noticed where they are read.
        connection.execute("PRAGMA cell_size_check = ON")
        # Python 3.11 has no way to set this.
        if sys.version_info >= (3, 12):
            connection.setconfig(sqlite3.SQLITE_DBCONFIG_DEFENSIVE)
    return connection


def _require_reaching_no_other(path: Path) -> None:
    """Refuse links, and a rollback journal that names a file, which SQLite would delete."""
    if path.is_symlink():
        raise sqlite3.DatabaseError("it is a link; use the study or the file to which it leads")
    if path.exists() and not path.is_file():
        raise sqlite3.DatabaseError("it must be a file")
    rollback, end = path.with_name(f"{path.name}-journal"), _NAMES_A_FILE
    try:
        # Not `stat`: a link in its place must not be followed.
        state = rollback.lstat()
        if stat.S_ISREG(state.st_mode):
            with rollback.open("rb") as file:
                # The name of a super-journal stands at the end, followed by this mark.
                file.seek(max(0, state.st_size - len(end)))
                end = file.read()
    except FileNotFoundError:  # there is none, or another process has just recovered the journal
        return
    except OSError as error:
        raise sqlite3.OperationalError(str(error)) from error
    if end == _NAMES_A_FILE:
        raise sqlite3.DatabaseError(
            f"beside it is {rollback.name}, which touchbeam did not write: it is not a regular "
            "file, or it names another file, which SQLite would delete; move it away"
        )


@contextmanager
def closed_on_error(connection: sqlite3.Connection) -> Iterator[None]:
    """Close `connection` if the body fails; a stop by a signal is a failure too."""
    try:
        yield
    except BaseException:
        connection.close()
        raise


def log_of(path: Path) -> Path:
    """Return the path of the write-ahead log of the file `path`."""
    return path.with_name(f"{path.name}-wal")


def log_aside(path: Path) -> Path:
    """Return where the log is for a moment while a connection is closed that would remove it."""
    return path.with_name(f"{path.name}-wal-aside")


def _has_events(log: Path) -> bool:
    try:
        return log.stat().st_size > 0
    except FileNotFoundError:
        return False


def is_writable(path: Path) -> bool:
    """Return whether the file and its folder, which holds the log, can be written."""
    return os.access(path, os.W_OK) and os.access(path.parent, os.W_OK)


# A copy to read, where nothing can be written beside the file


def lacks_writing(error: BaseException | None) -> bool:
    """Return whether SQLite lacked room or rights for the log's index, which it makes to read."""
    return getattr(error, "sqlite_errorcode", 0) & 0xFF in {  # errors of Python have no code
        sqlite3.SQLITE_FULL,
        sqlite3.SQLITE_IOERR,
        sqlite3.SQLITE_CANTOPEN,
        sqlite3.SQLITE_READONLY,
    }


def connected_to_copy(path: Path) -> sqlite3.Connection:
    """Return a connection to a private copy of a file and its log, both as at one moment.

    The copy is in the system's temporary folder, or in memory if that is full. It loses its name
    at once, so that it vanishes with the connection, whatever becomes of this process. Raise
    `sqlite3.Error` if there is no room for it, or the file is being changed all the time.
    """
    _require_reaching_no_other(path)
    # The disk of the temporary folder may be the full one. Then the copy is kept in memory.
    for place in _temporary_folders():
        try:
            with TemporaryDirectory(prefix="touchbeam-", dir=place) as folder:
                copy = Path(folder) / path.name
                _copy_of_one_moment(path, copy)
                connection = connected(copy)
                with closed_on_error(connection):
                    connection.execute("PRAGMA locking_mode = EXCLUSIVE")  # needs no index beside
                    connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
                return connection
        except OSError as error:
            if error.errno not in {errno.ENOSPC, errno.EDQUOT, errno.EROFS}:
                raise
    raise sqlite3.OperationalError(
        "its disk is full or read-only, and no other has room for a copy; set TMPDIR to a folder "
        "on a disk with room"
    )


def _temporary_folders() -> Iterator[str]:
    with suppress(FileNotFoundError):  # none can be written
        yield gettempdir()
    if IN_MEMORY.is_dir():
        yield str(IN_MEMORY)


def _copy_of_one_moment(path: Path, copy: Path) -> None:
    """Copy a file, its log and its rollback journal while other processes may change them.

    What is the same before and after all was read is as it was at the moment between. Only the log
    may have grown meanwhile: SQLite takes it up to the last transaction that is whole.
    """
    endings = ("", "-wal", "-journal")
    for _ in range(_ATTEMPTS):
        for ending in endings:
            _copy_part(path.with_name(path.name + ending), copy.with_name(copy.name + ending))
        # While the log is aside, the file alone lacks events.
        if not log_aside(path).exists() and all(
            _is_still(path.with_name(path.name + ending), copy.with_name(copy.name + ending))
            for ending in reversed(endings)
        ):
            return
    raise sqlite3.OperationalError("it changes while it is read; end what writes to it")


def _copy_part(part: Path, copy: Path) -> None:
    copy.unlink(missing_ok=True)
    with suppress(FileNotFoundError):
        # A pipe would keep the reader waiting for ever.
        if not stat.S_ISREG(part.lstat().st_mode):
            raise sqlite3.DatabaseError(f"{part.name} must be a regular file")
        shutil.copyfile(part, copy)


def _is_still(part: Path, copy: Path) -> bool:
    try:
        with part.open("rb") as now, copy.open("rb") as then:
            while block := then.read(_BLOCK):
                if now.read(len(block)) != block:
                    return False
            # What was added to the log belongs to later transactions; a longer main file changed.
            return part.name.endswith("-wal") or not now.read(1)
    except FileNotFoundError:
        return part.exists() == copy.exists()


# Schema


@contextmanager
def transaction(connection: sqlite3.Connection, kind: str = "DEFERRED") -> Iterator[None]:
    connection.execute(f"BEGIN {kind}")
    with connection:
        yield


def checked_version(
    connection: sqlite3.Connection, schemas: Schemas, lacking: list[str] | None = None
) -> int:
    """Return the version of the schema, after comparing all of it; 0 for a file without tables.

    The body of one transaction, so that all of it is of one state. Missing triggers are added to
    the list `lacking`, if there is one. Raise `sqlite3.DatabaseError` for another schema.
    """
    version = int(connection.execute("PRAGMA user_version").fetchone()[0])
    # Another schema may mean something else by the same columns, so that nothing is guessed.
    if version not in {0, *schemas}:
        raise sqlite3.DatabaseError(
            f"schema must be {' or '.join(map(str, schemas))}, got {version}; "
            "use the version of touchbeam that created the journal"
        )
    found, own = _objects(connection), _expected(tuple(schemas.get(version, ())))
    if not version and found:
        raise sqlite3.DatabaseError("it is damaged, or has tables that are not touchbeam's")
    missing = sorted(own.keys() - found.keys())
    # Without a trigger the rows can still be read and verified; without a table they cannot.
    if lacking is not None and all(kind == "trigger" for kind, _ in missing):
        lacking += [name for _, name in missing]
        missing = []
    changed = [
        *(
            f"{kind} {name} is not touchbeam's"
            for (kind, name), entry in found.items()
            if entry != own.get((kind, name))
        ),
        *(f"{kind} {name} is missing" for kind, name in missing),
    ]
    if changed:
        raise sqlite3.DatabaseError(
            f"{changed[0]}: the file was changed outside touchbeam; restore it from a backup"
        )
    return version


def _objects(connection: sqlite3.Connection) -> dict[tuple[str, str], tuple[object, ...]]:
    rows = connection.execute(
        # A stranger's file may have millions of tables; one too many is enough to refuse it.
        "SELECT type, name, tbl_name, sql FROM sqlite_master LIMIT ?",
        (_MOST_OBJECTS,),
    )
    return {(_plain(kind), _plain(name)): tuple(rest) for kind, name, *rest in rows}


def _plain(name: object) -> str:
    """Return a name without characters that a terminal would obey."""
    return name if isinstance(name, str) and name.isidentifier() else ascii(name)


@cache
def _expected(statements: tuple[str, ...]) -> dict[tuple[str, str], tuple[object, ...]]:
    # SQLite keeps statements in a form of its own; made by the same SQLite, both can be compared.
    with closing(sqlite3.connect(":memory:")) as own:
        for statement in statements:
            own.execute(statement)
        return _objects(own)


# Checkpoints


def copied_log(connection: sqlite3.Connection, path: Path, tip: tuple[str, str] | None) -> bool:
    """Copy the log into the main file while no process can commit, and compare both.

    The next commit may then start the log from its beginning. Return False if a reader needs a part
    of it, or another process holds the write lock. `tip` is a chain and its last hash, as written
    by this process. Raise `LogNotCopiedError` if the main file lacks events; the log is then kept.
    """
    try:
        with (
            # The write lock, so that no other process commits while the log is copied.
            transaction(connection, "IMMEDIATE"),
            closing(connected(path)) as other,
            # A signal between copying and comparing would leave a copy that nobody has compared.
            stops_deferred(),
        ):
            return _passively_copied(other, path, _tips(connection), tip)
    except sqlite3.OperationalError as error:
        # Another process that holds the lock is no error: the log grows and is copied later.
        if not _is_busy(error):
            raise
        return False


def _is_busy(error: Exception) -> bool:
    return getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_BUSY


def _passively_copied(
    connection: sqlite3.Connection, path: Path, known: Tips, tip: tuple[str, str] | None = None
) -> bool:
    busy, frames, copied = connection.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchone()
    if busy or frames != copied:
        return False
    # `immutable` makes SQLite read the main file without its log, as if the log were lost.
    with closing(connected(path, "immutable=1")) as main_file_alone:
        found = _tips(main_file_alone)
    if found != known or (tip is not None and found.get(tip[0], ("",))[-1] != tip[1]):
        # The log is the only place that still has these events, and SQLite would soon overwrite it.
        kept = path.with_name(f"{path.name}-wal-kept-{time.time_ns()}")
        shutil.copyfile(log_of(path), kept)
        raise LogNotCopiedError(f"it lacks events of its log, which is kept as {kept.name}")
    return True


def _tips(connection: sqlite3.Connection) -> Tips:
    # SQLite takes `hash` from the row with the largest number.
    rows = connection.execute(
        "SELECT session, count(*), count(payload), max(seq), hash FROM event GROUP BY session"
    )
    return {name: tuple(tip) for name, *tip in rows}


def leave(connection: sqlite3.Connection, path: Path, patience_s: float) -> None:
    """Close a connection; the last one to leave the file also merges and removes its log.

    Others are waited for `patience_s` long. Raises `LogNotCopiedError` as `copied_log`.
    """
    with stops_deferred():
        close_keeping_log(connection, path)
        # This user cannot write and leaves it to one who can.
        if not is_writable(path):
            return
        end_s = time.monotonic() + patience_s
        # Whoever is still here merges the log when leaving, so that giving up loses nothing.
        while _has_events(log_of(path)) and not _merged(path) and time.monotonic() < end_s:
            _wait_out_of_step()
        # Of two that close at the same moment each can take the other for one that stays, so that
        # neither removes the log. An empty one belongs to somebody who is here, or to nobody.
        for _ in range(_SWEEPS):
            if not log_of(path).exists() or _has_events(log_of(path)):
                return
            _wait_out_of_step()
            _sweep(path)


def _wait_out_of_step() -> None:
    """Wait for a moment, not in step with another process that leaves at the same time."""
    time.sleep(uniform(0.002, 0.02))


def close_keeping_log(connection: sqlite3.Connection, path: Path) -> None:
    """Close a connection without SQLite's checkpoint, which one that can only read cannot make."""
    with closing(connection), suppress(*SQLITE_ERRORS, OSError):
        if _has_events(log_of(path)):
            with closing(connected(path, "mode=ro")) as last:
                last.execute("PRAGMA user_version").fetchone()  # takes the lock of a reader
                # While `last` reads: SQLite copies the log when the last connection is closed.
                connection.close()


def way_out(error: BaseException) -> str:
    """Return what to do about a damaged file, as the end of a message; '' for another error."""
    damaged = getattr(error, "sqlite_errorcode", 0) & 0xFF in _OF_DAMAGE
    # SQLite's module has no code for a text that it cannot decode.
    return f"; {RESTORE}" if damaged or "decode" in str(error) else ""


def copy_database(connection: sqlite3.Connection, new: Path) -> None:
    """Copy the database as it is now, log included, into the file `new`."""
    with closing(sqlite3.connect(new, isolation_level=None)) as copy, transaction(connection):
        # A read keeps this state for the transaction, so that commits do not start the copy anew.
        connection.execute("SELECT 1 FROM sqlite_master").fetchone()
        connection.backup(copy, pages=1000, progress=lambda *_: raise_if_stopped())


def _merged(path: Path) -> bool:
    """Merge the log into the main file and remove it; return False if others use the file."""
    # Without waiting here, because `leave` tries again until its patience ends.
    alone = connected(path, timeout_s=0)
    try:
        # From here to the close no other process can read or write the file. The log's index is
        # made anew from the log itself, so that every event in it is copied.
        alone.execute("PRAGMA locking_mode = EXCLUSIVE")
        merged = _passively_copied(alone, path, _tips(alone))
    except SQLITE_ERRORS as error:
        if _is_busy(error):
            alone.close()
            return False
        merged = False  # a full disk, for example: the log stays
    except BaseException:  # not LogNotCopiedError alone: a copy of the log may not be possible
        _close_without_removing(alone, path)
        raise
    if not merged:
        _close_without_removing(alone, path)
        return True
    alone.close()
    _sweep(path)
    return True


def _sweep(path: Path) -> None:
    """Remove an empty log and its index, as SQLite does when the last connection is closed."""
    with suppress(*SQLITE_ERRORS):
        sweeper = connected(path)
        with closed_on_error(sweeper):
            sweeper.execute("PRAGMA user_version").fetchone()
        # Another process may have come and gone meanwhile, and left events for its own merging.
        close_keeping_log(sweeper, path)


def _close_without_removing(connection: sqlite3.Connection, path: Path) -> None:
    """Close the only connection to a file; SQLite does not find the log that it would remove."""
    # A process that is killed in between leaves the log here, as every command then reports.
    log_of(path).rename(log_aside(path))
    connection.close()
    log_aside(path).rename(log_of(path))
