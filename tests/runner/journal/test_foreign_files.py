"""A journal from elsewhere must not make touchbeam delete, write or open another file."""

import os
import shutil
import sqlite3
import struct
from collections.abc import Callable
from pathlib import Path

import pytest

from runner.journal.database import connected
from runner.journal.opening import open_journal, read_journal
from runner.journal.store import JournalError
from tests.runner.command_line import typed
from tests.runner.journal.test_database import COMMANDS as KNOWN_COMMANDS
from tests.runner.journal.test_database import asked

COMMANDS = (*KNOWN_COMMANDS, ("register",))
MAGIC = bytes.fromhex("d9d505f920a163d7")
PAGE = 4096


@pytest.fixture
def victim(tmp_path: Path) -> Path:
    """A file of the user's outside the study."""
    file = tmp_path / "thesis.txt"
    file.write_text("three years of work")
    return file


def rolled_back(database: Path, victim: Path | None = None) -> Path:
    """Put a rollback journal beside `database`, as a crash leaves it; it names `victim`."""
    pages = database.stat().st_size // PAGE
    written = MAGIC + struct.pack(">IIIII", 0, 1, pages, 512, PAGE)
    written = written.ljust(512, b"\0")
    if victim is not None:
        name = bytes(victim)
        written += struct.pack(">I", 0x40000000 // PAGE + 1) + name
        written += struct.pack(">II", len(name), sum(name)) + MAGIC
    journal = database.with_name(f"{database.name}-journal")
    journal.write_bytes(written)
    return journal


def states(study: Path) -> dict[str, int]:
    return {file.name: file.lstat().st_mtime_ns for file in study.iterdir()}


def assert_all_refuse(study: Path, why: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Type all commands; require that each says `why` in one line and changes nothing."""
    before = states(study)
    for command in COMMANDS:
        assert asked(study, command) == 1, command
        shown = capsys.readouterr()
        assert (shown.out, shown.err.count("\n")) == ("", 1), command
        assert "study.db: cannot be " in shown.err
        assert why in shown.err
    assert states(study) == before


def test_a_rollback_journal_that_names_a_file_does_not_delete_it(
    study: Path, victim: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rolled_back(study / "study.db", victim)
    assert_all_refuse(study, "(beside it is study.db-journal, which touchbeam did not", capsys)
    assert victim.read_text() == "three years of work"


def test_a_backup_whose_rollback_journal_names_a_file_is_not_verified(
    study: Path, victim: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = study.with_name("sent.db")
    shutil.copyfile(study / "study.db", copy)
    rolled_back(copy, victim)
    assert typed("verify", copy) == 1
    said = capsys.readouterr()
    assert (said.out, said.err.count("\n")) == ("", 1)
    assert "sent.db-journal, which touchbeam did not write" in said.err
    assert victim.read_text() == "three years of work"


def test_a_withdrawal_does_not_search_a_copy_whose_rollback_journal_names_a_file(
    study: Path, victim: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copyfile(study / "study.db", study / "old.bin")
    rolled_back(study / "old.bin", victim)
    assert typed("withdraw", study, "--participant", "P01", "--yes") == 0
    assert "Not searched, because" in (said := capsys.readouterr().out)
    assert "old.bin" in said
    assert victim.read_text() == "three years of work"


def test_a_rollback_journal_alone_leaves_nothing_behind(study: Path, victim: Path) -> None:
    rolled_back(study / "study.db", victim)
    (study / "study.db").unlink()
    assert typed("register", study) == 1
    assert not (study / "study.db").exists()
    assert victim.read_text() == "three years of work"


@pytest.mark.parametrize("make", [Path.mkdir, os.mkfifo, lambda path: path.symlink_to("thesis")])
def test_a_rollback_journal_must_be_a_file(study: Path, make: Callable[[Path], object]) -> None:
    make(study / "study.db-journal")
    for opened in (open_journal, read_journal):
        with pytest.raises(JournalError, match=r"beside it is study\.db-journal"):
            opened(study / "study.db")


def test_where_a_rollback_journal_cannot_be_looked_at_the_system_says_why(tmp_path: Path) -> None:
    path = tmp_path / ("x" * 250)
    path.touch()
    with pytest.raises(sqlite3.OperationalError, match="File name too long"):
        connected(path)


def test_a_rollback_journal_that_names_no_file_is_recovered(study: Path) -> None:
    left = rolled_back(study / "study.db")
    with read_journal(study / "study.db") as journal:
        assert journal.sessions() == ["P01/1"]
    assert not left.exists()


@pytest.mark.parametrize("size", [0, 7, 8, 512])
def test_a_rollback_journal_of_any_size_is_looked_at(study: Path, size: int) -> None:
    (study / "study.db-journal").write_bytes(b"\0" * size)
    with open_journal(study / "study.db") as journal:
        assert journal.sessions() == ["P01/1"]


@pytest.mark.parametrize("target", ["other.db", "nowhere.db"])
def test_a_journal_that_is_a_link_is_refused(
    study: Path, capsys: pytest.CaptureFixture[str], target: str
) -> None:
    (study / "study.db").rename(study.with_name("other.db"))
    before = study.with_name("other.db").read_bytes()
    (study / "study.db").symlink_to(study.with_name(target))
    assert_all_refuse(study, "(it is a link; use the study or the file to which it leads)", capsys)
    assert study.with_name("other.db").read_bytes() == before
    assert not study.with_name("nowhere.db").exists()


@pytest.mark.parametrize("make", [Path.mkdir, os.mkfifo])
def test_a_journal_must_be_a_file(
    study: Path, capsys: pytest.CaptureFixture[str], make: Callable[[Path], object]
) -> None:
    (study / "study.db").unlink()
    make(study / "study.db")
    assert_all_refuse(study, "(it must be a file)", capsys)


def test_the_folder_of_a_study_may_be_a_link(study: Path) -> None:
    study.with_name("linked").symlink_to(study)
    linked = study.with_name("linked")
    assert typed("exclude", linked, "--participant", "P01", "--reason", "x") == 0
    assert typed("verify", linked) == 0
