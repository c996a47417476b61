"""The stored form of an event and the hash chain of a session.

Each session has a chain of its own. The chain covers digests of the payloads, not the payloads
themselves, so that it still verifies after a participant's data have been erased. Each digest
begins with a random salt, erased with the payload, so that nobody can find the payload by trying.
"""

import hashlib
import json
from datetime import UTC, datetime
from json.encoder import encode_basestring_ascii as _quoted
from math import isfinite
from types import NoneType
from typing import Any, NamedTuple, NoReturn

from protocol.journal.events import StoredEvent

FIRST_HASH = "0" * 64
SALT_BYTES = 16
NO_SALT = b""
"""The salt of each event in a journal of schema 2."""

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


def _with_zone(when: datetime) -> datetime:
    """Return `when` with UTC as its zone if the zone is missing from an edited journal."""
    return when if when.tzinfo else when.replace(tzinfo=UTC)


def _reject_constant(text: str) -> NoReturn:
    raise ValueError(f"{text} is not a number")


_STORED = json.JSONDecoder(parse_constant=_reject_constant)

_EVENT_TYPES = {(int, str, str, float, str), (int, str, str, float, NoneType)}
_HASH_TYPES = {(str, str, bytes), (str, str, NoneType)}
_LINK_TYPES = {(*event, *hashes) for event in _EVENT_TYPES for hashes in _HASH_TYPES}


def stored_event(row: tuple[Any, ...]) -> StoredEvent:
    """Return the event in a row of number, tag, UTC time, monotonic seconds and payload.

    Raises:
        DamagedError: touchbeam cannot have written the row.
    """
    if tuple(map(type, row)) not in _EVENT_TYPES:  # a damaged file can hold other types
        raise DamagedError(f"event {row[0]!a} is damaged: a column has another type")
    return _event(*row)


def chain_link(row: tuple[Any, ...]) -> ChainLink:
    """Return the event in a row as for `stored_event`, followed by its digest, hash and salt.

    Raises:
        DamagedError: touchbeam cannot have written the row.
    """
    if tuple(map(type, row)) not in _LINK_TYPES:
        event = stored_event(row[:5])
        raise DamagedError(f"event {event.seq} is damaged: its hashes or salt have another type")
    seq, tag, utc, monotonic_s, body, digest, chained, salt = row
    event = _event(seq, tag, utc, monotonic_s, body)
    return ChainLink(event, body, digest, chained, salt)


def _event(seq: int, tag: str, utc: str, monotonic_s: float, body: str | None) -> StoredEvent:
    """Return the event of these columns, which have the right types."""
    try:
        payload = {} if body is None else _decoded(body)
        when = datetime.fromisoformat(utc)
    except (ValueError, OverflowError, RecursionError) as error:
        raise DamagedError(f"event {seq} is damaged: {error}") from error
    if not isinstance(payload, dict):
        raise DamagedError(f"event {seq} is damaged: its payload must be an object")
    return StoredEvent(
        seq=seq,
        tag=tag,
        utc=when if when.tzinfo else _with_zone(when),
        monotonic_s=monotonic_s,
        payload=payload,
        erased=body is None,
    )


def _decoded(body: str) -> Any:
    """Return the JSON value in `body`."""
    try:
        # Spaces around the value, which touchbeam never writes, take `decode` half its time.
        value, end = _STORED.raw_decode(body)
    except json.JSONDecodeError:
        end = -1
    return value if end == len(body) else _STORED.decode(body)


def payload_text(event: StoredEvent) -> str:
    """Return the payload of `event` as stored text."""
    return _PAYLOAD.encode(event.payload)


def payload_digest(body: str, salt: bytes) -> str:
    """Return the digest of the stored payload `body` and its salt."""
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
    return json.dumps([previous, *fields])
