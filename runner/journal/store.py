"""The journal: a study's events in one SQLite file, appended one by one and chained by hashes.

`runner.journal.opening` opens it, `runner.journal.store` defines the stored form of an event, and
`runner.journal.database` compares and checkpoints the file; docs/journal.md describes it.
"""

import hashlib
import json
import os
import secrets
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from datetime import UTC, datetime
from json.encoder import encode_basestring_ascii as _quoted
from math import isfinite
from pathlib import Path
from types import NoneType
from typing import Any, NamedTuple, NoReturn, Self, TypeVar

from pydantic_core import from_json

from protocol.errors import IMPOSSIBLE, WorkFailed
from protocol.journal.events import (
    DeviceOff,
    Event,
    SessionOpened,
    StoredEvent,
    TrialAborted,
    Withdrawn,
)
from protocol.journal.state import NotAllowed, SessionState, damage, folded, next_state
from runner.clock import Clock
from runner.journal import database
from runner.journal.database import RESTORE
from runner.signals import raise_if_stopped, stops_deferred

# The stored form of an event and the hash chain of a session.
#
# Each session has a chain of its own. The chain covers digests of the payloads, not the payloads
# themselves, so that it still verifies after a participant's data have been erased. Each digest
# begins with a random salt, erased with the payload, so that nobody can find the payload by
# trying.

FIRST_HASH = "0" * 64
SALT_BYTES = 16
_LONGEST_QUOTE = 80
NO_SALT = b""
"""The salt of each event in a journal of schema 2."""

# Sorted keys, so that a payload has one form, whatever the order of its fields. No NaN, because
# JSON has none and other programs could not read it.
_PAYLOAD = json.JSONEncoder(ensure_ascii=False, sort_keys=True, allow_nan=False)


class ChainLink(NamedTuple):
    """An event, its stored payload and salt (None if erased), and its hashes."""

    event: StoredEvent
    payload: str | None
    payload_sha256: str
    hash: str
    salt: bytes | None


class DamagedError(Exception):
    """A stored event that touchbeam cannot have written."""


def _reject_constant(text: str) -> NoReturn:
    raise ValueError(text)


_STORED = json.JSONDecoder(parse_constant=_reject_constant)

_LINK_TYPES = {
    (int, str, str, float, payload, str, str, salt)
    for payload in (str, NoneType)
    for salt in (bytes, NoneType)
}


def chain_link(row: tuple[Any, ...]) -> ChainLink:
    """Return the event in a row, its payload, digest, hash and salt, or raise `DamagedError`."""
    # One comparison for the whole row, because a journal may have 100,000 of them.
    if tuple(map(type, row)) not in _LINK_TYPES:  # a damaged file can hold other types
        raise DamagedError(f"event {row[0]!a} is damaged: a column has another type")
    seq, tag, utc, monotonic_s, body, digest, chained, salt = row
    payload = {} if body is None else _decoded(body)
    if not isinstance(payload, dict):
        raise DamagedError(f"event {seq} is damaged: its payload must be a JSON object")
    try:
        when = datetime.fromisoformat(utc)
    except ValueError:
        told = f"its time must be a date and a time, got {utc[:_LONGEST_QUOTE]!r}"
        raise DamagedError(f"event {seq} is damaged: {told}") from None
    event = StoredEvent(
        seq=seq,
        tag=tag,
        # An edited journal may lack the zone.
        utc=when if when.tzinfo else when.replace(tzinfo=UTC),
        monotonic_s=monotonic_s,
        payload=payload,
        erased=body is None,
    )
    return ChainLink(event, body, digest, chained, salt)


def _decoded(body: str) -> Any:
    """Return the payload; None if it cannot be read: Python's own words would help nobody."""
    try:
        # In less than half the time of json, which decides on whatever this one refuses: halves of
        # characters, deep nesting, and what is no JSON. What both read, both read alike.
        return from_json(body, allow_inf_nan=False)
    except (TypeError, ValueError):
        with suppress(ValueError, RecursionError):
            return _STORED.decode(body)
    return None


def payload_text(event: StoredEvent) -> str:
    return _PAYLOAD.encode(event.payload)


