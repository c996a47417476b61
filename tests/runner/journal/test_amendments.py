"""Exclusions, amendments and withdrawals, and the status that results from them."""

import json
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from protocol.errors import BadInput
from protocol.journal.events import (
    DeviceArmed,
    NoteTaken,
    SessionOpened,
    TrialStarted,
    Withdrawn,
    event_of,
)
from protocol.study_file.loading import template
from runner.clock import WallClock
from runner.journal.amendments import (
    amend,
    exclude,
    include,
    sessions_of,
    unerased,
    withdraw,
)
from runner.journal.cohort import Arrival, session_summaries, states
from runner.journal.opening import open_journal, read_journal
from runner.journal.store import Journal, JournalError, SessionLog
from runner.journal.verification import verdicts
from runner.session.loop import require_resumable, run
from tests.runner.fakes import IMPORTED, FakeClock, FakeDevice, FakeParticipant, context
from tests.runner.journal.tampering import tampering

CLOCK = WallClock()


def finished(path: Path) -> Journal:
    journal = open_journal(path / "study.db")
    run(context(journal, FakeDevice(), FakeParticipant()))
    return journal


def test_an_exclusion_adds_an_event_and_removes_nothing(tmp_path: Path) -> None:
    with finished(tmp_path) as journal:
        exclude(journal, CLOCK, "P01/1", "the phone rang", 3)
        state = states(journal)["P01/1"]
        assert state.excluded == {3: "the phone rang"}
        assert len(state.answered) == 7
        (line,) = session_summaries({"P01/1": state})
        assert (line.state, line.excluded_trials) == ("completed", 1)


def test_unknown_trials_and_sessions_cannot_be_excluded(tmp_path: Path) -> None:
    with finished(tmp_path) as journal:
        with pytest.raises(BadInput, match="P01/1 has no trial 7; it has trials 0 to 6"):
            exclude(journal, CLOCK, "P01/1", "x", 7)
        with pytest.raises(BadInput, match="no session P09/1 here; known: P01/1"):
            exclude(journal, CLOCK, "P09/1", "x")


def test_a_session_can_be_excluded_only_once(tmp_path: Path) -> None:
    with finished(tmp_path) as journal:
        exclude(journal, CLOCK, "P01/1", "ill")
        with pytest.raises(BadInput, match="P01/1 is excluded; it cannot be excluded now"):
            exclude(journal, CLOCK, "P01/1", "ill")


@pytest.mark.parametrize("more", [(), (TrialStarted(index=0, kind="trial"),)])
def test_a_decision_about_a_session_that_was_killed_waits_until_it_goes_on(
    more: tuple[TrialStarted, ...], tmp_path: Path
) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        context(journal, FakeDevice(), FakeParticipant())  # opens it
        exclude(journal, CLOCK, "P01/1", "noise", 3)
        log = SessionLog(journal, "P01/1", CLOCK)
        for event in (DeviceArmed(idn="fake", boot=1, device_time_s=0.0), *more):
            log.append(event)
        with pytest.raises(BadInput, match="P01/1 is interrupted; it cannot be included now"):
            include(journal, CLOCK, "P01/1", "it was quiet", 3)


def test_a_trial_can_be_excluded_only_once(tmp_path: Path) -> None:
    with finished(tmp_path) as journal:
        exclude(journal, CLOCK, "P01/1", "noise", 3)
        with pytest.raises(BadInput, match="trial 3 of P01/1 is already excluded: noise"):
            exclude(journal, CLOCK, "P01/1", "more noise", 3)


