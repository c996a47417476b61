"""Changes made to a journal outside touchbeam, by someone who leaves its schema as it was."""

import json
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from runner.journal.opening import read_journal
from runner.journal.store import FIRST_HASH, chain_hash, event_fields, payload_digest

Payloads = list[dict[str, Any]]


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


def forge(
    path: Path, session: str, change: Callable[[Payloads], None], name: str | None = None
) -> None:
    """Change the payloads of a session, and write hashes that fit; rename it if there is a name."""
    with read_journal(path) as journal:
        links = list(journal.chain(session))
    payloads = [dict(link.event.payload) for link in links]
    change(payloads)
    previous, chain = FIRST_HASH, name or session
    with tampering(path) as other:
        for link, payload in zip(links, payloads, strict=True):
            body = json.dumps(payload, ensure_ascii=False, sort_keys=True)
            assert link.salt is not None
            digest = payload_digest(body, link.salt)
            previous = chain_hash(previous, event_fields(chain, link.event, digest))
            other.execute(
                "UPDATE event SET session = ?, payload = ?, payload_sha256 = ?, hash = ? "
                "WHERE session = ? AND seq = ?",
                (chain, body, digest, previous, session, link.event.seq),
            )