def payload_digest(body: str, salt: bytes) -> str:
    # An edited journal may hold halves of characters, which must give a digest and no error.
    return hashlib.sha256(salt + body.encode("utf-8", "surrogatepass")).hexdigest()


def event_fields(session: str, event: StoredEvent, digest: str) -> tuple[Any, ...]:
    """Return the fields of an event that its hash covers."""
    return (session, event.seq, event.tag, event.utc.isoformat(), event.monotonic_s, digest)


def chain_hash(previous: str, fields: tuple[Any, ...]) -> str:
    """Return the hash of an event: of its fields and the hash of the previous event."""
    return hashlib.sha256(_hashed(previous, fields).encode()).hexdigest()


def _hashed(previous: str, fields: tuple[Any, ...]) -> str:
    """Return both as one JSON list; ordinary fields in a quarter of the time that json takes."""
    session, seq, tag, utc, monotonic_s, digest = fields
    if type(seq) is int and type(monotonic_s) is float and isfinite(monotonic_s):
        texts = f"{_quoted(tag)}, {_quoted(utc)}, {monotonic_s!r}, {_quoted(digest)}"
        return f"[{_quoted(previous)}, {_quoted(session)}, {seq}, {texts}]"
    # Infinity and other types occur only in an edited journal, which must give a hash as well.
    return json.dumps([previous, *fields])


LOCK_WAIT_S = 2.0

_EVENTS = "SELECT seq, tag, utc, monotonic_s, payload, payload_sha256, hash, {} FROM event WHERE"
_SESSIONS = "SELECT session FROM event GROUP BY session ORDER BY min(rowid)"


class _Statements(NamedTuple):
    """The SQL in which the schemas differ."""

    append: str
    erase: str
    events: str


_SALTED = _Statements(
    "INSERT INTO event VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
    "UPDATE event SET payload = NULL, salt = NULL WHERE session = ?",
    _EVENTS.format("salt"),
)
_UNSALTED = _Statements(
    "INSERT INTO event VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
    "UPDATE event SET payload = NULL WHERE session = ?",
    _EVENTS.format("x''"),
)

_Kind = TypeVar("_Kind", bound=Event)
RandomBytes = Callable[[int], bytes]
"""Returns that number of random bytes."""


class JournalError(WorkFailed):
    """The journal cannot be read or written; no acknowledged event is lost."""


def damaged(session: str, why: str) -> JournalError:
    """Return the error of a session whose events touchbeam cannot have written."""
    return JournalError(f"session {session} cannot be read ({why}); {RESTORE}")


def state_of(session: str, events: Iterable[StoredEvent]) -> SessionState:
    """Return the state to which the events of a session lead, or raise `JournalError`."""
    try:
        return folded(events)
    except NotAllowed as error:
        raise damaged(session, str(error)) from error


