"""The events of a session in the form in which they leave the study, and come back.

A session is a text of JSON lines: the first one has the session's place among the others, each
other one an event: its tag, the seconds since the session began, its time by the clock that never
runs backwards, and its payload. The time of day, the operator's notes, references of consents, the
device's address and how answers came about in the window stay behind.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from math import isfinite
from typing import Any

from protocol.errors import IMPOSSIBLE, BadInput
from protocol.journal import events
from protocol.journal.events import Event, Opening, StoredEvent
from protocol.journal.records import CHANNELS, InstructionResponse
from protocol.journal.state import NotAllowed, folded
from protocol.pseudonyms import pseudonym

FOLDER = "sourcedata/touchbeam"
STUDY_FILE = "study.toml"
REGISTRATION_FILE = "registration.toml"
SUFFIX = ".jsonl"
"""Where a data set holds the study file, its registration, and its sessions, a file each."""
UNKNOWN_UTC = datetime(1970, 1, 1, tzinfo=UTC)
"""When every session began whose time of day is not known."""
MOST_BYTES = 2**26
"""Of a session: two hours of touches that are recorded without a pause."""
_KINDS = ("participant", "rehearsal")
_SCORED = ("trial", "catch")
_MOST_SESSIONS = 999_999_999


@dataclass(frozen=True, kw_only=True)
class SharedSession:
    """A session that has come back: its place among the others, its events and their state."""

    place: int
    events: tuple[StoredEvent, ...]
    opened: Opening


def shared_text(place: int, chain: Sequence[StoredEvent]) -> str:
    """Return a session, which is the one at `place` in the study, counted from 0."""
    lines: list[object] = [{"place": place}]
    for stored in chain:
        event = _shared(stored.record)
        if event is not None:
            # Relative to the opening: the time of day stays behind.
            since_s = (stored.utc - chain[0].utc).total_seconds()
            lines.append([event.TAG, since_s, stored.monotonic_s, event.to_json()])
    return "".join(f"{json.dumps(line, ensure_ascii=False, allow_nan=False)}\n" for line in lines)


def shared_session(source: str, text: str) -> SharedSession:
    """Return the session in `text`; if it is none, a BadInput begins with the name `source`."""
    # Not `splitlines`, which also ends a line at U+2028, and a text may hold that.
    first, *lines = text.split("\n")[:-1] or [""]
    chain: list[StoredEvent] = []
    read = 0
    try:
        place = int(json.loads(first)["place"])
        for read, line in enumerate(lines, start=1):
            chain.append(_stored(read - 1, *json.loads(line)))
        opened = folded(chain).opened
    except (BadInput, NotAllowed, *IMPOSSIBLE) as error:
        own = isinstance(error, BadInput | NotAllowed)
        why = error if own else f"line {read + 1} is not one of a session"
        raise BadInput(f"{source}: cannot be read as a session of touchbeam ({why})") from error
    if opened is None:
        raise BadInput(f"{source}: must begin with the opening of a session")
    known = isinstance(opened, events.ScoresImported) or opened.kind in _KINDS
    # Only sessions of people leave a study: a sliding experiment has no participant.
    if not known or not 1 <= opened.session <= _MOST_SESSIONS:
        told = f"{opened.kind!r}, {opened.session}"
        raise BadInput(f"{source}: must be a numbered session of a participant, got {told}")
    for trial in (trial for terms in events.terms_in(chain) for trial in terms.trials):
        if trial.kind in _SCORED and trial.condition not in opened.conditions:
            told = f"trial {trial.index}, {trial.condition!r}"
            raise BadInput(f"{source}: a trial must be of one of the session's conditions, {told}")
    try:
        # A name becomes part of files and rows, so that a stranger's is judged as one's own.
        pseudonym(opened.participant)
    except BadInput as error:
        raise BadInput(f"{source}: {error}") from None
    return SharedSession(place=place, events=tuple(chain), opened=opened)


def _stored(
    seq: int, tag: str, since_s: float, monotonic_s: float, given: Mapping[str, Any]
) -> StoredEvent:
    # Judged once, here: everything behind it takes the journal's values as they are.
    if wrong := events.TAGS[tag].misfit(given):
        raise BadInput(f"{tag}, {wrong}")
    event = events.event_of(tag, given)
    if wrong := _out_of_range(event) or ("" if isfinite(monotonic_s) else f"time: {monotonic_s}"):
        raise BadInput(f"{tag}, {wrong}")
    payload = event.to_json()
    json.dumps(payload, allow_nan=False)  # refuses what no journal can hold
    return StoredEvent(
        seq=seq,
        tag=tag,
        utc=UNKNOWN_UTC + timedelta(seconds=since_s),
        monotonic_s=float(monotonic_s),
        payload=payload,
    )


def _out_of_range(event: Event) -> str:
    """Return a key whose value nobody can have measured, with the value; else nothing."""
    match event:
        case events.ResonanceMeasured(frequency_hz=hz) if hz <= 0:
            return f"frequency_hz: {hz}"
        case events.TouchRecorded(rate_hz=hz) if hz <= 0:
            return f"rate_hz: {hz}"
        case events.TouchRecorded(scale=scale, moved_s=moved_s, tare_n=tare_n) if (
            len(scale),
            len(moved_s),
            len(tare_n or (0.0, 0.0)),
        ) != (len(CHANNELS), 2, 2):
            return f"scale: {scale}, moved_s: {moved_s}, tare_n: {tare_n}"
    return ""


def _shared(event: Event) -> Event | None:
    """Return what leaves the study of `event`; None if nothing does."""
    match event:
        case events.NoteTaken() | events.WatchdogTested():
            return None
        case events.SessionOpened() | events.SessionResumed():
            return replace(event, consent=None)
        case events.TouchStarted(instruction=InstructionResponse() as response):
            return replace(event, instruction=replace(response, trace=None))
        case events.Answered():
            questions = tuple(replace(given, trace=None) for given in event.questions)
            return replace(event, traces=(), questions=questions)
        case events.QuestionAnswered():
            return replace(event, trace=None)
    return event
