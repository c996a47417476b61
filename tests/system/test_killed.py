"""Power cuts: a session killed anywhere resumes, and no acknowledged event is lost."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from protocol.journal.events import NoteTaken, StoredEvent
from runner.journal.opening import open_journal
from runner.journal.store import Journal, JournalError
from runner.journal.verification import verdicts
from runner.session.loop import run
from tests.runner.fakes import FakeDevice, FakeParticipant, context


class Killed(BaseException):
    """The process is dead: none of its cleanup happens either."""


class DyingJournal:
    """A journal whose process dies at write number `at`, before or after it reaches the disk."""

    def __init__(self, journal: Journal, at: int, *, after: bool) -> None:
        self._journal = journal
        self._left = at
        self._after = after
        self._dead = False
        self.acknowledged: list[StoredEvent] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._journal, name)

    def append(self, session: str, event: StoredEvent) -> None:
        if self._dead:
            raise Killed
        self._left -= 1
        if self._left < 0:
            self._dead = True
            if self._after:
                self._journal.append(session, event)
            raise Killed
        self._journal.append(session, event)
        self.acknowledged.append(event)


@contextmanager
def opened(path: Path) -> Iterator[Journal]:
    with open_journal(path) as journal:
        yield journal


def connected(path: Path) -> sqlite3.Connection:
    """Return SQLite's connection to the journal, created if missing, whose log exists."""
    open_journal(path).__exit__(None, None, None)
    connection = sqlite3.connect(path, isolation_level=None)
    connection.execute("SELECT count(*) FROM event")  # the first query creates the log
    return connection


def writes_of_a_session(folder: Path) -> int:
    with opened(folder / "whole.db") as journal:
        run(context(journal, FakeDevice(), FakeParticipant()))
        return len(journal.events("P01/1"))


def finished_after(path: Path, acknowledged: list[StoredEvent]) -> None:
    """Resume the session in `path` and assert that it has each event and answer exactly once."""
    with opened(path) as journal:
        made = context(journal, FakeDevice(), FakeParticipant())
        if made.log.state.name != "completed":
            run(made)
        (verdict,) = verdicts(journal)
        assert verdict.ok, verdict
        assert (verdict.trials_answered, verdict.duplicates, verdict.missing) == (7, 0, 0)
        events = journal.events("P01/1")
        assert [(event.seq, event.tag) for event in events[: len(acknowledged)]] == [
            (event.seq, event.tag) for event in acknowledged
        ]
        started = sum(event.tag == "trial-started" for event in events)
        assert started == 7 + verdict.trials_aborted


@pytest.mark.parametrize("after", [False, True], ids=["before", "after"])
def test_a_session_killed_at_any_write_resumes(tmp_path: Path, after: bool) -> None:
    for at in range(writes_of_a_session(tmp_path)):
        path = tmp_path / f"{at}.db"
        with opened(path) as journal:
            dying: Any = DyingJournal(journal, at, after=after)
            with pytest.raises(Killed):
                run(context(dying, FakeDevice(), FakeParticipant()))
            acknowledged = dying.acknowledged
        finished_after(path, acknowledged)


def test_a_session_killed_twice_resumes(tmp_path: Path) -> None:
    for first, second in [(9, 4), (15, 12), (3, 20)]:
        path = tmp_path / f"{first}-{second}.db"
        for at in (first, second):
            with opened(path) as journal:
                dying: Any = DyingJournal(journal, at, after=False)
                with pytest.raises(Killed):
                    run(context(dying, FakeDevice(), FakeParticipant()))
        finished_after(path, [])


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(cut=st.integers(0, 60_000), seed=st.integers(0, 2**32))
def test_a_torn_log_loses_only_its_end(tmp_path_factory: Any, cut: int, seed: int) -> None:
    """The last bytes of the write-ahead log are missing or garbage."""
    import random
    import shutil

    folder = tmp_path_factory.mktemp("torn")
    with opened(folder / "study.db") as journal:
        dying: Any = DyingJournal(journal, 20, after=False)
        with pytest.raises(Killed):
            run(context(dying, FakeDevice(), FakeParticipant()))
        for name in ("study.db", "study.db-wal"):
            shutil.copy(folder / name, folder / f"copy-{name}")
        whole = journal.events("P01/1")
    log = folder / "copy-study.db-wal"
    data = log.read_bytes()
    keep = max(len(data) - cut, 0)
    garbage = random.Random(seed).randbytes(min(cut, len(data)) // 2)
    log.write_bytes(data[:keep] + garbage)
    with opened(folder / "copy-study.db") as journal:
        events = journal.events("P01/1")
        assert events == whole[: len(events)], "the first events are left"
        assert all(verdict.chain_ok for verdict in verdicts(journal))
    finished_after(folder / "copy-study.db", [])


def test_a_full_disk_is_an_error_and_the_session_resumes(tmp_path: Path) -> None:
    path = tmp_path / "study.db"
    device = FakeDevice()
    connection = connected(path)
    with Journal(connection, path) as journal:
        made = context(journal, device, FakeParticipant())
        pages = connection.execute("PRAGMA page_count").fetchone()[0]
        connection.execute(f"PRAGMA max_page_count = {pages + 4}")
        with pytest.raises(JournalError, match=r"cannot be written .*full"):
            run(made)
    assert not device.on
    assert device.calls[-1] == "off"
    finished_after(path, [])


def test_a_locked_journal_is_an_error_before_the_output_is_switched_on(tmp_path: Path) -> None:
    path = tmp_path / "study.db"
    device = FakeDevice()
    connection = connected(path)
    with Journal(connection, path) as journal, closing(connected(path)) as other:
        made = context(journal, device, FakeParticipant())
        connection.execute("PRAGMA busy_timeout = 50")
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(JournalError, match=r"cannot be written .*locked"):
            run(made)
    assert "drive" not in device.calls


def test_a_copy_made_during_a_session_is_consistent(tmp_path: Path) -> None:
    import shutil

    with opened(tmp_path / "study.db") as journal:
        run(context(journal, FakeDevice(), FakeParticipant()))
        journal.checkpoint()
        made = context(journal, FakeDevice(), FakeParticipant())
        made.log.append(NoteTaken(text="not checkpointed yet"))
        shutil.copy(tmp_path / "study.db", tmp_path / "copy.db")
    with opened(tmp_path / "copy.db") as copy:
        (verdict,) = verdicts(copy)
        assert verdict.ok
        assert verdict.state == "completed"
