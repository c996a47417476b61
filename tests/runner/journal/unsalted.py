"""A journal as earlier builds made it: schema 2, without salts."""

import sqlite3
from contextlib import closing
from pathlib import Path

_SCHEMA = """
CREATE TABLE event (
        session TEXT NOT NULL,
        seq INTEGER NOT NULL,
        tag TEXT NOT NULL,
        utc TEXT NOT NULL,
        monotonic_s REAL NOT NULL,
        payload_sha256 TEXT NOT NULL,
        hash TEXT NOT NULL,
        payload TEXT,
        PRIMARY KEY (session, seq)
    ) STRICT;
CREATE TRIGGER event_is_erased_at_most BEFORE UPDATE ON event
        WHEN NEW.payload IS NOT NULL
        OR (NEW.rowid, NEW.session, NEW.seq, NEW.tag, NEW.utc, NEW.monotonic_s,
            NEW.payload_sha256, NEW.hash)
        IS NOT (OLD.rowid, OLD.session, OLD.seq, OLD.tag, OLD.utc, OLD.monotonic_s,
            OLD.payload_sha256, OLD.hash)
        BEGIN SELECT RAISE(ABORT, 'the journal is append-only'); END;
CREATE TRIGGER event_is_not_replaced BEFORE INSERT ON event
        WHEN EXISTS (SELECT 1 FROM event WHERE session = NEW.session AND seq = NEW.seq)
        BEGIN SELECT RAISE(ABORT, 'the journal is append-only'); END;
CREATE TRIGGER event_is_not_deleted BEFORE DELETE ON event
        BEGIN SELECT RAISE(ABORT, 'the journal is append-only'); END;
PRAGMA journal_mode = WAL;
PRAGMA user_version = 2;
"""


def make_unsalted(path: Path) -> None:
    """Make an empty journal of schema 2 at `path`."""
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(_SCHEMA)
