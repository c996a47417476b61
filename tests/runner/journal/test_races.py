"""Processes that use a journal at once: the main file alone has every event when they have left."""

import random
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

import pytest

from runner.journal.opening import open_journal, read_journal
from runner.journal.verification import chain_is_unbroken

pytestmark = pytest.mark.waits  # for the disk, nearly all of the time

RACES = 20
"""Number of races on one journal, which grows with each."""


@contextmanager
def racer(session: str, seed: int) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "tests.runner.journal.racing", session, str(seed)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    with process:
        yield process
        assert process.stdin is not None
        process.stdin.close()


def race(racers: list[subprocess.Popen[str]], words: list[str], path: Path) -> int:
    """Start all at once; return the number of events that they have written to `path` so far."""
    for process, word in zip(racers, words, strict=True):
        tell(process, word, path)
    return sum(map(answer, racers))


def tell(process: subprocess.Popen[str], word: str, path: Path) -> None:
    assert process.stdin is not None
    process.stdin.write(f"{word} {path}\n")
    process.stdin.flush()


def answer(process: subprocess.Popen[str]) -> int:
    assert process.stdout is not None
    return int(process.stdout.readline())


def in_main_file(path: Path) -> int:
    with closing(sqlite3.connect(f"{path.as_uri()}?immutable=1", uri=True)) as alone:
        return int(alone.execute("SELECT count(*) FROM event").fetchone()[0])


def missing_after(folder: Path, journals: int, seed: int) -> tuple[int, int]:
    """Return the number of events that a main file alone ever lacked, and of all events."""
    draw, missing, total = random.Random(seed), 0, 0
    with ExitStack() as stack:
        racers = [stack.enter_context(racer(f"P0{n}/1", seed + n)) for n in (1, 2, 3)]
        for path in (folder / f"{number}.db" for number in range(journals)):
            open_journal(path).__exit__(None, None, None)
            for _ in range(RACES):
                words = ["write", draw.choice(("read", "read", "write")), "read"]
                written = race(racers, words, path)
                missing += written - in_main_file(path)
            total += written
            require_intact(path)
    return missing, total


def require_intact(path: Path) -> None:
    assert not path.with_name(f"{path.name}-wal").exists()
    with read_journal(path) as journal:
        for session in journal.sessions():
            assert chain_is_unbroken(session, journal.chain(session), erased=False)


def test_200_races_leave_every_event_in_the_main_file(tmp_path: Path) -> None:
    missing, written = missing_after(tmp_path, 200 // RACES, seed=1)
    assert missing == 0
    assert written > 400


def test_a_copy_taken_in_a_race_has_every_event_that_was_there_before(tmp_path: Path) -> None:
    """As a full disk has it read: while others write, checkpoint and leave."""
    path, written = tmp_path / "study.db", 0
    open_journal(path).__exit__(None, None, None)
    with racer("P01/1", 1) as one, racer("P02/1", 2) as other, racer("", 3) as copier:
        for _ in range(60):
            seen = race([copier], ["copy"], path)
            assert seen == written
            for process in (one, other, copier):
                tell(process, "copy" if process is copier else "write", path)
            counts = [answer(process) for process in (one, other, copier)]
            assert written <= counts[2] <= sum(counts[:2])
            written = sum(counts[:2])


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(100, 600, 100))
def test_10_000_races_leave_every_event_in_the_main_file(tmp_path: Path, seed: int) -> None:
    missing, written = missing_after(tmp_path, 2000 // RACES, seed)
    print(f"{missing} of {written} events missing after 2000 races")
    assert missing == 0