@pytest.mark.parametrize("last", ["device-armed", "trial-started", "touch-started", "paused"])
def test_an_abandoned_session_can_be_excluded(tmp_path: Path, last: str) -> None:
    (tmp_path / "done").mkdir()
    with finished(tmp_path / "done") as done:
        events = done.events("P01/1")
    until = next((n for n, event in enumerate(events) if event.tag == last), None)
    with open_journal(tmp_path / "study.db") as journal:
        log = SessionLog(journal, "P01/1", CLOCK)
        for event in events[: 2 if until is None else until + 1]:
            log.append(event.record)
        if until is None:
            log.append(event_of(last, {}))
        exclude(journal, CLOCK, "P01/1", "did not come back")
        (verdict,) = verdicts(journal)
        assert (verdict.state, verdict.ok) == ("excluded", True)
        off = next(e for e in reversed(journal.events("P01/1")) if e.tag == "device-off")
        assert off.payload["confirmed"] is False
        assert Arrival(states(journal), "P02", "participant").slot() == 0


def test_the_slot_of_a_dropout_is_reused_and_that_of_a_finished_session_is_not(
    tmp_path: Path,
) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        context(journal, FakeDevice(), FakeParticipant())
        assert Arrival(states(journal), "P02", "participant").slot() == 1
        assert Arrival(states(journal), "P01", "participant").slot() == 0, "keeps its slot"
        exclude(journal, CLOCK, "P01/1", "did not come back")
        assert Arrival(states(journal), "P02", "participant").slot() == 0
    finished_folder = tmp_path / "finished"
    finished_folder.mkdir()
    with finished(finished_folder) as journal:
        exclude(journal, CLOCK, "P01/1", "ill")
        assert Arrival(states(journal), "P02", "participant").slot() == 1


def test_an_opened_session_keeps_its_slot_when_an_earlier_one_is_included_again(
    tmp_path: Path,
) -> None:
    with finished(tmp_path) as journal:
        exclude(journal, CLOCK, "P01/1", "ill")
        opened = journal.events("P01/1")[0].record
        assert isinstance(opened, SessionOpened)
        SessionLog(journal, "P01/2", CLOCK).append(replace(opened, session=2, slot=1))
        include(journal, CLOCK, "P01/1", "the wrong one")
        assert Arrival(states(journal), "P01", "participant", "P01/2").slot() == 1
        assert Arrival(states(journal), "P01", "participant", "P01/3").slot() == 0


def test_rehearsals_do_not_use_up_participants_slots(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        context(journal, FakeDevice(), FakeParticipant(), kind="rehearsal")
        assert Arrival(states(journal), "P02", "participant").slot() == 0
        assert Arrival(states(journal), "P02", "rehearsal").slot() == 1


def test_the_studys_own_chain_cannot_be_withdrawn(tmp_path: Path) -> None:
    with finished(tmp_path) as journal:
        amend(journal, CLOCK, template("extended"), "another study")
        with pytest.raises(BadInput, match="a participant without a name has no sessions here"):
            withdraw(journal, CLOCK, "")


def test_a_withdrawal_erases_the_data_and_the_chain_still_verifies(tmp_path: Path) -> None:
    with finished(tmp_path) as journal:
        log = SessionLog(journal, "P01/1", CLOCK)
        log.append(NoteTaken(text="something only this participant would say"))
        assert withdraw(journal, CLOCK, "P01") == ["P01/1"]
        (verdict,) = verdicts(journal)
        assert (verdict.state, verdict.chain_ok, verdict.ok) == ("withdrawn", True, True)
        assert all(event.erased for event in journal.events("P01/1"))
    held = b"".join(path.read_bytes() for path in tmp_path.iterdir())
    assert b"only this participant" not in held
    assert b"smoother" not in held


def test_an_unknown_participant_cannot_be_withdrawn(tmp_path: Path) -> None:
    with finished(tmp_path) as journal, pytest.raises(BadInput, match="P09 has no sessions here"):
        withdraw(journal, CLOCK, "P09")


def test_an_interrupted_withdrawal_erases_all_or_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with finished(tmp_path) as journal:
        with monkeypatch.context() as patched:
            patched.setattr(Journal, "erase_payloads", lambda *_: (_ for _ in ()).throw(KeyError))
            with pytest.raises(KeyError):
                withdraw(journal, CLOCK, "P01")
        assert verdicts(journal)[0].state == "completed"
        SessionLog(journal, "P01/1", CLOCK).append(Withdrawn())
        (verdict,) = verdicts(journal)
        assert not verdict.ok
        assert verdict.problem == "withdrawn but not erased; run touchbeam withdraw again"
        withdraw(journal, CLOCK, "P01")
        assert verdicts(journal)[0].ok


def test_a_withdrawal_can_be_repeated(tmp_path: Path) -> None:
    with finished(tmp_path) as journal:
        withdraw(journal, CLOCK, "P01")
        assert withdraw(journal, CLOCK, "P01") == ["P01/1"]
        assert verdicts(journal)[0].ok


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ("UPDATE event SET payload = json_set(payload, '$.score', 10) WHERE seq = 30", "chain"),
        ("UPDATE event SET payload = NULL WHERE seq = 30", "chain"),
        ("UPDATE event SET salt = NULL WHERE seq = 30", "chain"),
        ("UPDATE event SET salt = zeroblob(16) WHERE seq = 30", "chain"),
        ("UPDATE event SET utc = '2026-01-01T00:00:00+00:00' WHERE seq = 30", "chain"),
        ("DELETE FROM event WHERE seq = 30", "chain"),
        ("DELETE FROM event WHERE seq > 30", "lacks"),
    ],
)
def test_verify_finds_changes(tmp_path: Path, change: str, problem: str) -> None:
    finished(tmp_path).__exit__(None, None, None)
    with tampering(tmp_path / "study.db") as other:
        other.execute(change)
    with open_journal(tmp_path / "study.db") as journal:
        (verdict,) = verdicts(journal)
    if problem == "chain":
        assert not verdict.chain_ok
        assert not verdict.ok
    else:
        assert (verdict.state, verdict.missing > 0) != ("completed", False)


