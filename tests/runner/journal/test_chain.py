"""The stored form of an event: what touchbeam cannot have written is damaged, whatever it is."""

import hashlib
import json
from datetime import UTC, datetime
from typing import Any

import pytest

from protocol.journal.events import StoredEvent
from runner.journal.store import (
    FIRST_HASH,
    NO_SALT,
    SALT_BYTES,
    DamagedError,
    chain_hash,
    chain_link,
    event_fields,
    payload_digest,
    payload_text,
)

NOON = "2026-01-01T12:00:00+00:00"
ROW = (3, "note", NOON, 1.5, '{"text": "x"}')
HASHES = ("digest", "hash", b"salt")
SALTED = "fc8634c026251255801e6ec38af346a7808cc68417986f4b57fc4ed8c419df54"
UNSALTED = "74320d521b6977345d62697a818f6e87081caa86bb48f3d9b375403dccecce45"
CHAINED = "1933f5cab65dc98cb58788298bdba53f873985e4f57b85ddedf2b3e79a969cf8"
EVENT = StoredEvent(
    seq=3,
    tag="note",
    utc=datetime(2026, 1, 1, 12, tzinfo=UTC),
    monotonic_s=1.5,
    payload={"text": "x"},
)


def stored_event(row: tuple[Any, ...]) -> StoredEvent:
    return chain_link((*row, *HASHES)).event


def test_a_row_is_the_event_that_was_stored() -> None:
    assert stored_event(ROW) == EVENT
    assert stored_event(ROW).erased is False
    erased = stored_event((*ROW[:4], None))
    assert (erased.payload, erased.erased) == ({}, True)


@pytest.mark.parametrize("place", range(5))
def test_a_column_of_another_type_is_damage(place: int) -> None:
    row: list[Any] = list(ROW)
    row[place] = b"3"
    with pytest.raises(DamagedError, match="is damaged: a column has another type"):
        stored_event(tuple(row))


@pytest.mark.parametrize(
    "payload",
    ['{"a": NaN}', '{"a": -Infinity}', "[]", "3", "", "[" * 30_000, f'{{"a": {"9" * 5000}}}'],
)
def test_a_payload_that_is_no_object_is_damage(payload: str) -> None:
    told = "^event 3 is damaged: its payload must be a JSON object$"
    with pytest.raises(DamagedError, match=told):
        stored_event((*ROW[:4], payload))


@pytest.mark.parametrize("text", ['"\\ud800"', f"{'[' * 300}{']' * 300}"])
def test_half_a_character_and_deep_nesting_are_read(text: str) -> None:
    payload = f'{{"a": {text}}}'
    assert stored_event((*ROW[:4], payload)).payload == json.loads(payload)


def test_a_time_that_is_none_is_damage() -> None:
    with pytest.raises(DamagedError, match=r"its time must be a date and a time, got 'noon'$"):
        stored_event((3, "note", "noon", 1.5, "{}"))


def test_a_time_without_a_zone_is_that_of_utc_and_another_zone_is_kept() -> None:
    assert stored_event((3, "note", "2026-01-01T12:00:00", 1.5, "{}")).utc == EVENT.utc
    kept = stored_event((3, "note", "2026-01-01T12:00:00+02:00", 1.5, "{}")).utc
    assert kept.isoformat() == "2026-01-01T12:00:00+02:00"


def test_a_link_has_the_payload_and_its_hashes() -> None:
    link = chain_link((*ROW, *HASHES))
    assert (link.event, link.payload) == (EVENT, ROW[4])
    assert (link.payload_sha256, link.hash, link.salt) == HASHES
    assert chain_link((*ROW[:4], None, "digest", "hash", None)).salt is None


@pytest.mark.parametrize(
    "hashes", [(b"digest", "hash", b"salt"), ("digest", None, b"salt"), ("digest", "hash", "salt")]
)
def test_hashes_of_another_type_are_damage(hashes: tuple[object, ...]) -> None:
    with pytest.raises(DamagedError, match="event 3 is damaged: a column has another type"):
        chain_link((*ROW, *hashes))


def test_the_hashes_are_those_of_the_documented_form() -> None:
    """They are written in every journal: a change would break every chain there is."""
    body = payload_text(EVENT)
    assert body == '{"text": "x"}'
    assert (
        payload_text(
            StoredEvent(seq=0, tag="t", utc=EVENT.utc, monotonic_s=0.0, payload={"b": "粗", "a": 1})
        )
        == '{"a": 1, "b": "粗"}'
    )
    digest = payload_digest(body, bytes(SALT_BYTES))
    assert digest == SALTED
    assert payload_digest(body, NO_SALT) == UNSALTED
    fields = event_fields("P01/1", EVENT, digest)
    assert fields == ("P01/1", 3, "note", NOON, 1.5, digest)
    assert chain_hash(FIRST_HASH, fields) == CHAINED


def test_a_payload_without_a_number_is_not_stored() -> None:
    event = StoredEvent(seq=0, tag="t", utc=EVENT.utc, monotonic_s=0.0, payload={"a": float("nan")})
    with pytest.raises(ValueError, match="not JSON compliant"):
        payload_text(event)


@pytest.mark.parametrize("monotonic_s", [0.0, -0.0, 1e22, 1e-7, 3, float("inf")])
@pytest.mark.parametrize("session", ["P01/1", "触觉\n\"'\\/1"])
def test_a_hash_is_that_of_the_json_list(session: str, monotonic_s: float) -> None:
    fields = (session, 3, "note", NOON, monotonic_s, "d" * 64)
    listed = json.dumps([FIRST_HASH, *fields]).encode()
    assert chain_hash(FIRST_HASH, fields) == hashlib.sha256(listed).hexdigest()
