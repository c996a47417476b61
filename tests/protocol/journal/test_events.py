"""Events of a journal: the same JSON is written and read by this build and by earlier ones."""

import json
from dataclasses import FrozenInstanceError
from datetime import UTC, datetime
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, get_args, get_origin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.journal.events import (
    EVENTS,
    TAGS,
    Answered,
    Event,
    ScoresImported,
    SessionOpened,
    SessionResumed,
    StoredEvent,
    TouchEnded,
    TouchStarted,
    event_of,
)
from protocol.journal.json_record import JsonRecord
from protocol.journal.records import Compliance, PlannedTrial, ReadBack, TraceSample
from protocol.journal.state import TRANSITIONS

_FLOATS = st.floats(allow_nan=False, allow_infinity=False)
_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | _FLOATS | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=5,
)
_OF_TYPE: dict[Any, st.SearchStrategy[Any]] = {
    Any: _JSON,
    bool: st.booleans(),
    int: st.integers(),
    float: _FLOATS,
    str: st.text(),
}


def values(hint: Any) -> st.SearchStrategy[Any]:
    """Return any value of a field of this type."""
    if hint in _OF_TYPE:
        return _OF_TYPE[hint]
    origin, parts = get_origin(hint), get_args(hint)
    if origin is UnionType:
        return st.none() | st.one_of([values(part) for part in parts if part is not NoneType])
    if origin is tuple:
        return st.lists(values(parts[0]), max_size=3).map(tuple)
    if origin is not None:
        return st.dictionaries(st.text(), values(parts[1]), max_size=3)
    if issubclass(hint, JsonRecord):
        return records(hint)
    return st.builds(hint, *[values(kind) for kind in hint.__annotations__.values()])


def records(record: type[JsonRecord]) -> st.SearchStrategy[Any]:
    """Return any record of this class."""
    return st.builds(record, **{key.name: values(key.type) for key in record.json_keys()})


@given(event=st.one_of([records(event) for event in EVENTS]))
def test_an_event_survives_the_journal(event: Event) -> None:
    payload = event.to_json()
    stored = json.loads(json.dumps(payload))
    assert stored == payload, "plain JSON, so that reading it gives the same again"
    assert event_of(event.TAG, stored) == event
    assert event_of(event.TAG, stored).to_json() == payload


