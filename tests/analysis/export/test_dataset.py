"""Which trials are exported, in which order, and what is said of those that are not."""

from collections.abc import Sequence

import pytest

from analysis.export.dataset import Dataset, NothingToExport, dataset
from analysis.loading.records import values
from protocol.journal.events import StoredEvent, TrialExcluded, TrialIncluded
from protocol.study_file.loading import parsed_study
from tests.analysis.chains import chain, scored_session
from tests.analysis.hostile_study import sessions, study_text

TEXT = study_text()
EVERYTHING = [session.events for session in sessions(TEXT)]


def exported(chains: Sequence[Sequence[StoredEvent]], *, rehearsals: bool = False) -> Dataset:
    return dataset(chains, parsed_study(TEXT), "0", rehearsals=rehearsals)


def events(participant: str) -> list[list[StoredEvent]]:
    return [session.events for session in sessions(TEXT) if session.participant == participant]


def test_every_trial_that_was_begun_is_there_and_who_withdrew_is_not() -> None:
    data = exported(EVERYTHING)
    assert {name: len(trials) for name, trials in data.by_session()} == {
        ("P-01", 1): 7,
        ("P01", 1): 7,
        ("P01", 2): 7,
        ("p_01", 1): 7,
        ("D01", 1): 2,
        ("E01", 1): 7,
    }
    left_out = (data.rehearsals_left_out, data.tables.found.withdrawn, data.sessions_without_trials)
    assert left_out == (1, 1, 1)
    assert "R01" in exported(EVERYTHING, rehearsals=True).subject_labels
    assert data.summary() == (
        "37 trials of 5 participants (8 trials excluded, marked); "
        "left out: 1 rehearsal, 1 withdrawn session"
    )


def test_trials_are_in_the_order_of_the_plan_session_by_session() -> None:
    for _, trials in exported(EVERYTHING).by_session():
        assert trials["trial_index"].is_monotonic_increasing


def test_withdrawn_is_withdrawn_even_before_the_payloads_are_erased() -> None:
    with pytest.raises(NothingToExport, match="no trials here: nobody has begun one, or all have"):
        exported(events("W01"))


def test_nothing_but_rehearsals_names_the_option() -> None:
    with pytest.raises(NothingToExport, match=r"nothing but rehearsals here; .* --rehearsals"):
        exported(events("R01"))


def test_what_was_taken_out_is_marked() -> None:
    trials = exported([*events("P01"), *events("E01")]).trials
    assert trials["excluded"].tolist() == ["no"] * 3 + ["trial"] + ["no"] * 10 + ["session"] * 7
    assert trials["exclusion_reason"].iloc[-1] == "fell asleep"


def test_a_rehearsal_has_files_of_its_own_and_the_name_it_had() -> None:
    kinds = ("participant", "rehearsal")
    both = [scored_session("P01", [("voltage", 9)], ["voltage"], kind=kind) for kind in kinds]
    data = exported([chain(events) for events in both], rehearsals=True)
    assert [name for name, _ in data.by_session()] == [("P01", 1), ("P01 (rehearsal)", 1)]
    assert data.subject_labels == {"P01": "P01", "P01 (rehearsal)": "P01rehearsal"}
    assert data.summary().startswith("2 trials of 1 participant (")
    told = data.trials[["participant", "session_kind"]].itertuples(index=False, name=None)
    assert list(told) == [("P01", kind) for kind in kinds]


def test_why_an_exclusion_was_taken_back_is_there() -> None:
    session = scored_session("P01", [("voltage", 9), ("voltage", 8)], ["voltage"])
    for index in (0, 1):
        session.append(TrialExcluded(index=index, reason="a noise"))
    session.append(TrialIncluded(index=1, reason="next door"))
    trials = exported([chain(session)]).trials
    assert trials["excluded"].tolist() == ["trial", "no"]
    assert values(trials["exclusion_reason"]) == ["a noise", None]
    assert values(trials["inclusion_reason"]) == [None, "next door"]
