"""What an attacker who has a withdrawn participant's journal finds by trying."""

import hashlib
import json
import sqlite3
from collections.abc import Callable, Iterable
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from protocol.journal.events import (
    Answered,
    DeviceArmed,
    Event,
    NoteTaken,
    RigDescribed,
    SessionOpened,
    TrialStarted,
)
from runner.clock import WallClock
from runner.journal.amendments import withdraw
from runner.journal.opening import open_journal, read_journal
from runner.journal.store import SALT_BYTES, SessionLog
from runner.journal.verification import verdicts
from tests.runner.journal.tampering import tampering
from tests.runner.journal.unsalted import make_unsalted

OPENED = SessionOpened.from_json(
    {
        "participant": "P01",
        "kind": "participant",
        "conditions": ["voltage"],
        "trials": [],
        "consent": "C-1742",
    }
)
ANSWERED = Answered.from_json(
    {"index": 0, "kind": "trial", "condition": "voltage", "change": "smoother", "score": 8}
)
SAID = (
    OPENED,
    DeviceArmed.from_json({"idn": "touchbeam,BOARD,1,1.1"}),
    RigDescribed(answers={"skin state": "dry"}),
    NoteTaken(text="cold hands"),
    TrialStarted(index=0, kind="trial"),
    ANSWERED,
)
SECRETS = (OPENED, ANSWERED, SAID[2], SAID[3])
DIGESTS = "SELECT payload_sha256 FROM event"
GUESSES: tuple[Event, ...] = (
    *(replace(OPENED, consent=f"C-{number:04d}") for number in range(10_000)),
    *(replace(ANSWERED, score=score) for score in range(11)),
    *(RigDescribed(answers={"skin state": state}) for state in ("dry", "normal", "moist")),
    *(NoteTaken(text=text) for text in ("tired", "cold hands", "the phone rang")),
)
"""All that the attacker does not know: one field of each event."""


def make_new(path: Path) -> None:
    open_journal(path).__exit__(None, None, None)


def withdrawn(path: Path, make: Callable[[Path], None]) -> list[bytes | None]:
    """Make a journal in which P01 withdraws and P02 stays; return the salts that P01 had."""
    make(path)
    with open_journal(path) as journal:
        others = (replace(OPENED, participant="P02", consent="C-2000"), *SAID[1:])
        for name, said in (("P01/1", SAID), ("P02/1", others)):
            log = SessionLog(journal, name, WallClock())
            for event in said:
                log.append(event)
        salts = [link.salt for link in journal.chain("P01/1")]
        withdraw(journal, WallClock(), "P01")
        assert all(verdict.ok for verdict in verdicts(journal))
        assert_gone(path.parent, [b"C-1742", *filter(None, salts)])
    assert_gone(path.parent, [b"C-1742", *filter(None, salts)])
    return salts


def assert_gone(folder: Path, secrets: Iterable[bytes]) -> None:
    """Require that no file holds any of `secrets`, neither the journal nor its log and index."""
    held = b"".join(path.read_bytes() for path in folder.iterdir())
    assert not [secret for secret in secrets if secret in held]


def found(path: Path) -> tuple[Event, ...]:
    """Return the guesses that a digest of P01 confirms, under any salt that is left."""
    with closing(sqlite3.connect(path)) as file:
        left = {row[0] for row in file.execute(f"{DIGESTS} WHERE session = 'P01/1'")}
        columns = [row[1] for row in file.execute("PRAGMA table_info(event)")]
        rows = file.execute("SELECT salt FROM event") if "salt" in columns else ()
        salts = {b"", *(salt for (salt,) in rows if salt)}
    return tuple(guess for guess in GUESSES if left & digests(guess, salts))


def digests(guess: Event, salts: Iterable[bytes]) -> set[str]:
    """Return the digest of an event under each of `salts`."""
    text = json.dumps(guess.to_json(), ensure_ascii=False, sort_keys=True).encode()
    return {hashlib.sha256(salt + text).hexdigest() for salt in salts}


def test_what_a_withdrawn_participant_gave_cannot_be_found_by_trying(tmp_path: Path) -> None:
    withdrawn(tmp_path / "study.db", make_new)
    assert found(tmp_path / "study.db") == ()


def test_without_salts_it_is_found(tmp_path: Path) -> None:
    withdrawn(tmp_path / "study.db", make_unsalted)
    assert found(tmp_path / "study.db") == SECRETS


def test_who_had_kept_the_salts_finds_it(tmp_path: Path) -> None:
    """Only the erased salts stand between an attacker and the answer."""
    path = tmp_path / "study.db"
    salt = withdrawn(path, make_new)[0]
    with closing(sqlite3.connect(path)) as file:
        (left,) = file.execute(f"{DIGESTS} WHERE session = 'P01/1' AND seq = 0").fetchone()
    assert salt is not None
    assert digests(OPENED, [salt]) == {left}


def test_each_event_has_a_salt_of_its_own(tmp_path: Path) -> None:
    salts = withdrawn(tmp_path / "study.db", make_new)
    assert len({salt for salt in salts if salt}) == len(SAID)


def test_the_salts_come_from_the_given_source(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db", lambda size: b"7" * size) as journal:
        SessionLog(journal, "P01/1", WallClock()).append(OPENED)
        (link,) = journal.chain("P01/1")
    assert link.salt == b"7" * SALT_BYTES
    assert {link.payload_sha256} == digests(OPENED, [link.salt])


def test_a_journal_without_salts_is_continued_without_them(tmp_path: Path) -> None:
    path = tmp_path / "study.db"
    make_unsalted(path)
    with open_journal(path, lambda _: pytest.fail("no salt is needed")) as journal:
        log = SessionLog(journal, "P01/1", WallClock())
        for event in SAID:
            log.append(event)
    with read_journal(path) as again:
        assert not again.salted
        assert [event.record for event in again.events("P01/1")] == list(SAID)
        assert verdicts(again)[0].chain_ok
        assert {link.payload_sha256 for link in again.chain("P01/1")} == set().union(
            *(digests(event, [b""]) for event in SAID)
        )


def test_a_withdrawal_that_left_salts_is_found(tmp_path: Path) -> None:
    path = tmp_path / "study.db"
    withdrawn(path, make_new)
    with tampering(path) as file:
        file.execute("UPDATE event SET salt = zeroblob(16) WHERE session = 'P01/1' AND seq = 0")
    with read_journal(path) as journal:
        assert verdicts(journal)[0].problem.startswith("withdrawn but not erased")
