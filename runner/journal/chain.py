"""How an event is stored, and what ties it to the one before.

Each session has a chain of its own. The chain hashes digests of the payloads, not the payloads:
what a participant gave can be erased and the chain still verifies.
"""

import hashlib
import json
from datetime import UTC, datetime
from typing import Any, NamedTuple, NoReturn

from protocol.journal.events import StoredEvent

FIRST_HASH = "0" * 64

_PAYLOAD = json.JSONEncoder(ensure_ascii=False, sort_keys=True, allow_nan=False)


class ChainLink(NamedTuple):
    """An event, its payload as it is stored (None: erased), and what ties it to the others."""

    event: StoredEvent
    payload: str | None
    payload_sha256: str
    hash: str


class DamagedError(Exception):
    """An event that no touchbeam has written."""


def _with_zone(when: datetime) -> datetime:
    """All times are UTC, also where somebody has taken away that it says so."""
    return when if when.tzinfo else when.replace(tzinfo=UTC)


def _no_number(text: str) -> NoReturn:
    raise ValueError(f"{text} is no number")


_STORED = json.JSONDecoder(parse_constant=_no_number)


def stored_event(row: tuple[Any, ...]) -> StoredEvent:
    """Return the event of a row: number, tag, time, seconds, payload.

    Raises:
        DamagedError: no touchbeam has written it.
    """
    seq, tag, utc, monotonic_s, body = row
    try:
        payload = {} if body is None else _STORED.decode(body)
        when = _with_zone(datetime.fromisoformat(utc))
    except (ValueError, RecursionError) as error:
        raise DamagedError(f"event {seq} is damaged: {error}") from error
    if not isinstance(payload, dict):
        raise DamagedError(f"event {seq} is damaged: its payload must be an object")
    return StoredEvent(
        seq=seq,
        tag=tag,
        utc=when,
        monotonic_s=monotonic_s,
        payload=payload,
        erased=body is None,
    )


def payload_text(event: StoredEvent) -> str:
    """Return the payload of `event` as it is stored."""
    return _PAYLOAD.encode(event.payload)


def event_fields(session: str, event: StoredEvent, digest: str) -> tuple[object, ...]:
    """Return what of an event the chain's hash covers."""
    return (session, event.seq, event.tag, event.utc.isoformat(), event.monotonic_s, digest)


def chain_hash(previous: str, fields: tuple[object, ...]) -> str:
    """Return the hash that ties an event to the one before it."""
    return hashlib.sha256(json.dumps([previous, *fields]).encode()).hexdigest()
