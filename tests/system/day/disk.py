"""The disk under the journal: what SQLite's connection is made to meet, and what a crash leaves.

A connection stores for real. It may find the disk full, broken or locked, and its process may die
before, during or after a commit. What is synchronised survives; the rest may be cut anywhere.
"""

import random
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any
from unittest.mock import patch

from runner.journal.database import leave
from tests.system.day.invariants import Violation, require
from tests.system.day.process import Dead, Incident, Process

_PAGE = 4096
_LOG_HEADER, _FRAME = 32, 24 + _PAGE
_ANSWERS = "SELECT count(*) FROM event WHERE session = ? AND tag = 'answered'"
_HASHES = "SELECT session, seq, hash FROM event"

Key = tuple[str, int, str]
"""Session, number and hash of an event."""


@dataclass
class Disk:
    """The journal's files, and every event of which a process was told that it is stored."""

    path: Path
    stream: random.Random
    on_event: Callable[[str, str, str], None]
    """Called with session, tag and payload of each event once it is stored."""
    acknowledged: set[Key] = field(default_factory=set)
    in_flight: dict[Key, tuple[str, str]] = field(default_factory=dict)
    """Tag and payload of events that a process was storing when it died."""
    synced: bytes = b""
    """What is in the log on the disk for certain."""
    may_crash: bool = False
    """Whether a process will be killed, so that it matters what is there at each commit."""
    process: Process = field(default_factory=Process)
    """Whose connections are opened now."""
    open: list["LabConnection"] = field(default_factory=list)
    _locker: sqlite3.Connection | None = None

    @cached_property
    def log(self) -> Path:
        """The write-ahead log."""
        return self.path.with_name(f"{self.path.name}-wal")

    def files(self) -> dict[Path, bytes]:
        """Return what is in the journal and its log now."""
        return {path: path.read_bytes() for path in (self.path, self.log) if path.exists()}

    def committed(self, events: dict[Key, tuple[str, str]]) -> None:
        """Take note that a process was told that these events are stored."""
        for key, (tag, payload) in events.items():
            self.acknowledged.add(key)
            self.in_flight.pop(key, None)
            try:
                self.on_event(key[0], tag, payload)
            except Exception as error:  # or the process would take it for the disk's
                raise Violation(11, f"{tag} {payload}: {error!r}") from error
        if self.may_crash:
            self._sync()

    def _sync(self) -> None:
        self.synced = self.log.read_bytes() if self.log.exists() else b""

    def crash(self, before: dict[Path, bytes] | None = None) -> None:
        """Leave the files as the death of their process leaves them; no connection survives.

        With the files as they were `before` a checkpoint, its pages are written in part.
        """
        files = self.files()
        self.unlock()
        for connection in list(self.open):
            connection.really_close()
        for path in self.path.parent.glob(f"{self.path.name}*"):
            path.unlink()
        if before is not None:
            files = self._half_checkpointed(before, files)
        elif self.log in files:
            files[self.log] = self._torn(files[self.log])
        for path, content in files.items():
            path.write_bytes(content)
            path.chmod(0o600)

    def _torn(self, content: bytes) -> bytes:
        """Undo what was not synchronised, from anywhere, or leave garbage in its place.

        After a checkpoint the log is written from its beginning again, over what it had. Whole
        frames are compared: SQLite draws their salts at random.
        """
        kept = 0
        for end in range(_LOG_HEADER, min(len(self.synced), len(content)) + 1, _FRAME):
            if self.synced[kept:end] != content[kept:end]:
                break
            kept = end
        cut = self.stream.randint(kept, len(content))
        lost = len(content) - cut
        return content[:cut] + self.stream.choice(
            (self.synced[cut:], self.stream.randbytes(lost), bytes(lost))
        )

    def _half_checkpointed(
        self, before: dict[Path, bytes], after: dict[Path, bytes]
    ) -> dict[Path, bytes]:
        old, new = before[self.path], after[self.path]
        pages = [
            self.stream.choice(
                (old[place : place + _PAGE] or bytes(_PAGE), new[place : place + _PAGE])
            )
            for place in range(0, len(new), _PAGE)
        ]
        return {**before, self.path: b"".join(pages)}

    def checked(self) -> None:
        """Require that the files have every event that was acknowledged, and none from nowhere."""
        if not self.path.exists():
            require(1, not self.acknowledged, "the journal is gone")
            return
        connection = _connect(self.path)
        try:
            found = {tuple(row) for row in connection.execute(_HASHES)}
        except sqlite3.OperationalError as error:
            require(1, not self.acknowledged and "no such table" in str(error), str(error))
            found = set()
        finally:
            connection.close()
        require(1, self.acknowledged <= found, f"lost: {sorted(self.acknowledged - found)}")
        extra = found - self.acknowledged
        require(1, extra <= self.in_flight.keys(), f"from nowhere: {sorted(extra)}")
        self.committed({key: event for key, event in self.in_flight.items() if key in extra})
        self.in_flight.clear()
        self._sync()

    def answers(self, session: str, access: str = "") -> int:
        """Return how many answers of a session there are, with the log or in the file alone."""
        uri = f"{self.path.as_uri()}?mode=ro{access}"
        with closing(_connect(uri, uri=True)) as connection:
            row = connection.execute(_ANSWERS, (session,)).fetchone()
        return int(row[0])

    def fill(self, pages: int) -> None:
        """Leave room for no more than some pages, for the connections that are open now."""
        for connection in self.open:
            connection.limit(pages)

    def lock(self, crossings: int) -> None:
        """Let another process write for a while."""
        if self._locker is not None or not self.path.exists():
            return
        self._locker = _connect(self.path, timeout=0.0, isolation_level=None)
        with suppress(sqlite3.OperationalError):
            self._locker.execute("BEGIN IMMEDIATE")
        unlocked = Incident(what="unlocked", events=0, crossings=crossings, happen=self.unlock)
        self.process.incidents.append(unlocked)

    def unlock(self) -> None:
        """End the other process that writes."""
        if self._locker is not None:
            self._locker.close()
            self._locker = None

    @contextmanager
    def installed(self) -> Iterator[None]:
        """Let every connection that is opened in the body be one to this disk."""

        def connect(database: Any, **options: Any) -> sqlite3.Connection:
            if database == ":memory:":  # on no disk, and only the first day needs it
                own: sqlite3.Connection = _connect(database, **options)
                return own
            self.process.crossing("disk")
            options["timeout"] = 0.0  # nobody else runs while one waits
            options["factory"] = lambda *args, **more: LabConnection(self, *args, **more)
            made: sqlite3.Connection = _connect(database, **options)
            return made

        def left(connection: sqlite3.Connection, path: Path, _patience_s: float) -> None:
            leave(connection, path, patience_s=0.0)  # likewise

        with (
            patch.object(sqlite3, "connect", connect),
            patch("runner.journal.database.leave", left),
        ):
            yield