def test_a_session_and_the_rehearsal_of_that_name_are_judged_apart(tmp_path: Path) -> None:
    with finished(tmp_path) as journal:
        run(context(journal, FakeDevice(), FakeParticipant(), kind="rehearsal"))
        exclude(journal, CLOCK, "P01/1 (rehearsal)", "a dry run")
        assert [each.state for each in verdicts(journal)] == ["completed", "excluded"]
        assert withdraw(journal, CLOCK, "P01") == ["P01/1"]
        assert [each.state for each in verdicts(journal)] == ["withdrawn", "excluded"]
        assert withdraw(journal, CLOCK, "P01", rehearsal=True) == ["P01/1 (rehearsal)"]
        assert [each.kind for each in verdicts(journal)] == ["unknown", "rehearsal"]
        with pytest.raises(BadInput, match="P02 has no rehearsals here"):
            withdraw(journal, CLOCK, "P02", rehearsal=True)


def test_a_trial_can_be_included_again(tmp_path: Path) -> None:
    with finished(tmp_path) as journal:
        exclude(journal, CLOCK, "P01/1", "noise", 3)
        include(journal, CLOCK, "P01/1", "the noise was elsewhere", 3)
        assert states(journal)["P01/1"].excluded == {}
        with pytest.raises(BadInput, match="3 of P01/1 is not excluded; excluded trials: none"):
            include(journal, CLOCK, "P01/1", "again", 3)
        exclude(journal, CLOCK, "P01/1", "noise after all", 3)
        assert states(journal)["P01/1"].excluded == {3: "noise after all"}
        reasons = [e.payload["reason"] for e in journal.events("P01/1") if "reason" in e.payload]
        assert reasons == ["noise", "the noise was elsewhere", "noise after all"]
        with pytest.raises(BadInput, match=r"not excluded; its excluded trials are 3: name one"):
            include(journal, CLOCK, "P01/1", "x")
        assert verdicts(journal)[0].ok


