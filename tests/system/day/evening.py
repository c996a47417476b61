"""What is done with the journal in the evening: it is copied, damaged, and read elsewhere.

Each evening has some of this, on copies.
"""

import io
import os
import random
import shutil
import sqlite3
import tempfile
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, redirect_stdout
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

import typer

from device.errors import DeviceError
from protocol.journal.events import NoteTaken, event_of
from protocol.study_file.loading import text_digest
from runner.clock import WallClock
from runner.journal.database import leave
from runner.journal.names import STUDY_CHAIN
from runner.journal.opening import open_journal, read_journal
from runner.journal.store import Journal, SessionLog
from tests.runner.journal.tampering import tampering
from tests.system.day.invariants import require
from touchbeam.cli import journal as commands
from touchbeam.cli.output import complaint
from touchbeam.cli.sharing import import_scores

if TYPE_CHECKING:
    from tests.system.day.day import Day

OTHER_TYPES: dict[str, tuple[object, ...]] = {
    "tag": (b"answered",),
    "utc": (20260105, b"2026-01-05"),
    "monotonic_s": ("soon", b"1.0"),
    "payload_sha256": (b"\0" * 32, 0),
    "hash": (b"\0" * 32, 0),
    "salt": ("0123456789abcdef", 7),
    "payload": (b"{}", 3, "[]", "{", '{"a": NaN}', "[" * 50_000),
}
"""Values that touchbeam cannot have written into a column."""
_SUBJECTS = 400
"""Of published scores: so many that SQLite looks for signals while it reads them."""


@dataclass(frozen=True)
class Evening:
    """A copy of the study of a day."""

    folder: Path
    stream: random.Random
    text: str

    @property
    def journal(self) -> Path:
        """Where its journal is."""
        return self.folder / "study.db"

    def sessions(self) -> list[str]:
        """Return the names of its sessions, read without the code that wrote them."""
        with closing(sqlite3.connect(self.journal)) as connection:
            rows = connection.execute("SELECT DISTINCT session FROM event").fetchall()
        return [name for (name,) in rows if name != STUDY_CHAIN]


def in_the_evening(day: "Day", seed: int) -> None:
    """Do one thing with a copy of the study of `day` every other evening, if it can be read."""
    stream = random.Random(f"evening/{seed}")
    if stream.random() < 0.5 or not day.lab.folder.journal.exists() or day.doubtful:
        return
    with tempfile.TemporaryDirectory(dir=day.lab.folder.path.parent) as place:
        folder = Path(place) / "study"
        shutil.copytree(day.lab.folder.path, folder)
        stream.choice(EVENINGS)(Evening(folder, stream, day.lab.text))


def _told(work: Callable[[], object]) -> tuple[str, int]:
    """Return what a command prints or complains of, and its exit code."""
    printed, complaints, code = io.StringIO(), "", 0
    with redirect_stdout(printed):
        try:
            work()
        except typer.Exit as error:
            code = error.exit_code
        except Exception as error:
            complaints, code = complaint(error)
    line = printed.getvalue() + complaints
    require(11, "internal error" not in line, line)
    return line, code


def _verified(place: Path) -> tuple[str, int]:
    return _told(lambda: commands.verify(study=place))


def _events(path: Path) -> list[tuple[object, ...]]:
    with closing(sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)) as connection:
        return connection.execute("SELECT * FROM event ORDER BY rowid").fetchall()


def _backed_up(evening: Evening) -> None:
    """A backup has every event, verifies, and replaces no file."""
    copy = evening.folder / "copy.db"
    line, code = _told(lambda: commands.backup(study=evening.folder, file=copy))
    require(6, code == 0 and "Written and verified:" in line, line)
    require(1, _events(copy) == _events(evening.journal), "the backup has other events")
    line, code = _verified(copy)
    require(6, code == 0, f"the backup does not verify: {line}")
    line, code = _told(lambda: commands.backup(study=evening.folder, file=copy))
    require(1, code == 2 and "exists and is not overwritten" in line, line)


def _damaged(evening: Evening) -> None:
    """What touchbeam cannot have written is found, and named in one line."""
    column = evening.stream.choice(sorted(OTHER_TYPES))
    value = evening.stream.choice(OTHER_TYPES[column])
    with tampering(evening.journal) as other:
        if column not in {name for _, name, *_ in other.execute("PRAGMA table_info(event)")}:
            return  # schema 2 has no salts
        (strict,) = other.execute("SELECT sql FROM sqlite_master WHERE name = 'event'").fetchone()
        ids = [row for (row,) in other.execute("SELECT rowid FROM event WHERE payload NOT NULL")]
        if not ids:
            return
        other.execute("PRAGMA writable_schema = ON")
        _rewritten(other, strict.replace("STRICT", "").replace("NOT NULL", ""))
        chosen = evening.stream.choice(ids)
        other.execute(f"UPDATE event SET {column} = ? WHERE rowid = ?", (value, chosen))
        _rewritten(other, strict)
    line, code = _verified(evening.folder)
    require(6, code == 1, f"{column} is {value!r:.40}, but: {line}")
    told = _told(lambda: commands.status(study=evening.folder))
    require(6, told[1] in {0, 1} and told[0].count("\n") < 60, told[0])