PAYLOADS: dict[str, dict[str, Any]] = {
    "session-opened": {
        "participant": "P01",
        "session": 1,
        "kind": "participant",
        "study": "paper",
        "slot": 0,
        "sequence": ["pressure"],
        "conditions": ["pressure"],
        "study_sha256": "0" * 64,
        "study_text": "[study]",
        "trials": [
            {
                "index": 0,
                "block": 1,
                "kind": "trial",
                "condition": "pressure",
                "question": "strength",
                "expected": "stronger",
                "scored": True,
                "touches": [{"place": "path", "voltage_v": 100.0, "press": 1.0}],
                "level": 1.0,
                "opposite": False,
                "break_s": 0.0,
            }
        ],
        "language": "en",
        "consent": None,
        "seed": 1,
        "virtual": None,
        "versions": {"touchbeam": "0.1.0", "python": "3.11.7"},
        "answer_order": "forward",
    },
    "session-resumed": {
        "study_sha256": "0" * 64,
        "study_text": "[study]",
        "trials": [],
        "language": "zh",
        "consent": "A-7",
        "seed": 2,
        "virtual": None,
        "versions": {"touchbeam": "0.1.0", "python": "3.11.7"},
    },
    "practice-renewed": {"indices": [2, 3]},
    "device-armed": {
        "idn": "touchbeam,BOARD,SIM,1.1",
        "boot": 1,
        "device_time_s": 0.0,
        "dialect": "board",
        "cleared_errors": ['-113,"Undefined header"'],
        "remarks": [],
    },
    "watchdog-tested": {
        "tripped": True,
        "idn": "touchbeam,BOARD,SIM,1.1",
        "address": "sim",
    },
    "rig-described": {"answers": {"skin state": "dry"}},
    "beam-mounted": {"beam": "1 mm"},
    "resonance-measured": {"frequency_hz": 24068.8, "tip_m_per_v": 8.9e-09},
    "trial-started": {"index": 0, "kind": "baseline"},
    "touch-started": {
        "touch": 0,
        "commanded": {"voltage_v": 0.0, "frequency_hz": 24068.8, "ramp_v_per_s": 400.0},
        "instruction": {"answer": "ready", "reaction_time_s": 0.744, "trace": None},
    },
    "touch-recorded": {
        "source": "board",
        "rate_hz": 1000.0,
        "first_s": 6.25,
        "count": 1,
        "scale": [0.00025, 0.0005, 1e-05],
        "clock_offset_s": 1234.5,
        "clock_error_s": 0.0005,
        "moved_s": [1241.0, 1243.0],
        "tare_n": [0.01, -0.002],
        "saturated": 0,
        "sha256": "a86d12c6d26d3d32d5abdc7b8ec5d6b79e5ed1c2d2b1f6b6ed4c0d5a1b2c3d4e",
        "samples": "eAFjYGBgAAAABAAB",
        "touch": 0,
    },
    "touch-ended": {
        "touch": 0,
        "read_back": [
            {
                "output": True,
                "voltage_v": 0.0,
                "frequency_hz": 24068.80786,
                "monitor_v": -0.02,
                "force_n": 0.5,
                "position_m": 0.0415,
                "device_time_s": 6.25,
            }
        ],
        "trace": [[6.25, 0.5, 0.0415]],
        "judged": {"force_n": 0.5, "force_ok": True, "place_ok": None, "speed_ok": None},
    },
    "drive-started": {
        "commanded": {"voltage_v": 80.0, "frequency_hz": 24221.0, "ramp_v_per_s": 400.0}
    },
    "drive-ended": {"read_back": []},
    "answered": {
        "index": 4,
        "kind": "trial",
        "condition": "pressure",
        "change": "stronger",
        "agrees": True,
        "score": 7,
        "level": 1.0,
        "opposite": False,
        "reaction_time_s": [1.767, 2.0],
        "traces": [None, {"start": None, "changes": [[0.5, "7", "pointer"]]}],
        "judged": [{"force_n": 0.5, "force_ok": True, "place_ok": True, "speed_ok": False}],
        "questions": [
            {"name": "felt", "answer": ["warm", "wet"], "reaction_time_s": 1.5, "trace": None}
        ],
    },
    "question-answered": {
        "name": "age",
        "answer": 31,
        "reaction_time_s": 2.25,
        "trace": None,
        "when": "before",
        "block": None,
    },
    "trial-aborted": {"index": 4, "why": "repeated at the operator's wish"},
    "trial-deferred": {"index": 4, "missed": ["force", "speed"], "after": 6},
    "trials-not-needed": {"track": "detection", "indices": [31, 33]},
    "paused": {},
    "unpaused": {},
    "note": {"text": "the phone rang"},
    "window-changed": {"has_keys": False, "is_shown": True},
    "device-off": {"confirmed": True, "why": "end of session"},
    "session-completed": {},
    "trial-excluded": {"index": 4, "reason": "noise"},
    "trial-included": {"index": 4, "reason": "noise"},
    "session-excluded": {"reason": "fell asleep"},
    "session-included": {"reason": "fell asleep"},
    "withdrawn": {},
    "study-amended": {"study_sha256": "1" * 64, "reason": "shorter ramp"},
    "study-registered": {
        "registration": "3" * 64,
        "study_sha256": "1" * 64,
        "text": "a file",
    },
    "scores-imported": {
        "participant": "S1",
        "session": 1,
        "conditions": ["voltage", "pressure"],
        "scores": {"voltage": 7.5, "pressure": None},
        "source": "scores.csv",
        "source_sha256": "2" * 64,
    },
}
"""A payload of each event as stored in every journal; these must not change."""


def test_each_event_has_an_example_payload() -> None:
    assert list(PAYLOADS) == [event.TAG for event in EVENTS] == list(TAGS)


@pytest.mark.parametrize("tag", PAYLOADS)
def test_stored_payloads_are_read_and_written_unchanged(tag: str) -> None:
    event = event_of(tag, PAYLOADS[tag])
    assert json.dumps(event.to_json()) == json.dumps(PAYLOADS[tag]), "in the same order too"


@pytest.mark.parametrize("tag", PAYLOADS)
def test_nothing_that_was_stored_is_a_misfit(tag: str) -> None:
    assert TAGS[tag].misfit(PAYLOADS[tag]) == ""
    assert TAGS[tag].misfit({**PAYLOADS[tag], "later": [1]}) == ""


@pytest.mark.parametrize("tag", PAYLOADS)
def test_keys_of_later_builds_are_ignored(tag: str) -> None:
    def later(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: later(entry) for name, entry in value.items()} | {"later": [1]}
        return [later(entry) for entry in value] if isinstance(value, list) else value

    open_ended = {"versions", "answers", "scores", "touches", "traces"}  # whose keys are data
    payload = {
        name: later(entry) for name, entry in PAYLOADS[tag].items() if name not in open_ended
    }
    for trial in payload.get("trials", ()):
        del trial["touches"][0]["later"]
    kept = {name: entry for name, entry in PAYLOADS[tag].items() if name in open_ended}
    assert event_of(tag, {**payload, **kept, "later": 1}) == event_of(tag, PAYLOADS[tag])


@pytest.mark.parametrize("event", EVENTS)
def test_keys_that_earlier_builds_did_not_write_have_a_default(event: type[Event]) -> None:
    written = PAYLOADS[event.TAG]
    for key in event.json_keys():
        without = {name: value for name, value in written.items() if name != key.name}
        if key.key.required:
            with pytest.raises(KeyError, match=key.name):
                event.from_json(without)
        else:
            assert getattr(event.from_json(without), key.name) == key.key.missing


