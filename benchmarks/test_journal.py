"""What durability costs: an event against a bare insert, and a long journal against its size."""

import json
import sqlite3
import tempfile
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from time import perf_counter, process_time

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.compared import compare
from protocol.journal.events import StoredEvent
from protocol.journal.state import folded
from runner.journal.opening import open_journal

NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)
PAYLOAD = {"index": 3, "change": "smoother", "agrees": True, "score": 8, "reaction_time_s": [1.2]}
OPENING = {"participant": "P01", "kind": "participant", "conditions": [], "trials": []}
APPENDS = 400
BARE = """CREATE TABLE event (session TEXT, seq INTEGER, tag TEXT, utc TEXT, monotonic_s REAL,
    body TEXT, PRIMARY KEY (session, seq)) STRICT"""
"""The same event in one plain table: no digests, no chain, nothing that can be erased."""


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder on the disk on which journals lie, not in memory."""
    with tempfile.TemporaryDirectory(dir=Path.cwd()) as place:
        yield Path(place)


def event(seq: int) -> StoredEvent:
    """An answer."""
    return StoredEvent(seq=seq, tag="note", utc=NOON, monotonic_s=seq, payload=PAYLOAD)


def test_an_event_costs_at_most_1_3_bare_inserts(benchmark: BenchmarkFixture, folder: Path) -> None:
    bare = sqlite3.connect(folder / "bare.db", isolation_level=None)
    for setting in ("journal_mode = WAL", "synchronous = FULL", "wal_autocheckpoint = 0"):
        bare.execute(f"PRAGMA {setting}")
    bare.execute(BARE)
    body = json.dumps(PAYLOAD)
    ours, peer = [], []
    with open_journal(folder / "study.db") as journal:
        for seq in range(APPENDS):
            start = perf_counter()
            journal.append("P01/1", event(seq))
            middle = perf_counter()
            row = ("P01/1", seq, "note", NOON.isoformat(), float(seq), body)
            bare.execute("INSERT INTO event VALUES (?, ?, ?, ?, ?, ?)", row)
            ours.append(middle - start)
            peer.append(perf_counter() - middle)
        sequence = iter(range(APPENDS, 10 * APPENDS))
        benchmark.pedantic(lambda: journal.append("P01/1", event(next(sequence))), rounds=50)
    bare.close()
    work = "append an event, durably, with its digest"
    assert compare(benchmark, work, "SQLite, the same row, as durable", ours, peer) <= 1.3


def test_100_000_events_open_and_fold_in_3_times_what_reading_them_takes(
    benchmark: BenchmarkFixture, folder: Path
) -> None:
    with open_journal(folder / "study.db") as journal, journal.alone():
        for session in range(1_000):
            name = f"P{session:04d}/1"
            journal.append(
                name,
                StoredEvent(seq=0, tag="session-opened", utc=NOON, monotonic_s=0, payload=OPENING),
            )
            for seq in range(1, 100):
                journal.append(name, event(seq))

    def opened_and_folded() -> float:
        start_s = process_time()
        with open_journal(folder / "study.db") as journal:
            names = [folded(journal.events(name)).name for name in journal.sessions()]
        assert names == ["idle"] * 1_000
        return process_time() - start_s

    def read() -> float:
        start_s = process_time()
        with sqlite3.connect(folder / "study.db") as rows:
            assert all(json.loads(body) for (body,) in rows.execute("SELECT payload FROM event"))
        rows.close()
        return process_time() - start_s

    pairs = [(opened_and_folded(), read()) for _ in range(5)]
    benchmark.pedantic(opened_and_folded, rounds=1)
    ratio = compare(
        benchmark,
        "open a journal of 100,000 events and follow each of its 1,000 sessions",
        "SQLite and json.loads of the same payloads",
        *zip(*pairs, strict=True),
    )
    assert ratio <= 3
