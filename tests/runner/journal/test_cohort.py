"""Slots and summaries of a cohort, state by state."""

from dataclasses import replace

import pytest

from protocol.errors import BadInput
from protocol.journal.events import SessionOpened, StudyAmended, Withdrawn
from protocol.journal.state import EXCLUDED, SessionState
from protocol.study_file.loading import parsed_study, template
from runner.journal.cohort import Arrival, planned_trials, session_summaries, states
from runner.journal.names import STUDY_CHAIN
from runner.journal.store import Journal, SessionLog
from tests.protocol.studies import OWN_QUESTIONS
from tests.runner.fakes import IMPORTED, FakeClock, FakeDevice, FakeParticipant, context


@pytest.fixture
def opened(journal: Journal) -> SessionOpened:
    found = context(journal, FakeDevice(), FakeParticipant()).log.state.opened
    assert isinstance(found, SessionOpened)
    return found


def state(
    opened: SessionOpened,
    participant: str,
    slot: int | None,
    name: str = "idle",
    answered: int = 0,
    kind: str = "participant",
) -> SessionState:
    return SessionState(
        name=name,
        opened=replace(opened, participant=participant, slot=slot, kind=kind),
        answers=dict.fromkeys(range(answered), "same"),
    )


GONE = (*EXCLUDED, "withdrawn")


@pytest.mark.parametrize("name", GONE)
def test_the_slot_of_one_who_is_gone_is_free_for_everybody(
    opened: SessionOpened, name: str
) -> None:
    for answered in (0, 6):
        sessions = {"P01/1": state(opened, "P01", 0, name, answered)}
        assert Arrival(sessions, "P02", "participant").slot() == 0
    both = {"P01/1": state(opened, "P01", 0), "P01/2": state(opened, "P01", 1, name)}
    assert Arrival(both, "P01", "participant").slot() == 0


@pytest.mark.parametrize("name", GONE)
def test_a_session_that_was_finished_before_it_was_excluded_keeps_its_slot(
    opened: SessionOpened, name: str
) -> None:
    sessions = {"P01/1": state(opened, "P01", 0, name, answered=7)}
    assert Arrival(sessions, "P02", "participant").slot() == 1
    assert Arrival(sessions, "P01", "participant").slot() == 1, "and is not begun again"


def test_nothing_planned_is_not_finished(opened: SessionOpened) -> None:
    emptied = replace(opened, trials=(), slot=0)
    sessions = {"P01/1": SessionState(name="withdrawn", opened=emptied)}
    assert Arrival(sessions, "P02", "participant").slot() == 0


def test_a_plan_of_one_trial_can_be_finished(opened: SessionOpened) -> None:
    one = replace(opened, trials=opened.trials[:1], slot=0)
    sessions = {"P01/1": SessionState(name="withdrawn", opened=one, answers={0: "same"})}
    assert Arrival(sessions, "P02", "participant").slot() == 1


def test_a_finished_session_settles_its_slot_whatever_comes_after(opened: SessionOpened) -> None:
    done, left = state(opened, "P01", 0, "completed"), state(opened, "P02", 0, EXCLUDED[0])
    for sessions in ({"P01/1": done, "P02/1": left}, {"P02/1": left, "P01/1": done}):
        assert Arrival(sessions, "P03", "participant").slot() == 1


def test_the_first_slot_that_nobody_has_is_next(opened: SessionOpened) -> None:
    assert Arrival({}, "P01", "participant").slot() == 0
    sessions = {
        "P01/1": state(opened, "P01", 0),
        "P02/1": state(opened, "P02", 3),
        "P03/1": state(opened, "P03", 1, "completed"),
    }
    assert Arrival(sessions, "P04", "participant").slot() == 2
    assert Arrival(sessions, "P02", "participant").slot() == 3, "its own"
    sessions["P04/1"] = state(opened, "P04", 2)
    assert Arrival(sessions, "P05", "participant").slot() == 4


def test_sessions_of_another_kind_or_without_a_slot_take_none(opened: SessionOpened) -> None:
    sessions = {
        "P01/1 (rehearsal)": state(opened, "P01", 0, kind="rehearsal"),
        "slide/1": state(opened, "slide", None),
        "new": SessionState(),
    }
    assert Arrival(sessions, "P01", "participant").slot() == 0
    assert Arrival(sessions, "P02", "rehearsal").slot() == 1
    assert Arrival(sessions, "slide", "participant", "slide/1").slot() == 0
    assert Arrival(sessions, "P03", "participant", "new").slot() == 0


def test_a_session_keeps_the_slot_with_which_it_was_opened(opened: SessionOpened) -> None:
    sessions = {"P01/1": state(opened, "P01", 2), "P01/2": state(opened, "P01", 5)}
    assert Arrival(sessions, "P01", "participant", "P01/2").slot() == 5
    assert Arrival(sessions, "P01", "participant", "P01/3").slot() == 2


def test_a_summary_has_what_is_known(opened: SessionOpened) -> None:
    begun = state(opened, "P01", 4, answered=2)
    begun.excluded[1] = "noise"
    summaries = session_summaries({"P01/1": begun, "P02/2": SessionState()})
    assert [summary.record() for summary in summaries] == [
        {
            "participant": "P01", "session": 1, "kind": "participant", "state": "idle", "slot": 4,
            "answered": 2, "planned": 7, "excluded_trials": 1,
        },
        {
            "participant": "P02", "session": 2, "kind": "unknown", "state": "new", "slot": None,
            "answered": 0, "planned": 0, "excluded_trials": 0,
        },
    ]  # fmt: skip
    (rehearsed,) = session_summaries({"P01/1 (rehearsal)": begun})
    assert rehearsed.kind == "rehearsal"


def test_the_states_are_those_of_sessions_alone(journal: Journal, opened: SessionOpened) -> None:
    log = SessionLog(journal, STUDY_CHAIN, FakeClock())
    log.append(StudyAmended(study_sha256="x", reason="y", breaks=None))
    found = states(journal)
    assert list(found) == ["P01/1"]
    assert found["P01/1"].opened == opened


def test_the_plan_is_the_last_one_and_a_session_without_one_is_refused(
    journal: Journal, opened: SessionOpened
) -> None:
    assert planned_trials(journal, "P01/1") == list(opened.trials)
    imported = SessionLog(journal, "1/1", FakeClock())
    imported.append(IMPORTED)
    SessionLog(journal, "P01/1", FakeClock()).append(Withdrawn())
    journal.erase_payloads(["P01/1"])
    for chain in ("1/1", "P01/1"):
        with pytest.raises(BadInput, match=f"^{chain} has no plan: withdrawn, or imported scores$"):
            planned_trials(journal, chain)


def test_only_what_is_asked_in_the_first_session_alone_is_known_in_a_later_one(
    opened: SessionOpened,
) -> None:
    """What is asked in every session is that session's, also where it was not asked there."""
    study = parsed_study(template("paper") + OWN_QUESTIONS)
    first = state(opened, "P01", 0, "completed")
    first.questions |= {("age", None): 31, ("remarks", None): "warm", ("sensations", 2): ["none"]}
    assert Arrival({"P01/1": first}, "P01", "participant", "P01/2").told(study) == {"age": 31}
