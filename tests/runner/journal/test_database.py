"""Journals from elsewhere: only a schema that is exactly touchbeam's is used, and none trusted."""

import json
import os
import signal
import sqlite3
import threading
from contextlib import closing
from pathlib import Path

import pytest

from runner.journal.database import connected
from runner.journal.opening import open_journal, read_journal
from runner.journal.store import JournalError
from runner.signals import Stopped, signals_raise
from tests.runner.command_line import typed
from tests.runner.journal.unsalted import make_unsalted

COMMANDS = (
    ("status",),
    ("verify",),
    ("report",),
    ("export", "out", "--format", "csv"),
    ("backup", "copy.db"),
    ("run", "--participant", "R2", "--ratings", "virtual"),
    ("exclude", "--participant", "P01", "--reason", "x"),
    ("amend", "--reason", "x"),
    ("withdraw", "--participant", "P01"),
)
READING = {"status", "verify", "report", "export", "backup"}
STRICT = tuple(command for command in COMMANDS if command[0] not in {"verify", "backup"})


def changed(path: Path, *statements: str) -> bytes:
    """Return the bytes of the file after `statements`."""
    with closing(sqlite3.connect(path)) as other, other:
        for statement in statements:
            other.execute(statement)
    return path.read_bytes()


def asked(study: Path, command: tuple[str, ...]) -> int:
    name, *options = command
    return typed(name, study, *options)


@pytest.mark.parametrize(
    ("statement", "named"),
    [
        ("CREATE VIEW other AS SELECT 1", "view other is not touchbeam's"),
        ("CREATE TABLE other (x)", "table other is not touchbeam's"),
        ("CREATE INDEX other ON event (utc)", "index other is not touchbeam's"),
        (
            "CREATE TRIGGER other AFTER INSERT ON event WHEN NEW.tag = 'answered' "
            "BEGIN SELECT 1; END",
            "trigger other is not touchbeam's",
        ),
        ("ALTER TABLE event ADD COLUMN other TEXT", "table event is not touchbeam's"),
        ('CREATE VIEW "\x1b[2J" AS SELECT 1', r"view '\x1b[2J' is not touchbeam's"),
    ],
)
def test_every_command_refuses_a_foreign_schema_and_changes_nothing(
    study: Path, capsys: pytest.CaptureFixture[str], statement: str, named: str
) -> None:
    path = study / "study.db"
    before = changed(path, statement)
    for command in COMMANDS:
        assert asked(study, command) == 1, command
        shown = capsys.readouterr()
        assert shown.out == "", command
        assert shown.err.count("\n") == 1
        assert f"study.db: cannot be {'read' if command[0] in READING else 'opened'}" in shown.err
        assert f"({named}: the file was changed outside touchbeam; restore it" in shown.err
    assert path.read_bytes() == before
    assert sorted(file.name for file in study.iterdir()) == ["study.db", "study.toml"]


def test_a_view_without_end_in_place_of_the_events_is_refused(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = study / "study.db"
    with closing(connected(path)) as other:
        version = other.execute("PRAGMA user_version").fetchone()[0]
    path.unlink()
    endless = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i FROM n"
    changed(path, f"CREATE VIEW event AS {endless}", f"PRAGMA user_version = {version}")
    for command in COMMANDS:
        assert asked(study, command) == 1, command
        assert "view event is not touchbeam's" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("statement", "named"),
    [
        ("CREATE VIEW other AS SELECT 1", "view other is not touchbeam's"),
        ("ALTER TABLE event ADD COLUMN salt BLOB", "table event is not touchbeam's"),
        ("DROP TRIGGER event_is_not_replaced", "trigger event_is_not_replaced is missing"),
        ("PRAGMA user_version = 3", "table event is not touchbeam's"),
    ],
)
def test_a_journal_without_salts_is_compared_with_its_own_schema(
    tmp_path: Path, statement: str, named: str
) -> None:
    path = tmp_path / "study.db"
    make_unsalted(path)
    open_journal(path).__exit__(None, None, None)
    before = changed(path, statement)
    for opened in (open_journal, read_journal):
        with pytest.raises(JournalError, match=named):
            opened(path)
    assert path.read_bytes() == before


def test_missing_triggers_are_refused_and_verify_reports_them(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    changed(study / "study.db", "DROP TRIGGER event_is_not_deleted")
    for command in STRICT:
        assert asked(study, command) == 1, command
        assert "trigger event_is_not_deleted is missing" in capsys.readouterr().err
    assert typed("verify", study) == 1
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith("FAIL  trigger event_is_not_deleted is missing: events may have been")
    assert second.startswith("ok    P01/1  completed")
    assert typed("verify", study, "--json") == 1
    found = json.loads(capsys.readouterr().out)
    assert (found["ok"], found["lacking_triggers"]) == (False, ["event_is_not_deleted"])
    assert found["sessions"][0]["ok"]


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_ends_a_read_that_would_never_end(study: Path, name: str) -> None:
    endless = (
        "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) "
        "SELECT count(*), '', '', 0.0, '', '', '', x'' FROM n WHERE ? <> '' --"
    )
    number = getattr(signal, name)
    with (
        signals_raise(),
        read_journal(study / "study.db") as journal,
        pytest.MonkeyPatch.context() as patched,
    ):
        patched.setattr(journal, "_sql", journal._sql._replace(events=endless))
        threading.Timer(0.2, os.kill, (os.getpid(), number)).start()
        with pytest.raises(Stopped, match=f"stopped by {name}"):
            journal.events("P01/1")


def test_neither_schema_nor_pages_of_a_file_are_trusted(study: Path) -> None:
    with closing(connected(study / "study.db")) as connection:
        settings = ("trusted_schema", "cell_size_check")
        found = [connection.execute(f"PRAGMA {name}").fetchone()[0] for name in settings]
    assert found == [0, 1]


class Configured:
    """A connection as Python 3.12 has it, which can be made defensive."""

    def __init__(self) -> None:
        self.config: list[object] = []

    def setconfig(self, what: object) -> None:
        self.config.append(what)

    def execute(self, statement: str) -> None: ...
    def set_progress_handler(self, handler: object, steps: int) -> None: ...


@pytest.mark.parametrize(
    ("version", "config"), [((3, 11, 9), []), ((3, 12), [1010]), ((3, 13), [1010])]
)
def test_a_connection_is_defensive_where_python_can_make_it_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, version: tuple[int, ...], config: list[int]
) -> None:
    made = Configured()
    monkeypatch.setattr(sqlite3, "SQLITE_DBCONFIG_DEFENSIVE", 1010, raising=False)
    monkeypatch.setattr(sqlite3, "connect", lambda *_, **__: made)
    monkeypatch.setattr("sys.version_info", version)
    connected(tmp_path / "study.db")
    monkeypatch.undo()
    assert made.config == config


def test_a_journal_without_its_table_is_refused_even_to_verify_it(study: Path) -> None:
    path = study / "study.db"
    changed(path, "DROP TABLE event")
    with pytest.raises(JournalError, match="sqlite_autoindex_event_1 is missing"):
        read_journal(path, to_verify=True)
