"""Changes made to a journal outside touchbeam, by someone who leaves its schema as it was."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path


@contextmanager
def tampering(path: Path) -> Iterator[sqlite3.Connection]:
    """Yield a connection that may change events; the triggers are restored afterwards."""
    with closing(sqlite3.connect(path)) as other, other:
        triggers = other.execute(
            "SELECT name, sql FROM sqlite_master WHERE type = 'trigger'"
        ).fetchall()
        for name, _ in triggers:
            other.execute(f"DROP TRIGGER {name}")
        yield other
        for _, sql in triggers:
            other.execute(sql)