_connect: Any = sqlite3.connect


class LabConnection(sqlite3.Connection):
    """A connection of one process; it knows what its process was told."""

    def __init__(self, disk: Disk, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._disk = disk
        self._process = disk.process
        self._pending: dict[Key, tuple[str, str]] = {}
        disk.open.append(self)

    def execute(self, statement: str, parameters: Any = ()) -> sqlite3.Cursor:
        self._process.crossing("disk")
        if self._process.disk_errors > 0:
            self._process.disk_errors -= 1
            error = sqlite3.OperationalError("disk I/O error")
            error.sqlite_errorcode = sqlite3.SQLITE_IOERR
            raise error
        if statement.startswith("INSERT INTO event"):
            return self._insert(statement, parameters)
        if "wal_checkpoint" in statement and self._process.checkpoint_kills:
            before = self._disk.files()
            super().execute(statement)
            self._process.alive = False
            self._disk.crash(before)
            raise Dead
        return super().execute(statement, parameters)

    def _insert(self, statement: str, parameters: Any) -> sqlite3.Cursor:
        key = (parameters[0], parameters[1], parameters[6])
        self._process.stored += 1
        moment = self._process.commit_kills.get(self._process.stored)
        if moment == "before":
            self._process.die()
        event = (parameters[2], parameters[-1])
        self._disk.in_flight[key] = event
        try:
            cursor = super().execute(statement, parameters)
        except sqlite3.Error:
            del self._disk.in_flight[key]
            raise
        if moment == "during":
            self._process.die()
        self._pending[key] = event
        if not self.in_transaction:
            self._acknowledge()
        if moment == "after":
            self._process.die()
        return cursor

    def _acknowledge(self) -> None:
        self._disk.committed(self._pending)
        self._pending = {}

    def limit(self, pages: int) -> None:
        """Let the file grow by no more than some pages."""
        (count,) = super().execute("PRAGMA page_count").fetchone()
        super().execute(f"PRAGMA max_page_count = {count + pages}")

    def __exit__(self, *args: Any) -> Any:
        if not self._process.alive:
            return False
        result = super().__exit__(*args)
        if args[0] is None:
            self._acknowledge()
        else:
            for key in self._pending:
                self._disk.in_flight.pop(key, None)
            self._pending = {}
        return result

    def close(self) -> None:
        if self._process.alive:
            self.really_close()

    def really_close(self) -> None:
        """Close it, whatever has become of its process."""
        if self in self._disk.open:
            self._disk.open.remove(self)
        super().close()