def test_events_of_earlier_builds_are_read_with_their_defaults() -> None:
    session = {"participant": "P01", "kind": "participant", "conditions": ["a"]}
    opened = SessionOpened.from_json(session)
    assert (opened.session, opened.slot, opened.study_text, opened.versions) == (1, None, None, {})
    table = ScoresImported.from_json({"participant": "S1", "conditions": [], "scores": {}})
    assert (table.session, table.kind, table.slot, table.trials) == (1, "published", None, ())
    assert SessionResumed.from_json({}).trials == ()
    answer = {"index": 1, "kind": "trial", "condition": "a", "score": None}
    answered = Answered.from_json(answer)
    assert (answered.level, answered.opposite, answered.reaction_time_s) == (1.0, False, ())
    touched = TouchEnded.from_json({"touch": 0})
    assert (touched.read_back, touched.trace, touched.judged.force_n) == ((), (), None)


def test_records_within_events_are_typed() -> None:
    opened = SessionOpened.from_json(PAYLOADS["session-opened"])
    assert isinstance(opened.trials[0], PlannedTrial)
    assert opened.trials[0].touches[0]["voltage_v"] == 100.0
    ended = TouchEnded.from_json(PAYLOADS["touch-ended"])
    assert isinstance(ended.read_back[0], ReadBack)
    assert ended.trace == (TraceSample(t_s=6.25, force_n=0.5, position_m=0.0415),)
    assert ended.judged == Compliance(force_n=0.5, force_ok=True, place_ok=None)
    begun = TouchStarted.from_json(PAYLOADS["touch-started"])
    assert begun.commanded.ramp_v_per_s == 400.0


@pytest.mark.parametrize(
    ("tag", "payload"),
    [
        ("answered", {"index": 1}),
        ("touch-ended", {"touch": 0, "trace": [[1.0]]}),
        ("touch-ended", {"touch": 0, "judged": 1}),
        ("practice-renewed", {"indices": 1}),
        ("session-opened", {**PAYLOADS["session-opened"], "trials": [1]}),
        ("no such event", {}),
    ],
)
def test_payloads_that_no_build_has_written_are_refused(tag: str, payload: dict[str, Any]) -> None:
    with pytest.raises((KeyError, TypeError, AttributeError), match=r"\w"):
        event_of(tag, payload)


@pytest.mark.parametrize(
    ("tag", "wrong", "told"),
    [
        ("answered", {"change": 1.5}, "answered, change"),
        ("answered", {"index": True}, "answered, index"),
        ("answered", {"judged": {"force_n": "x"}}, "answered, judged"),
        ("answered", {"judged": [{"force_n": "x"}]}, "answered, judged, force_n"),
        ("touch-ended", {"trace": [[1.0]]}, "touch-ended, trace"),
        ("touch-ended", {"trace": [[1.0, 2, "x"]]}, "touch-ended, trace"),
        ("session-opened", {"versions": {"touchbeam": 1}}, "session-opened, versions"),
        ("session-opened", {"trials": [1]}, "session-opened, trials"),
        ("resonance-measured", {"frequency_hz": 1e18}, "resonance-measured, frequency_hz"),
        ("note", {"text": ["x" * 99]}, "note, text"),
    ],
)
def test_a_value_of_another_type_is_named_by_its_keys_and_not_shown(
    tag: str, wrong: dict[str, Any], told: str
) -> None:
    noon = datetime(2026, 1, 1, 12, tzinfo=UTC)
    payload = {**PAYLOADS[tag], **wrong}
    stored = StoredEvent(seq=3, tag=tag, utc=noon, monotonic_s=1.5, payload=payload)
    assert stored.damage() == f"event 3 is damaged: {told} has a value that it cannot have"


def test_a_stored_event_gives_its_record() -> None:
    noon = datetime(2026, 1, 1, 12, tzinfo=UTC)
    stored = StoredEvent(
        seq=3, tag="answered", utc=noon, monotonic_s=1.5, payload=PAYLOADS["answered"]
    )
    assert isinstance(stored.record, Answered)
    assert stored.record.score == 7


def test_nobody_changes_what_was_recorded() -> None:
    answered = Answered.from_json(PAYLOADS["answered"])
    with pytest.raises(FrozenInstanceError):
        answered.score = 8  # type: ignore[misc]


ROOT = Path(__file__).parents[3]
SOURCES = {
    path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
    for package in ("protocol", "device", "runner", "analysis")
    for path in (ROOT / package).rglob("*.py")
}
COMMON_WORDS = {*TRANSITIONS.values(), "note"}
"""Tags that are also the name of a state or of an operator command."""


@pytest.mark.parametrize("tag", sorted(TAGS.keys() - COMMON_WORDS))
def test_a_tag_is_written_in_one_module(tag: str) -> None:
    quoted = {f'"{tag}"', f"'{tag}'"}
    holding = [name for name, text in SOURCES.items() if any(word in text for word in quoted)]
    assert holding == ["protocol/journal/events.py"]


def test_no_module_looks_up_a_key_of_a_payload() -> None:
    lookups = (".payload[", ".payload.get(")
    assert [name for name, text in SOURCES.items() if any(it in text for it in lookups)] == []
