"""The log of one session: what it stores, refuses, counts and closes."""

import pytest

from protocol.journal.events import DeviceArmed, DeviceOff, NoteTaken, Paused, TrialStarted
from protocol.journal.state import NotAllowed
from runner.journal.store import Journal, SessionLog, abort_trial, close_interrupted
from tests.runner.fakes import FakeClock, FakeDevice, FakeParticipant, context

ARMED = DeviceArmed(idn="fake", boot=1, device_time_s=0.0)


@pytest.fixture
def log(journal: Journal) -> SessionLog:
    return context(journal, FakeDevice(), FakeParticipant()).log


def tags(journal: Journal) -> list[str]:
    return [event.tag for event in journal.events("P01/1")]


def test_events_are_numbered_timed_and_taken(journal: Journal, log: SessionLog) -> None:
    clock = FakeClock(passed_s=2.5)
    again = SessionLog(journal, "P01/1", clock)
    again.append(ARMED)
    again.append(NoteTaken(text="a"))
    assert again.state.name == "armed"
    events = journal.events("P01/1")
    assert [event.seq for event in events] == [0, 1, 2]
    assert (events[2].utc, events[2].monotonic_s) == (clock.utc(), 2.5)
    assert events[2].record == NoteTaken(text="a")
    assert log.state.name == "idle", "what another log appends is not known here"


def test_an_event_that_the_state_does_not_allow_is_not_stored(
    journal: Journal, log: SessionLog
) -> None:
    with pytest.raises(NotAllowed, match="does not allow the event 'paused'"):
        log.append(Paused())
    assert tags(journal) == ["session-opened"]
    log.append(ARMED)
    assert tags(journal) == ["session-opened", "device-armed"]


def test_events_of_one_kind_are_those_of_all_sessions_that_are_not_erased(
    journal: Journal, log: SessionLog
) -> None:
    log.append(NoteTaken(text="a"))
    log.append(ARMED)
    gone = SessionLog(journal, "P02/1", FakeClock(passed_s=1))
    opened = log.state.opened
    assert opened is not None
    gone.append(opened)
    gone.append(NoteTaken(text="b"))
    now = FakeClock().utc()
    assert [note.text for _, note in log.journal.records_of(NoteTaken)] == ["a", "b"]
    journal.erase_payloads(["P02/1"])
    assert log.journal.records_of(NoteTaken) == [(now, NoteTaken(text="a"))]


@pytest.mark.parametrize("paused", [True, False])
def test_what_was_left_open_is_closed_as_unknown(
    journal: Journal, log: SessionLog, paused: bool
) -> None:
    log.append(ARMED)
    log.append(Paused() if paused else TrialStarted(index=0, kind="baseline"))
    close_interrupted(log)
    *_, before, last = journal.events("P01/1")
    why = "the session was interrupted"
    assert last.record == DeviceOff(confirmed=False, why=why)
    assert before.tag == ("paused" if paused else "trial-aborted")
    if not paused:
        assert before.payload == {"index": 0, "why": why}


def test_nothing_is_closed_that_is_not_open(journal: Journal, log: SessionLog) -> None:
    close_interrupted(log)
    abort_trial(log, "no trial")
    assert tags(journal) == ["session-opened"]


def test_the_write_ahead_log_is_kept_small(
    journal: Journal, log: SessionLog, monkeypatch: pytest.MonkeyPatch
) -> None:
    called: list[bool] = []
    monkeypatch.setattr(journal, "checkpoint", lambda: called.append(True))
    log.journal.checkpoint()
    assert called == [True]
