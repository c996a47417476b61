"""`touchbeam verify` on damaged files: one line or a verdict, and never an internal error."""

import random
import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest

from protocol.study_file.loading import template
from runner.journal.opening import open_journal
from runner.session.loop import run
from tests.runner.command_line import typed
from tests.runner.fakes import FakeDevice, FakeParticipant, context
from tests.runner.journal.tampering import tampering

CORRUPTIONS = 75
"""Number of files for each kind of corruption."""
VALUES: tuple[object, ...] = (
    None, b"\xff\x00\xed\xa0\x80", b"", "", "\x1b[2J", "x" * 100_000, -1, 2**63 - 1, 1e308,
    float("inf"), "[" * 50_000, '{"a": NaN}', '{"index": [1]}', '{"index": {}}', "null", "{}",
    '{"versions": {"touchbeam": 3}}', '{"index": 1, "reason": "\\ud800", "why": "\\ud800"}',
    '{"trials": 3, "participant": 1, "kind": [], "conditions": 0}',
    '{"trials": [{"index": [], "kind": "x", "condition": "x"}], "kind": "x", "conditions": [],'
    ' "participant": "", "session": 0}',
    "9" * 5_000, "0001-01-01T00:00:00+23:59", "@study", "withdrawn", "session-opened", "answered",
)  # fmt: skip
COLUMNS = ("session", "seq", "tag", "utc", "monotonic_s", "payload_sha256", "hash", "salt",
           "payload")  # fmt: skip


@pytest.fixture(scope="module")
def journal(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    with open_journal(folder / "study.db") as opened:
        run(context(opened, FakeDevice(), FakeParticipant()))
    return folder / "study.db"


def truncated(path: Path, draw: random.Random) -> None:
    data = path.read_bytes()
    path.write_bytes(data[: draw.randrange(len(data))])


def flipped(path: Path, draw: random.Random) -> None:
    data = bytearray(path.read_bytes())
    for _ in range(draw.choice((1, 3, 30, 300))):
        data[draw.randrange(len(data))] ^= 1 << draw.randrange(8)
    path.write_bytes(data)


def overwritten(path: Path, draw: random.Random) -> None:
    data = bytearray(path.read_bytes())
    start, size = draw.randrange(len(data)), draw.choice((4, 100, 4096))
    data[start : start + size] = draw.choice((bytes(size), draw.randbytes(size)))
    path.write_bytes(data)


def retyped(path: Path, draw: random.Random) -> None:
    """Put values into columns that a STRICT table would refuse."""
    with tampering(path) as other:
        strict = other.execute("SELECT sql FROM sqlite_master WHERE name = 'event'").fetchone()[0]
        other.execute("PRAGMA writable_schema = ON")
        loose = strict.replace("STRICT", "").replace("NOT NULL", "")
        rewrite(other, loose)
        for _ in range(draw.choice((1, 1, 5))):
            other.execute(
                f"UPDATE OR IGNORE event SET {draw.choice(COLUMNS)} = ? WHERE rowid = ?",
                (draw.choice(VALUES), draw.randint(1, 47)),
            )
        rewrite(other, strict)


def rewrite(connection: sqlite3.Connection, sql: str) -> None:
    connection.execute("UPDATE sqlite_master SET sql = ? WHERE name = 'event'", (sql,))
    connection.commit()
    version = connection.execute("PRAGMA schema_version").fetchone()[0]
    connection.execute(f"PRAGMA schema_version = {version + 1}")  # the schema is read again


@pytest.mark.parametrize("corrupt", [truncated, flipped, overwritten, retyped])
def test_verify_reports_damage_in_a_line(
    journal: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    corrupt: Callable[[Path, random.Random], None],
) -> None:
    found = 0
    for seed in range(CORRUPTIONS):
        path = tmp_path / f"{seed}.db"
        shutil.copy(journal, path)
        corrupt(path, random.Random(seed))
        code = typed("verify", path, *(["--json"] if seed % 2 else []))
        shown = capsys.readouterr()
        assert code in {0, 1}, seed
        assert "internal error" not in shown.err, (seed, shown.err)
        assert shown.err.count("\n") == (not shown.out), (seed, shown.err)
        found += code
    assert found > CORRUPTIONS / 5


@pytest.mark.parametrize("name", ["status", "report", "export"])
def test_no_command_ends_in_an_internal_error(
    journal: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    for seed in range(10):
        folder = tmp_path / str(seed)
        folder.mkdir()
        (folder / "study.toml").write_text(template("paper"))
        shutil.copy(journal, folder / "study.db")
        draw = random.Random(1000 + seed)
        draw.choice((truncated, flipped, overwritten))(folder / "study.db", draw)
        options = (str(folder / "out"), "--format", "csv") if name == "export" else ()
        assert typed(name, folder, *options) in {0, 1, 2}
        assert "internal error" not in capsys.readouterr().err, seed
