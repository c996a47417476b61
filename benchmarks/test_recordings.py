"""What a recorded million of samples costs: the journal's way against the bare parts of it."""

import sqlite3
import tempfile
import zlib
from collections.abc import Callable
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.compared import compare
from protocol.journal.events import StoredEvent, TouchRecorded
from runner.journal.opening import open_journal

NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)
SAMPLES, TOUCHES = 1_000_000, 50
SCALE = (1e-4, 1e-4, 2.5e-6)
BINS = np.linspace(0.0, 0.08, 161)
ROUNDS = 5


def touches() -> list[bytes]:
    """The counts of fifty touches of 20 s at 1 kHz: noise on forces, and a path along the beam."""
    stream = np.random.default_rng(1)
    each = SAMPLES // TOUCHES
    path = np.linspace(0.01, 0.07, each) / SCALE[2]
    return [
        np.vstack(
            [
                stream.normal(3000, 250, each),
                stream.normal(5600, 50, each),
                path + stream.normal(0, 20, each),
            ]
        )
        .astype("<i2", casting="unsafe")
        .tobytes()
        for _ in range(TOUCHES)
    ]


def binned(counts: bytes) -> NDArray[np.float64]:
    """Mean coefficient of friction by place: what numpy alone makes of the samples."""
    tangential, normal, place = np.frombuffer(counts, "<i2").reshape(3, -1)
    where = np.digitize(place * SCALE[2], BINS)
    friction = tangential / normal
    size = len(BINS) + 1
    total = np.bincount(where, friction, size)
    return np.asarray(total / np.maximum(np.bincount(where, minlength=size), 1))


def ours(folder: Path, recorded: list[bytes]) -> list[NDArray[np.float64]]:
    """Fifty touches into a journal and out of it."""
    with open_journal(folder / "study.db") as journal:
        for seq, counts in enumerate(recorded):
            event = TouchRecorded.packed(
                counts,
                touch=0,
                source="board",
                rate_hz=1000.0,
                first_s=0.0,
                scale=SCALE,
                clock_offset_s=0.0,
                clock_error_s=0.001,
                moved_s=(0.0, 20.0),
                tare_n=(0.0, 0.0),
                saturated=0,
            )
            stored = StoredEvent(
                seq=seq, tag=event.TAG, utc=NOON, monotonic_s=0.0, payload=event.to_json()
            )
            journal.append("P01/1", stored)
        records = [TouchRecorded.from_json(each.payload) for each in journal.events("P01/1")]
        return [binned(record.counts()) for record in records]


def bare(folder: Path, recorded: list[bytes]) -> list[NDArray[np.float64]]:
    """The same bytes by zlib, SHA-256, a table without anything, and numpy."""
    table = sqlite3.connect(folder / "bare.db", isolation_level=None)
    for setting in ("journal_mode = WAL", "synchronous = FULL", "wal_autocheckpoint = 0"):
        table.execute(f"PRAGMA {setting}")
    table.execute("CREATE TABLE touch (seq INTEGER PRIMARY KEY, digest TEXT, samples BLOB) STRICT")
    for seq, counts in enumerate(recorded):
        row = (seq, sha256(counts).hexdigest(), zlib.compress(counts, 1))
        table.execute("INSERT INTO touch VALUES (?, ?, ?)", row)
    rows = table.execute("SELECT samples FROM touch ORDER BY seq").fetchall()
    table.close()
    return [binned(zlib.decompress(samples)) for (samples,) in rows]


def timed(way: Callable[[Path, list[bytes]], object], recorded: list[bytes]) -> float:
    """Seconds that it takes, on the disk on which journals lie."""
    with tempfile.TemporaryDirectory(dir=Path.cwd()) as place:
        start = perf_counter()
        way(Path(place), recorded)
        return perf_counter() - start


def test_a_million_samples_cost_at_most_twice_their_parts(benchmark: BenchmarkFixture) -> None:
    recorded = touches()
    with tempfile.TemporaryDirectory(dir=Path.cwd()) as place:
        pairs = zip(ours(Path(place), recorded), bare(Path(place), recorded), strict=True)
        assert all(np.array_equal(mine, theirs) for mine, theirs in pairs)
    times = [(timed(ours, recorded), timed(bare, recorded)) for _ in range(ROUNDS)]
    work = "keep a million samples, read them and their friction by place"
    peer = "zlib, SHA-256, SQLite and numpy alone"
    exact = "the same numbers"
    ratio = compare(benchmark, work, peer, *zip(*times, strict=True), accuracy=exact)
    benchmark.pedantic(lambda: timed(ours, recorded), rounds=1)
    assert ratio <= 2
