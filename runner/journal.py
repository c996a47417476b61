"""The journal: a study's events in one SQLite file, appended one by one and chained by hashes.

The one module that imports sqlite3. Each session has a chain of its own. The chain hashes digests
of the payloads, which stand in a table of their own: what a participant gave can be erased and
the chain still verifies.
"""

import hashlib
import json
import sqlite3
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from protocol.errors import WorkFailed
from runner.session_state import Event

SCHEMA_VERSION = 1
FIRST_HASH = "0" * 64

_SCHEMA = """
CREATE TABLE event (
    session TEXT NOT NULL,
    seq INTEGER NOT NULL,
    tag TEXT NOT NULL,
    utc TEXT NOT NULL,
    monotonic_s REAL NOT NULL,
    payload_sha256 TEXT NOT NULL,
    hash TEXT NOT NULL,
    PRIMARY KEY (session, seq)
) STRICT;
CREATE TABLE payload (
    session TEXT NOT NULL,
    seq INTEGER NOT NULL,
    body TEXT NOT NULL,
    PRIMARY KEY (session, seq)
) STRICT;
CREATE TRIGGER event_is_final_1 BEFORE UPDATE ON event
    BEGIN SELECT RAISE(ABORT, 'the journal is append-only'); END;
CREATE TRIGGER event_is_final_2 BEFORE DELETE ON event
    BEGIN SELECT RAISE(ABORT, 'the journal is append-only'); END;
CREATE TRIGGER payload_is_final BEFORE UPDATE ON payload
    BEGIN SELECT RAISE(ABORT, 'the journal is append-only'); END;
"""


class JournalError(WorkFailed):
    """The journal cannot be read or written; nothing that was acknowledged is lost."""


class Journal:
    """The events of all sessions of one study."""

    def __init__(self, connection: sqlite3.Connection, path: Path) -> None:
        self._connection = connection
        self._path = path

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
        """Return the names of all sessions in the order in which they were opened."""
        rows = self._connection.execute("SELECT session FROM event WHERE seq = 0 ORDER BY rowid")
        return [row[0] for row in rows]

    def events(self, session: str) -> list[Event]:
        """Return the events of `session` in their order."""
        rows = self._connection.execute(
            "SELECT seq, tag, utc, monotonic_s, coalesce(body, '{}') FROM event "
            "LEFT JOIN payload USING (session, seq) WHERE session = ? ORDER BY seq",
            (session,),
        )
        return [
            Event(
                seq=seq,
                tag=tag,
                utc=datetime.fromisoformat(utc),
                monotonic_s=monotonic_s,
                payload=json.loads(body),
            )
            for seq, tag, utc, monotonic_s, body in rows
        ]

    def append(self, session: str, event: Event) -> None:
        """Add `event` to the chain of `session`; it is on the disk when this returns.

        Raises:
            JournalError: it could not be written; nothing of it was.
        """
        body = json.dumps(event.payload, ensure_ascii=False, sort_keys=True, allow_nan=False)
        digest = hashlib.sha256(body.encode()).hexdigest()
        fields = (session, event.seq, event.tag, event.utc.isoformat(), event.monotonic_s, digest)
        try:
            with self._connection as transaction:
                chained = chain_hash(self._last_hash(session, event.seq), fields)
                transaction.execute(
                    "INSERT INTO event VALUES (?, ?, ?, ?, ?, ?, ?)", (*fields, chained)
                )
                transaction.execute(
                    "INSERT INTO payload VALUES (?, ?, ?)", (session, event.seq, body)
                )
        except sqlite3.Error as error:
            raise JournalError(f"{self._path}: cannot be written ({error})") from error

    def _last_hash(self, session: str, seq: int) -> str:
        if seq == 0:
            return FIRST_HASH
        row = self._connection.execute(
            "SELECT hash FROM event WHERE session = ? AND seq = ?", (session, seq - 1)
        ).fetchone()
        if row is None:
            raise JournalError(f"{self._path}: session {session} has no event {seq - 1}")
        return str(row[0])


def chain_hash(previous: str, fields: tuple[object, ...]) -> str:
    """Return the hash that ties an event to the one before it."""
    return hashlib.sha256(json.dumps([previous, *fields]).encode()).hexdigest()


def open_journal(path: Path) -> Journal:
    """Return the journal at `path`, made if it is missing, ready to be written.

    Raises:
        JournalError: it cannot be opened, or another version of touchbeam made it.
    """
    try:
        connection = sqlite3.connect(path, timeout=2.0)
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = FULL")
        _ensure_schema(connection)
    except sqlite3.Error as error:
        raise JournalError(f"{path}: cannot be opened as a journal ({error})") from error
    path.chmod(0o600)
    return Journal(connection, path)


def _ensure_schema(connection: sqlite3.Connection) -> None:
    version = connection.execute("PRAGMA user_version").fetchone()[0]
    if version == 0:
        connection.executescript(
            f"BEGIN; {_SCHEMA} PRAGMA user_version = {SCHEMA_VERSION}; COMMIT;"
        )
    elif version != SCHEMA_VERSION:
        raise sqlite3.DatabaseError(f"schema {version}; this touchbeam knows {SCHEMA_VERSION}")


def session_name(participant: str, number: int) -> str:
    """Return what a session is called in the journal."""
    return f"{participant}/{number}"


def payload_of(events: list[Event], tag: str) -> Mapping[str, Any] | None:
    """Return the payload of the first event `tag`, None if there is none."""
    return next((event.payload for event in events if event.tag == tag), None)