def _rewritten(connection: sqlite3.Connection, sql: str) -> None:
    connection.execute("UPDATE sqlite_master SET sql = ? WHERE name = 'event'", (sql,))
    connection.commit()
    (version,) = connection.execute("PRAGMA schema_version").fetchone()
    connection.execute(f"PRAGMA schema_version = {version + 1}")


def _another_schema(evening: Evening) -> None:
    """A file whose schema is not touchbeam's is refused and stays as it is."""
    statement, named = evening.stream.choice(
        (
            ("CREATE TABLE other (x)", "table other is not touchbeam's"),
            ("CREATE INDEX other ON event (utc)", "index other is not touchbeam's"),
            ("ALTER TABLE event ADD COLUMN other TEXT", "table event is not touchbeam's"),
            ("DROP TRIGGER event_is_not_deleted", "trigger event_is_not_deleted is missing"),
            ("PRAGMA user_version = 99", "schema must be 2 or 3, got 99"),
            ("PRAGMA user_version = 0", "it is damaged, or has tables that are not touchbeam's"),
        )
    )
    with closing(sqlite3.connect(evening.journal)) as other:
        other.execute(statement)
    before = evening.journal.read_bytes()
    someone = evening.sessions()[0].partition("/")[0]
    line, code = _told(
        evening.stream.choice(
            (
                lambda: commands.status(study=evening.folder),
                lambda: commands.amend(study=evening.folder, reason="x"),
                lambda: commands.withdraw(study=evening.folder, participant=someone, yes=True),
            )
        )
    )
    require(6, code == 1 and named in line, f"{named!r}, but: {line}")
    line, code = _verified(evening.folder)
    require(6, code == 1 and (named in line or "FAIL  trigger" in line), f"{named!r}: {line}")
    require(1, evening.journal.read_bytes() == before, f"{named!r}, and the file was changed")


def _read_only(evening: Evening) -> None:
    """In a folder that is not ours, the journal is read with its log, and nothing is changed."""
    left = evening.folder.with_name("left")
    with open_journal(evening.journal) as journal:
        if (name := _open_for_notes(evening, journal)) is None:
            return
        with closing(sqlite3.connect(evening.journal)) as other:  # a log that a reader holds
            other.execute("BEGIN").execute("SELECT count(*) FROM event").fetchone()
            _noted(name, journal)
            shutil.copytree(evening.folder, left)
    files = [left / "study.db", left / "study.db-wal"]
    before = [path.read_bytes() for path in files]

    def access(path: str | Path, mode: int) -> bool:
        return not (mode & os.W_OK and Path(path) == left)

    with patch("runner.journal.database.os.access", access):
        line, code = _verified(left)
        with read_journal(left / "study.db") as read:
            count = sum(len(read.events(session)) for session in read.sessions())
    require(6, code == 0, line)
    require(1, all(path.exists() for path in files), "the log is gone from another's folder")
    require(1, [path.read_bytes() for path in files] == before, "another's journal was changed")
    require(1, count == len(_events(evening.journal)), "events of the log were not read")


def _noted(name: str, journal: Journal) -> None:
    log = SessionLog(journal, name, WallClock())
    log.append(NoteTaken(text="in the evening"))


def _lost(evening: Evening) -> None:
    """The journal or its disk is lost while it is in use."""
    evening.stream.choice((_deleted, _broken_disk))(evening)


def _broken_disk(evening: Evening) -> None:
    """A disk that breaks as a session fails hides nothing of why the session failed."""

    def fails() -> None:
        with open_journal(evening.journal) as journal:
            if name := _open_for_notes(evening, journal):
                _noted(name, journal)
            disk.start()
            raise DeviceError("the beam broke")

    connect: Any = sqlite3.connect

    def breaks(*place: Any, timeout: float, **options: Any) -> sqlite3.Connection:
        if timeout == 0:  # merging the log, which is left behind
            raise sqlite3.OperationalError("disk I/O error")
        made: sqlite3.Connection = connect(*place, timeout=timeout, **options)
        return made

    disk = patch("runner.journal.database.sqlite3.connect", breaks)
    line, code = _told(fails)
    disk.stop()
    require(11, code == 1 and "the beam broke" in line, f"the beam broke, but: {line}")


