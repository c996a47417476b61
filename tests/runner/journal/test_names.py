"""The names of chains, also in journals of versions that did not keep rehearsals apart."""

from protocol.journal.events import StudyAmended
from runner.clock import WallClock
from runner.journal.amendments import withdraw
from runner.journal.names import (
    STUDY_CHAIN,
    chain_name,
    chains_of,
    existing_chain,
    is_rehearsal,
    parsed_name,
    real_sessions,
    spoken_name,
)
from runner.journal.store import Journal, SessionLog
from tests.analysis.chains import opened


def begin(journal: Journal, chain: str, kind: str) -> None:
    event = opened(chain.partition("/")[0], ["voltage"], kind=kind)
    SessionLog(journal, chain, WallClock()).append(event)


def names(journal: Journal, participant: str = "P01") -> tuple[str, str]:
    return (
        chain_name(journal, participant, 1, rehearsal=False),
        chain_name(journal, participant, 1, rehearsal=True),
    )


def test_sessions_and_rehearsals_have_names_of_their_own(journal: Journal) -> None:
    assert names(journal) == ("P01/1", "P01/1 (rehearsal)")
    for chain, kind in zip(names(journal), ("participant", "rehearsal"), strict=True):
        begin(journal, chain, kind)
    assert names(journal) == ("P01/1", "P01/1 (rehearsal)")
    assert chains_of(journal, "P01", rehearsal=False) == ["P01/1"]
    assert chains_of(journal, "P01", rehearsal=True) == ["P01/1 (rehearsal)"]


def test_a_rehearsal_of_an_earlier_version_leaves_its_name_free(journal: Journal) -> None:
    begin(journal, "P01/1", "rehearsal")
    assert names(journal) == ("P01/1 (participant)", "P01/1")
    assert spoken_name(journal, "P01/1") == "P01/1 (rehearsal)"
    begin(journal, "P01/1 (participant)", "participant")
    assert spoken_name(journal, "P01/1 (participant)") == "P01/1"
    assert chains_of(journal, "P01", rehearsal=False) == ["P01/1 (participant)"]
    withdraw(journal, WallClock(), "P01", rehearsal=True)
    assert names(journal)[0] == "P01/1 (participant)", "although nothing tells of the rehearsal"


def test_without_a_session_the_rehearsal_of_that_name_is_meant(journal: Journal) -> None:
    begin(journal, "P01/1 (rehearsal)", "rehearsal")
    assert existing_chain(journal, "P01", 1, rehearsal=False) == "P01/1 (rehearsal)"
    assert existing_chain(journal, "P02", 1, rehearsal=False) == "P02/1"
    begin(journal, "P01/1", "participant")
    assert existing_chain(journal, "P01", 1, rehearsal=False) == "P01/1"


def test_an_erased_rehearsal_is_still_one(journal: Journal) -> None:
    begin(journal, "P01/1 (rehearsal)", "rehearsal")
    withdraw(journal, WallClock(), "P01")
    assert is_rehearsal(journal, "P01/1 (rehearsal)")
    assert names(journal)[0] == "P01/1"


def test_real_are_the_sessions_that_participants_had(journal: Journal) -> None:
    SessionLog(journal, STUDY_CHAIN, WallClock()).append(StudyAmended(study_sha256="0", reason="x"))
    begin(journal, "slide/1", "slide")
    begin(journal, "script/1", "script")
    begin(journal, "P02/1 (rehearsal)", "rehearsal")
    begin(journal, "P01/1", "participant")
    begin(journal, "P01/2", "participant")
    assert real_sessions(journal) == ["P01/1", "P01/2"]


def test_a_name_that_touchbeam_has_not_written_is_a_participants() -> None:
    assert parsed_name("P01/first") == ("P01", 0, "")
    assert parsed_name(STUDY_CHAIN) == (STUDY_CHAIN, 0, "")