class Journal:
    """The events of all sessions of one study.

    Erased payloads can be guessed from their digests unless it is `salted`, as schema 2 is not.
    A journal that is read from a copy (`is_copy`) leaves the file at its path alone.
    """

    def __init__(
        self,
        connection: sqlite3.Connection,
        path: Path,
        *,
        salted: bool = True,
        random_bytes: RandomBytes = secrets.token_bytes,
        lacking_triggers: Sequence[str] = (),
        patience_s: float = LOCK_WAIT_S,
        is_copy: bool = False,
    ) -> None:
        self.salted = salted
        self.lacking_triggers = tuple(lacking_triggers)
        self._sql = _SALTED if salted else _UNSALTED
        self._random_bytes = random_bytes
        self._connection = connection
        self._path = path
        self._patience_s = patience_s
        self._is_copy = is_copy
        self._places = (str(path), str(database.log_of(path)))
        self._files = _files_at(self._places)
        self._last_hashes: dict[tuple[str, int], str] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        # An error of the body takes precedence; the log keeps every event.
        if self._is_copy:
            self._connection.close()
            return
        hidden = nullcontext() if error is None else suppress(JournalError)
        with hidden, self._errors_explained("written"):
            database.leave(self._connection, self._path, self._patience_s)

    def sessions(self) -> list[str]:
        """Return the names of all chains, oldest first."""
        with self._errors_explained("read"):
            names = [name for (name,) in self._connection.execute(_SESSIONS)]
            if not all(isinstance(name, str) for name in names):
                raise DamagedError("the name of a session is damaged")
            return names

    def events(self, session: str) -> list[StoredEvent]:
        return [link.event for link in self.chain(session)]

    def events_of(self, *kinds: type[Event]) -> list[StoredEvent]:
        """Return the events of these kinds in all sessions, in the order of writing."""
        tags = [kind.TAG for kind in kinds]
        names = ", ".join("?" * len(tags))
        with self._errors_explained("read"):
            query = f"{self._sql.events} tag IN ({names}) ORDER BY rowid"
            return [chain_link(row).event for row in self._connection.execute(query, tags)]

    def records_of(self, *kinds: type[_Kind]) -> list[tuple[datetime, _Kind]]:
        """Return what all sessions hold of some kinds of event, each with its UTC."""
        records = []
        with self._errors_explained("read"):
            for event in (event for event in self.events_of(*kinds) if not event.erased):
                try:
                    record = event.record
                except IMPOSSIBLE as error:
                    raise DamagedError(damage([event])) from error
                # A session's plan is long, and judged where it is used.
                if not isinstance(record, SessionOpened) and (wrong := event.damage()):
                    raise DamagedError(wrong)
                if isinstance(record, kinds):
                    records.append((event.utc, record))
        return records

    def withdrawals(self) -> int:
        """Return how many sessions have been withdrawn so far."""
        with self._errors_explained("read"):
            query = "SELECT count(*) FROM event WHERE tag = ?"
            (count,) = self._connection.execute(query, (Withdrawn.TAG,)).fetchone()
        return int(count)

    def chain(self, session: str) -> Iterator[ChainLink]:
        """Yield the events of `session` with their hashes."""
        with self._errors_explained("read", f"session {session}, "):
            query = f"{self._sql.events} session = ? ORDER BY seq"
            yield from map(chain_link, self._connection.execute(query, (session,)))

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Exclude other writers while the body reads and then appends, all or nothing."""
        try:
            with self._errors_explained("written"), self._connection:
                self._connection.execute("BEGIN IMMEDIATE")  # takes the write lock before reading
                yield
        except BaseException:
            self._last_hashes.clear()  # of events that were rolled back
            raise

    def append(self, session: str, event: StoredEvent) -> None:
        """Add `event` to the chain of `session`: on the disk when this returns, or not at all."""
        self._require_in_place()
        body = payload_text(event)
        salt = self._random_bytes(SALT_BYTES) if self.salted else NO_SALT
        fields = event_fields(session, event, payload_digest(body, salt))
        with self._errors_explained("written"):
            chained = chain_hash(self._hash_before(session, event.seq), fields)
            stored = (salt, body) if self.salted else (body,)
            self._connection.execute(self._sql.append, (*fields, chained, *stored))
        if event.seq == 0:  # another process may have removed an unused journal: journal_if_used
            self._require_in_place()
        # Once SQLite has taken it; one is enough, since a session appends to its own chain alone.
        self._last_hashes = {(session, event.seq): chained}

    def erase_payloads(self, sessions: Iterable[str]) -> None:
        """Erase payloads and salts of `sessions`; `forget_erased` must follow to clear the disk."""
        with self._errors_explained("written"):
            self._connection.executemany(self._sql.erase, [(name,) for name in sessions])

    def forget_erased(self) -> None:
        """Remove all copies of erased payloads from the disk; if it fails, one may remain."""
        with self._errors_explained("written"):
            self._connection.execute("VACUUM")  # free pages still hold erased payloads
            busy = not self.checkpoint()  # the write-ahead log holds them, too
            # A log that is only started anew still has the old pages behind its new beginning.
            if not busy:
                busy, _, _ = self._connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
        if busy:
            raise JournalError(
                f"{self._path}: erased, but an old copy remains while another program reads it; "
                "end that program and repeat the command"
            )

    def checkpoint(self) -> bool:
        """Copy the log into the main file; False if another process prevents it, and the log grows.

        Raise `JournalError` if the main file alone lacks events afterwards.
        """
        self._require_in_place()
        # The hash that this process wrote: not everything is compared with what SQLite says.
        last = [(session, chained) for (session, _), chained in self._last_hashes.items()]
        with self._errors_explained("written"):
            return database.copied_log(self._connection, self._path, last[0] if last else None)

    def copy_to(self, new: Path) -> None:
        """Copy the journal as it is now into the empty file `new`, or raise `JournalError`."""
        with self._errors_explained(f"copied to {new.parent}"):
            database.copy_database(self._connection, new)

    def _require_in_place(self) -> None:
        """Require the open files at their paths: SQLite would write to files without names."""
        if _files_at(self._places) != self._files:
            raise JournalError(
                f"{self._path}: the journal file or its log {database.log_of(self._path).name} was "
                "deleted, moved or replaced while in use; restore both before you continue"
            )

    def _hash_before(self, session: str, seq: int) -> str:
        if seq == 0:
            return FIRST_HASH
        if (session, seq - 1) in self._last_hashes:  # events never change
            return self._last_hashes[session, seq - 1]
        row = self._connection.execute(
            "SELECT hash FROM event WHERE session = ? AND seq = ?", (session, seq - 1)
        ).fetchone()
        if row is None:
            raise JournalError(f"{self._path}: session {session} has no event {seq - 1}")
        return str(row[0])

    @contextmanager
    def _errors_explained(self, what: str, where: str = "") -> Iterator[None]:
        try:
            yield
        except (*database.SQLITE_ERRORS, DamagedError, database.LogNotCopiedError) as error:
            raise_if_stopped()  # SQLite takes the exception of a signal for its own interruption
            # SQLite repeats a text that it cannot decode, and that may be a person's answer.
            why = str(error).partition(" with text ")[0]
            damaged = isinstance(error, DamagedError)
            what_to_do = f"; {RESTORE}" if damaged else database.way_out(error)
            told = f"{self._path}: cannot be {what} ({where}{why}){what_to_do}"
            raise JournalError(told) from error


def _files_at(places: Iterable[str]) -> list[tuple[int, int]]:
    """Return device and inode numbers of the files there; the log, too, has part of the events."""
    files = []
    for place in places:
        with suppress(OSError):
            status = os.stat(place)  # noqa: PTH116 - Path.stat takes twice as long
            files.append((status.st_dev, status.st_ino))
    return files


class SessionLog:
    """Appends a session's events; `state` is the state that results from them."""

    def __init__(self, journal: Journal, session: str, clock: Clock) -> None:
        self.journal = journal
        self._session = session
        self._clock = clock
        # Nothing else is kept beside the events: what a resumed session knows follows from them.
        events = journal.events(session)
        self._next_seq = len(events)
        self.state: SessionState = state_of(session, events)

    def append(self, event: Event) -> None:
        """Store `event`, on the disk when this returns; raises `NotAllowed` if it may not come."""
        # Checked before it is stored, because an event can never be taken back.
        next_state(self.state.name, event.TAG)
        with stops_deferred():  # a signal between storing and counting would repeat the number
            self._store(event)

    def _store(self, event: Event) -> None:
        stored = StoredEvent(
            seq=self._next_seq,
            tag=event.TAG,
            utc=self._clock.utc(),
            monotonic_s=self._clock.monotonic_s(),
            payload=event.to_json(),
        )
        # Stored first: if this fails, the state is still that of the journal.
        self.journal.append(self._session, stored)
        self._next_seq += 1
        self.state.take(stored)


_WHY = "the session was interrupted"


def close_interrupted(log: SessionLog) -> None:
    """Record the interrupted trial as aborted and the device as unknown, under a session's lock."""
    # The trial first, because `device-off` is permitted only where no trial is running.
    abort_trial(log, _WHY)
    if log.state.name in {"armed", "paused", "driving"}:
        # Not confirmed: the process that could have read it back is gone.
        log.append(DeviceOff(confirmed=False, why=_WHY))


def abort_trial(log: SessionLog, why: str) -> None:
    """Record the running trial, if there is one, as aborted."""
    if log.state.trial is not None:
        log.append(TrialAborted(index=log.state.trial, why=why))