def _deleted(evening: Evening) -> None:
    """Somebody deletes the journal while it is in use: the next event says so."""
    journal = open_journal(evening.journal)
    session = _open_for_notes(evening, journal)

    def notes() -> None:
        with journal:
            if session is not None:
                _noted(session, journal)
                evening.journal.unlink()
                _noted(session, journal)

    line, code = _told(notes)
    told = code == 1 and "was deleted, moved or replaced" in line
    require(1, told or session is None, f"the journal was deleted, but: {line}")


def _open_for_notes(evening: Evening, journal: Journal) -> str | None:
    """Return a session that is neither excluded nor withdrawn."""
    for name in evening.sessions():
        if SessionLog(journal, name, WallClock()).state.name in {"idle", "completed"}:
            return name
    return None


def _of_an_earlier_build(evening: Evening) -> None:
    """A session of a build that kept no digest of the study leaves the accepted study as it is."""
    with open_journal(evening.journal) as journal:
        opened = [
            event
            for name in evening.sessions()
            for event in journal.events(name)[:1]
            if not event.erased
        ]
        if not opened:
            return
        payload = {**opened[-1].payload, "participant": "P77", "session": 1}
        current = payload.pop("study_sha256")
        log = SessionLog(journal, "P77/1", WallClock())
        log.append(event_of("session-opened", payload))
    line, code = _told(lambda: commands.amend(study=evening.folder, reason="none"))
    if current == text_digest(evening.text):
        require(11, code == 2 and "has not changed" in line, f"nothing has changed, but: {line}")


def _published(evening: Evening) -> None:
    """Published scores are imported, however many, and can be read."""
    scores, study = evening.folder / "scores.csv", evening.folder.with_name("published")
    rows = [f"{number},{number % 10},{(number + 3) % 10}" for number in range(_SUBJECTS)]
    scores.write_text("\n".join(["subject,voltage,direction", *rows]))
    line, code = _told(lambda: import_scores(table=scores, study=study))
    require(2, code == 0 and f"{_SUBJECTS} subjects imported" in line, line)
    line, code = _verified(study)
    require(6, code == 0 and line.count("ok  ") == _SUBJECTS, line[:300])
    line, code = _told(lambda: commands.status(study=study))
    require(6, code == 0, line[:300])


def _withdrawn(evening: Evening) -> None:
    """What is withdrawn is in no file, whoever else has the journal open.

    While somebody reads an old copy, the command says so; the second run of it finishes.
    """
    with closing(sqlite3.connect(evening.journal)) as other, _impatient():
        rows = other.execute(
            "SELECT session, payload FROM event WHERE tag = 'touch-ended' AND payload NOT NULL"
        ).fetchall()
        if not rows:
            return
        someone = evening.stream.choice(rows)[0].partition("/")[0]
        withdraw = partial(commands.withdraw, evening.folder, someone, yes=True)
        reads = evening.stream.random() < 0.5
        if reads:
            other.execute("BEGIN").execute("SELECT count(*) FROM event").fetchone()
            line, code = _told(withdraw)
            told = code == 1 and "an old copy remains" in line
            require(10, told, f"somebody reads an old copy, but: {line}")
            other.execute("ROLLBACK")
        line, code = _told(withdraw)
        require(11, code == 0 and ("Nothing was left" in line) == reads, line)
        files = evening.folder.glob(f"{evening.journal.name}*")
        content = b"".join(path.read_bytes() for path in files)
        ends = [(session, payload[-80:].encode()) for session, payload in rows]
        kept = {end for session, end in ends if not session.startswith(f"{someone}/")}
        left = [end for _, end in ends if end not in kept and end in content]
        require(10, not left, f"{someone} has withdrawn, but is in the files: {left}")


@contextmanager
def _impatient() -> Iterator[None]:
    """Let nobody wait for others in the body, who do nothing meanwhile."""

    def left(connection: sqlite3.Connection, path: Path, _patience_s: float) -> None:
        leave(connection, path, patience_s=0.0)

    with (
        patch("runner.journal.database.leave", left),
        patch("runner.journal.opening.LOCK_WAIT_S", 0.0),
    ):
        yield


def _checkpointed(evening: Evening) -> None:
    """A checkpoint waits for another that writes, and for nothing else."""
    with (
        _impatient(),
        open_journal(evening.journal) as journal,
        closing(sqlite3.connect(evening.journal, isolation_level=None)) as other,
    ):
        require(1, journal.checkpoint(), "a log that nobody else uses is not copied")
        other.execute("BEGIN IMMEDIATE")
        require(1, not journal.checkpoint(), "the log was copied while another was writing")
        other.execute("ROLLBACK")
        require(1, journal.checkpoint(), "a log that nobody else uses any more is not copied")


EVENINGS = (
    *(_backed_up, _damaged, _another_schema, _read_only, _lost, _of_an_earlier_build) * 3,
    *(_withdrawn, _checkpointed) * 3,
    _published,
)
"""What may be done, what takes long least often."""
