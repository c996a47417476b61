"""Verdicts on chains, one rule at a time."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from protocol.errors import BadInput
from protocol.journal.events import (
    DeviceArmed,
    Event,
    NoteTaken,
    SessionOpened,
    SessionResumed,
    StoredEvent,
    StudyAmended,
    StudyRegistered,
    Withdrawn,
)
from runner.journal import store
from runner.journal.amendments import exclude
from runner.journal.database import RESTORE
from runner.journal.names import STUDY_CHAIN
from runner.journal.opening import open_journal
from runner.journal.store import ChainLink, Journal, JournalError, SessionLog
from runner.journal.verification import (
    SessionVerdict,
    chain_is_unbroken,
    in_force,
    readable_chains,
    readable_events,
    session_verdict,
    touchbeam_versions,
    verdicts,
)
from runner.session.loop import run
from tests.protocol.studies import TRACKS
from tests.runner.fakes import IMPORTED, FakeClock, FakeDevice, FakeParticipant, context
from tests.runner.journal.tampering import tampering

DAMAGED, CANNOT = "is damaged: study-", "has a value that it cannot have"

GOOD = SessionVerdict(
    participant="P01",
    session=1,
    kind="participant",
    state="completed",
    events=9,
    trials_planned=7,
    trials_answered=7,
    trials_aborted=1,
    duplicates=0,
    missing=0,
    chain_ok=True,
)


def begun(journal: Journal) -> SessionLog:
    """A session that was opened."""
    return context(journal, FakeDevice(), FakeParticipant()).log


def logged(journal: Journal, session: str, *events: Event) -> None:
    log = SessionLog(journal, session, FakeClock())
    for event in events:
        log.append(event)


@pytest.mark.parametrize(
    ("verdict", "ok"),
    [
        (GOOD, True),
        (replace(GOOD, missing=1), False),
        (replace(GOOD, missing=1, state="armed"), True),
        (replace(GOOD, missing=0, state="armed"), True),
        (replace(GOOD, duplicates=1), False),
        (replace(GOOD, problem="damaged"), False),
        (replace(GOOD, chain_ok=False), False),
    ],
)
def test_a_verdict_is_good_without_any_problem(verdict: SessionVerdict, ok: bool) -> None:
    assert verdict.ok is ok
    assert verdict.record()["ok"] is ok
    assert verdict.record()["state"] == verdict.state
    assert verdict.line().startswith("ok    " if ok else "FAIL  ")


SAYS = "7 of 7 trials answered, 1 aborted, 0 answered twice"


@pytest.mark.parametrize(
    ("verdict", "line"),
    [
        (GOOD, f"ok    P01/1  completed  {SAYS}, chain unbroken"),
        (
            replace(GOOD, chain_ok=False),
            f"FAIL  P01/1  completed  {SAYS}, CHAIN BROKEN; {RESTORE}",
        ),
        (
            replace(GOOD, chain_ok=False, problem=f"lost; {RESTORE}"),
            f"FAIL  P01/1  completed  {SAYS}, CHAIN BROKEN; lost; {RESTORE}",
        ),
        (
            replace(GOOD, problem="lost"),
            f"FAIL  P01/1  completed  {SAYS}, chain unbroken; lost",
        ),
        (
            replace(GOOD, kind="rehearsal", versions=("1.0",)),
            f"ok    P01/1 (rehearsal)  completed  {SAYS}, chain unbroken",
        ),
        (
            replace(GOOD, versions=("1.0", "1.1"), problem="lost"),
            f"FAIL  P01/1  completed  {SAYS}, chain unbroken; "
            "written by several versions of touchbeam: 1.0, 1.1; lost",
        ),
        (
            replace(GOOD, participant="slide", kind="slide"),
            f"ok    slide/1  completed  {SAYS.replace('trials answered', 'passes drawn')}, "
            "chain unbroken",
        ),
        (
            replace(GOOD, participant=STUDY_CHAIN, state="amended", events=1),
            "ok    the study itself  amended  1 event, chain unbroken",
        ),
        (
            replace(GOOD, participant=STUDY_CHAIN, state="amended", events=2),
            "ok    the study itself  amended  2 events, chain unbroken",
        ),
    ],
)
def test_a_verdict_is_one_line(verdict: SessionVerdict, line: str) -> None:
    assert verdict.line() == line


@pytest.mark.parametrize(("running", "state"), [("P01/1", "running"), ("P01/2", "interrupted")])
def test_an_unfinished_session_is_called_as_status_calls_it(running: str, state: str) -> None:
    for unfinished in ("idle", "armed", "paused", "trial", "touching"):
        said = replace(GOOD, state=unfinished).line({running})
        assert said == f"ok    P01/1  {state}  {SAYS}, chain unbroken"


def version_of(event: Event, **versions: object) -> StoredEvent:
    payload = {**event.to_json(), "versions": versions}
    return StoredEvent(
        seq=0, tag=event.TAG, utc=FakeClock().utc(), monotonic_s=0.0, payload=payload
    )


def test_the_versions_are_those_of_openings_in_order(journal: Journal) -> None:
    opened = begun(journal).state.opened
    assert opened is not None
    made = [
        version_of(opened, touchbeam="1.0"),
        version_of(NoteTaken(text="x"), touchbeam="7.0"),
        version_of(opened, touchbeam="1.0"),
        version_of(opened, touchbeam="1.1"),
        version_of(opened, touchbeam="\x1b[2J"),
        version_of(opened, touchbeam=3),
        version_of(opened, python="3.11"),
        replace(version_of(opened), payload={"versions": 3}),
        version_of(opened, touchbeam="1.0"),
    ]
    assert touchbeam_versions(made) == ("1.0", "1.1", "1.0")


def test_a_resumed_session_tells_its_version(journal: Journal) -> None:
    log = begun(journal)
    assert log.state.opened is not None
    (event,) = journal.events("P01/1")
    payload = {
        key: value
        for key, value in {**event.payload, "versions": {"touchbeam": "9.9"}}.items()
        if key in {"study_sha256", "study_text", "trials", "language", "seed", "versions"}
    }
    resumed = replace(event, tag=SessionResumed.TAG, payload=payload)
    assert touchbeam_versions([resumed]) == ("9.9",)


def test_the_verdict_counts_what_the_session_has(journal: Journal) -> None:
    begun(journal).append(DeviceArmed(idn="fake", boot=1, device_time_s=0.0))
    logged(journal, "1/1", IMPORTED)
    session, imported = verdicts(journal)
    assert (session.state, session.kind, session.events) == ("armed", "participant", 2)
    assert (session.trials_planned, session.trials_answered, session.missing) == (7, 0, 7)
    assert session.problem == ""
    assert session.ok
    assert (imported.kind, imported.trials_planned) == ("published", 0)
    assert imported.line() == "ok    1/1  completed  1 event, chain unbroken", "it has no trials"


def test_what_an_edited_registration_raises_is_the_problem(
    journal: Journal, monkeypatch: pytest.MonkeyPatch
) -> None:
    def edited(*_: object) -> str:
        raise KeyError("registered")

    begun(journal)
    monkeypatch.setattr("runner.journal.verification.session_problem", edited)
    (verdict,) = verdicts(journal)
    told = "its events do not fit together"
    assert (verdict.problem, verdict.ok, verdict.chain_ok) == (told, False, True)


def test_a_chain_without_events_is_not_unbroken(journal: Journal) -> None:
    verdict = session_verdict("P01/1", [])
    assert (verdict.chain_ok, verdict.kind, verdict.state) == (False, "unknown", "new")


def links(journal: Journal) -> list[ChainLink]:
    log = begun(journal)
    log.append(NoteTaken(text="a"))
    log.append(NoteTaken(text="b"))
    return list(journal.chain("P01/1"))


def test_a_chain_is_broken_by_any_change_of_any_link(journal: Journal) -> None:
    chain = links(journal)
    assert chain_is_unbroken("P01/1", chain, erased=False)
    assert not chain_is_unbroken("P02/1", chain, erased=False)
    for place, link in enumerate(chain):
        for changed in (
            link._replace(event=replace(link.event, seq=link.event.seq + 1)),
            link._replace(event=replace(link.event, tag="x")),
            link._replace(hash="0" * 64),
            link._replace(payload_sha256="0" * 64),
            link._replace(payload="{}"),
            link._replace(salt=None),
            link._replace(salt=b"0" * 16),
            link._replace(payload=None),
        ):
            wrong = [*chain[:place], changed, *chain[place + 1 :]]
            assert not chain_is_unbroken("P01/1", wrong, erased=False), changed
    assert not chain_is_unbroken("P01/1", chain[1:], erased=False)
    without = [link._replace(payload=None, salt=None) for link in chain]
    assert chain_is_unbroken("P01/1", without, erased=True)
    assert not chain_is_unbroken("P01/1", without, erased=False)


def test_a_withdrawn_session_must_be_erased_with_its_salts(journal: Journal) -> None:
    links(journal)
    logged(journal, "P01/1", Withdrawn())
    chain = list(journal.chain("P01/1"))
    left = "withdrawn but not erased; run touchbeam withdraw again"

    def told(kept: list[ChainLink]) -> str:
        return session_verdict("P01/1", kept).problem

    erased = [
        link._replace(event=replace(link.event, payload={}, erased=True), payload=None, salt=None)
        for link in chain
    ]
    assert told(erased) == ""
    assert told(chain) == left
    assert told([*erased[:-1], chain[-1]]) == left
    assert told([erased[0]._replace(salt=b"x" * 16), *erased[1:]]) == left


def test_what_cannot_be_read_is_refused_by_name(journal: Journal, tmp_path: Path) -> None:
    links(journal)
    assert len(readable_events(journal, "P01/1")) == 3
    with tampering(tmp_path / "study.db") as other:
        other.execute("UPDATE event SET payload = NULL WHERE seq = 1")
    lost = re.escape(f"session P01/1 cannot be read (it has lost payloads); {RESTORE}")
    with pytest.raises(JournalError, match=lost):
        readable_events(journal, "P01/1")
    with pytest.raises(JournalError, match=lost):
        list(readable_chains(journal, []))


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ("UPDATE event SET tag = 'note' WHERE seq = 0", "it has no opening event"),
        ("UPDATE event SET payload = '{}' WHERE seq = 0", "it has no opening event"),
        ("UPDATE event SET seq = 9 - seq", "it has no opening event"),
        (
            "UPDATE event SET tag = 'device-off' WHERE seq = 1",
            "event 1: a session that is idle does not allow the event 'device-off'",
        ),
        (
            "UPDATE event SET payload = json_set(payload, '$.trials', 5) WHERE seq = 0",
            "event 0 is damaged: session-opened, trials has a value that it cannot have",
        ),
    ],
)
def test_a_session_without_its_beginning_is_refused(
    journal: Journal, tmp_path: Path, change: str, why: str
) -> None:
    links(journal)
    with tampering(tmp_path / "study.db") as other:
        other.execute(change)
    for read in (
        lambda: readable_events(journal, "P01/1"),
        lambda: list(readable_chains(journal, [])),
    ):
        with pytest.raises(JournalError) as error:
            read()
        assert str(error.value) == f"session P01/1 cannot be read ({why}); {RESTORE}"


def test_a_value_that_cannot_be_is_named_once_the_chain_is_broken(
    journal: Journal, tmp_path: Path
) -> None:
    links(journal)
    with tampering(tmp_path / "study.db") as other:
        other.execute("UPDATE event SET payload = '{\"text\": 1.5}' WHERE seq = 2")
    with pytest.raises(JournalError, match=r"^session P01/1 .*event 2 is damaged: note, text ha"):
        list(readable_chains(journal, []))


def test_a_session_without_events_is_refused_and_one_with_what_readers_need_is_read(
    journal: Journal, tmp_path: Path
) -> None:
    with pytest.raises(JournalError, match=r"^session P09/1 .*\(it has no opening event\)"):
        readable_events(journal, "P09/1")
    links(journal)
    opened = journal.events("P01/1")[0].payload
    needed = {key: opened[key] for key in SessionOpened.REQUIRED}
    with tampering(tmp_path / "study.db") as other:
        other.execute("UPDATE event SET payload = ? WHERE seq = 0", [json.dumps(needed)])
    assert len(readable_events(journal, "P01/1")) == 3


def test_readable_are_sessions_imported_scores_the_study_and_the_withdrawn(
    journal: Journal, tmp_path: Path
) -> None:
    links(journal)
    logged(journal, "1/1", IMPORTED)
    logged(journal, STUDY_CHAIN, StudyAmended(study_sha256="x", reason="y", breaks=None))
    logged(journal, "P02/1", begun_elsewhere(tmp_path), Withdrawn())
    journal.erase_payloads(["P02/1"])
    broken: list[str] = []
    assert [len(events) for events in readable_chains(journal, broken)] == [3, 1, 1, 2]
    assert broken == []
    assert [len(events) for events in readable_chains(journal, broken, "1")] == [1]
    assert list(readable_chains(journal, broken, "P")) == []
    with tampering(tmp_path / "study.db") as other:
        other.execute("UPDATE event SET hash = 'x' WHERE session = 'P01/1' AND seq = 1")
    assert len(list(readable_chains(journal, broken))) == 4
    assert broken == ["P01/1"]


@pytest.mark.parametrize("wrong", [None, 5, [], {}])
def test_a_decision_on_the_study_of_another_type_is_named_under_an_unbroken_chain(
    journal: Journal, wrong: Any
) -> None:
    logged(journal, STUDY_CHAIN, StudyAmended(study_sha256="x", reason=wrong))
    assert in_force(journal) is None
    (verdict,) = verdicts(journal)
    assert (verdict.chain_ok, verdict.problem) == (
        True,
        f"event 0 {DAMAGED}amended, reason {CANNOT}",
    )
    logged(journal, STUDY_CHAIN, StudyRegistered(registration="7", study_sha256="8", text=wrong))
    with pytest.raises(JournalError, match=f"event 1 {DAMAGED}registered, text {CANNOT}"):
        in_force(journal)
    with pytest.raises(JournalError, match=f"event 0 {DAMAGED}amended, reason {CANNOT}"):
        list(readable_chains(journal, []))


def begun_elsewhere(folder: Path) -> Event:
    with open_journal(folder / "other.db") as other:
        opened = begun(other).state.opened
    assert opened is not None
    return opened


def answers_of(journal: Journal, track: str) -> list[int]:
    """Where the answers to trials of a track stand in the journal."""
    events = (event for event in journal.events("P01/1") if event.tag == "answered")
    return [event.seq for event in events if event.payload["track"]["name"] == track]


def rewritten(journal: Journal, path: Path, seq: int, **changes: object) -> None:
    """Change keys of an event's payload, with all hashes as if it had always said so."""
    chain = list(journal.chain("P01/1"))
    previous = store.FIRST_HASH
    with tampering(path) as other:
        for place, link in enumerate(chain):
            event = link.event
            if place == seq:
                event = replace(event, payload={**event.payload, **changes})
            body, salt = store.payload_text(event), link.salt
            assert salt is not None
            digest = store.payload_digest(body, salt)
            hashed = store.chain_hash(previous, store.event_fields("P01/1", event, digest))
            previous = hashed
            other.execute(
                "UPDATE event SET payload = ?, payload_sha256 = ?, hash = ? WHERE seq = ?",
                (body, digest, hashed, place),
            )