def test_an_included_session_is_what_it_was_before(tmp_path: Path) -> None:
    with finished(tmp_path) as journal:
        exclude(journal, CLOCK, "P01/1", "ill")
        include(journal, CLOCK, "P01/1", "it was somebody else")
        assert states(journal)["P01/1"].name == "completed"
        assert verdicts(journal)[0].ok
    (tmp_path / "unfinished").mkdir()
    with open_journal(tmp_path / "unfinished" / "study.db") as journal:
        made = context(journal, FakeDevice(), FakeParticipant())
        exclude(journal, CLOCK, "P01/1", "did not come back")
        state = states(journal)["P01/1"]
        with pytest.raises(BadInput, match="P01/1 is already excluded"):
            require_resumable(journal, made.session, state, FakeClock().utc())
        include(journal, CLOCK, "P01/1", "came back")
        run(context(journal, FakeDevice(), FakeParticipant()))
        assert (verdicts(journal)[0].state, verdicts(journal)[0].ok) == ("completed", True)


def test_the_verdict_has_the_fields_that_other_programs_rely_on(tmp_path: Path) -> None:
    with finished(tmp_path) as journal:
        record = json.loads(json.dumps(verdicts(journal)[0].record()))
    expected = {
        "participant": "P01",
        "session": 1,
        "state": "completed",
        "trials_planned": 7,
        "trials_answered": 7,
        "trials_aborted": 0,
        "duplicates": 0,
        "missing": 0,
        "chain_ok": True,
    }
    assert expected.items() <= record.items()
    assert record["events"] > 40


@pytest.mark.parametrize(
    "damage",
    [
        "UPDATE event SET payload = '{' WHERE seq = 12",
        "UPDATE event SET payload = '[1]' WHERE seq = 12",
        "UPDATE event SET payload = '{}' WHERE seq = 0",
        "UPDATE event SET utc = 'x' WHERE seq = 12",
        "UPDATE event SET tag = 'session-completed' WHERE seq = 12",
        "UPDATE event SET session = 'P01/x'",
        "DELETE FROM event WHERE seq = 0",
    ],
)
def test_a_damaged_journal_fails_verification_and_is_not_reported(
    tmp_path: Path, damage: str
) -> None:
    finished(tmp_path).__exit__(None, None, None)
    with tampering(tmp_path / "study.db") as other:
        other.execute(damage)
    with read_journal(tmp_path / "study.db") as journal:
        found = verdicts(journal)
        assert found
        assert not all(verdict.ok for verdict in found)
        if "P01/x" not in damage:
            with pytest.raises(JournalError, match=r"damaged|lost|no opening event|does not allow"):
                states(journal)


def test_an_erasure_prevented_by_a_reader_is_an_error(tmp_path: Path) -> None:
    with finished(tmp_path) as journal, closing(sqlite3.connect(tmp_path / "study.db")) as reader:
        journal.checkpoint()
        reader.execute("BEGIN")
        reader.execute("SELECT count(*) FROM event").fetchone()
        with pytest.raises(
            JournalError, match="an old copy remains while another program reads it"
        ):
            withdraw(journal, CLOCK, "P01")
        reader.rollback()
        withdraw(journal, CLOCK, "P01")
    held = b"".join(path.read_bytes() for path in tmp_path.iterdir())
    assert b"smoother" not in held


def test_the_refusal_of_a_trial_tells_which_there_are(tmp_path: Path) -> None:
    with finished(tmp_path) as journal:
        exclude(journal, CLOCK, "P01/1", "noise", 3)
        exclude(journal, CLOCK, "P01/1", "noise", 5)
        with pytest.raises(BadInput, match=r"trial 4 of P01/1 is not excluded; .* trials: 3, 5$"):
            include(journal, CLOCK, "P01/1", "x", 4)
    with open_journal(tmp_path / "other.db") as journal:
        with pytest.raises(BadInput, match=r"no session P01/1 here; known: none$"):
            exclude(journal, CLOCK, "P01/1", "x")
        amend(journal, CLOCK, "", "nothing was accepted before")
        with pytest.raises(BadInput, match=r"no session P01/1 here; known: none$"):
            exclude(journal, CLOCK, "P01/1", "x")
        with pytest.raises(BadInput, match=r"^@study has no trial 0; it has no trials$"):
            exclude(journal, CLOCK, "@study", "x", 0)


def test_a_session_that_is_not_excluded_is_told_from_one_with_excluded_trials(
    tmp_path: Path,
) -> None:
    with (
        finished(tmp_path) as journal,
        pytest.raises(BadInput, match=r"^P01/1 is completed, not excluded$"),
    ):
        include(journal, CLOCK, "P01/1", "x")


def test_what_a_participant_still_has_is_told_until_it_is_erased(tmp_path: Path) -> None:
    with finished(tmp_path) as journal:
        SessionLog(journal, "1/1", CLOCK).append(IMPORTED)
        both = ["P01/1", "1/1"]
        assert unerased(journal, both) == {
            "P01/1": "7 of 7 trials answered",
            "1/1": "imported scores",
        }
        SessionLog(journal, "P01/1", CLOCK).append(Withdrawn())
        assert list(unerased(journal, both)) == both, "an event without data is not all of them"
        withdraw(journal, CLOCK, "P01")
        assert unerased(journal, both) == {"1/1": "imported scores"}


def test_what_was_deleted_without_being_overwritten_is_gone_after_a_withdrawal(
    tmp_path: Path,
) -> None:
    """SQLite leaves deleted data in free space, unless it is told otherwise on every connection."""
    path, secret = tmp_path / "study.db", "a name that slipped in" * 500
    with finished(tmp_path) as journal:
        SessionLog(journal, "P01/1", CLOCK).append(NoteTaken(text=secret))
    with tampering(path) as other:
        other.execute("PRAGMA secure_delete = OFF")
        other.execute("UPDATE event SET payload = NULL, salt = NULL WHERE tag = 'note'")
    assert secret[:100].encode() in path.read_bytes()
    with open_journal(path) as journal:
        withdraw(journal, CLOCK, "P01")
    assert secret[:100].encode() not in path.read_bytes()


def test_a_session_of_which_one_event_is_left_is_not_erased(tmp_path: Path) -> None:
    finished(tmp_path).__exit__(None, None, None)
    with tampering(tmp_path / "study.db") as other:
        other.execute("UPDATE event SET payload = NULL, salt = NULL WHERE seq = 3")
    with open_journal(tmp_path / "study.db") as journal:
        assert unerased(journal, ["P01/1"]) == {"P01/1": "7 of 7 trials answered"}


def test_a_withdrawal_is_recorded_once_and_without_rehearsals(tmp_path: Path) -> None:
    with finished(tmp_path) as journal:
        run(context(journal, FakeDevice(), FakeParticipant(), kind="rehearsal"))
        assert sessions_of(journal, "P01", rehearsal=False) == ["P01/1"]
        assert sessions_of(journal, "P01", rehearsal=True) == ["P01/1 (rehearsal)"]
        for _ in range(2):
            withdraw(journal, CLOCK, "P01")
        tags = [event.tag for event in journal.events("P01/1")]
        assert tags.count("withdrawn") == 1
        with pytest.raises(BadInput, match="the sliding experiment has no participant who could"):
            sessions_of(journal, "slide", rehearsal=False)


def test_a_name_that_was_only_rehearsed_is_withdrawn_without_saying_so(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        context(journal, FakeDevice(), FakeParticipant(), kind="rehearsal")
        assert withdraw(journal, CLOCK, "P01") == ["P01/1 (rehearsal)"]


def test_a_trial_of_an_abandoned_session_is_excluded_once_it_is_closed(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        log = context(journal, FakeDevice(), FakeParticipant()).log
        log.append(DeviceArmed(idn="fake", boot=1, device_time_s=0.0))
        log.append(TrialStarted(index=0, kind="baseline"))
        exclude(journal, CLOCK, "P01/1", "noise", 0)
        tags = [event.tag for event in journal.events("P01/1")]
        assert tags[-3:] == ["trial-aborted", "device-off", "trial-excluded"]