def test_a_trial_that_a_stop_left_out_cannot_be_excluded(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        run(context(journal, FakeDevice(), FakeParticipant(), TRACKS))
        (stop,) = [it.payload for it in journal.events("P01/1") if it.tag == "trials-not-needed"]
        (name, *_), clock = stop["indices"], FakeClock()
        with pytest.raises(BadInput, match=f"trial {name} of P01/1 was not made, because its"):
            exclude(journal, clock, "P01/1", "a slip", name)
        with pytest.raises(BadInput, match="has no trial 27; it has trials 0 to 26"):
            exclude(journal, clock, "P01/1", "a slip", 27)


@pytest.mark.parametrize(
    ("name", "place", "changes"),
    [
        ("stairs", 1, {"level": 3, "value": 19.9526231496888}),
        ("stairs", 0, {"correct": False}),
        ("felt", 2, {"level": 2}),
        ("odd one", 0, {"correct": True}),
        ("odd one", 4, {"value": 50.0}),
    ],
)
def test_a_level_that_does_not_follow_from_the_answers_before_is_told(
    tmp_path: Path, name: str, place: int, changes: dict[str, object]
) -> None:
    path = tmp_path / "study.db"
    with open_journal(path) as journal:
        made = context(journal, FakeDevice(), FakeParticipant(changes=()), TRACKS)
        run(made)
        (verdict,) = verdicts(journal)
        assert verdict.ok, verdict.problem
        assert verdict.trials_planned == verdict.trials_answered
        seq = answers_of(journal, name)[place]
        track = journal.events("P01/1")[seq].payload["track"]
        rewritten(journal, path, seq, track={**track, **changes})
        (verdict,) = verdicts(journal)
        assert verdict.chain_ok
        assert not verdict.ok
        assert f"of the track {name!r} was made at level" in verdict.line()
        assert "the answers before it lead to level" in verdict.line()


def test_tracks_of_a_study_file_that_is_refused_cannot_be_followed(tmp_path: Path) -> None:
    path = tmp_path / "study.db"
    with open_journal(path) as journal:
        run(context(journal, FakeDevice(), FakeParticipant(changes=()), TRACKS))
        rewritten(journal, path, 0, study_text=f"{TRACKS}\n[of_another_version]\n")
        (verdict,) = verdicts(journal)
    told = "the levels of its tracks cannot be followed (study.toml"
    assert verdict.problem.startswith(told), verdict.problem
    assert "got 'of_another_version'" in verdict.problem
