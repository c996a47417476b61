"""Each deviation from a registration is listed, and nothing else is."""

from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import pytest

from protocol.registration.deviations import Amendment, Conduct, SessionRun, deviations
from tests.protocol.registration.test_registration import REGISTERED

RUN = SessionRun(
    name="P01/1",
    number=1,
    registration=REGISTERED.digest,
    study_sha256=REGISTERED.study_sha256,
    touchbeam="0.1.0",
    calibration="session slide/1",
)
CONDUCT = Conduct(
    sessions=[RUN, replace(RUN, name="P02/1")],
    amendments=[],
    participants=20,
    by_hand=[],
    study_sha256=REGISTERED.study_sha256,
    law="consistent",
    rung="mode",
    analysis=REGISTERED.analysis,
    touchbeam="0.1.0",
)
AMENDED = Amendment(utc=datetime(2026, 5, 1, 12, tzinfo=UTC), reason="a shorter ramp")


def test_without_deviations_the_list_is_empty() -> None:
    assert deviations(REGISTERED, CONDUCT) == []


def test_a_group_of_another_size_is_told() -> None:
    grouped = replace(REGISTERED, groups={"young": 8, "old": 12})
    conduct = replace(CONDUCT, sessions=[replace(RUN, registration=grouped.digest)])
    assert deviations(grouped, replace(conduct, groups={"young": 8, "old": 12})) == []
    found = deviations(grouped, replace(conduct, groups={"old": 13}))
    assert [text for _, text in found] == [
        "young: 0 completed, fewer than the 8 registered",
        "old: 13 completed, more than the 12 registered",
    ]


@pytest.mark.parametrize(
    ("change", "kind", "told"),
    [
        ({"broken_file": "registration.toml: was changed"}, "registration", "was changed"),
        ({"amendments": [AMENDED]}, "study file", "amended at 2026-05-01 12:00 UTC"),
        ({"study_sha256": "2" * 64}, "study file", "present study file is not the registered one"),
        ({"participants": 19}, "participants", "19 completed, fewer than the 20 registered"),
        ({"participants": 21}, "participants", "21 completed, more than the 20 registered"),
        ({"by_hand": ["P03: asleep"]}, "exclusion", "without a registered rule: P03: asleep"),
        ({"withdrawn": 2, "withdrawn_completed": 1}, "withdrawal", ": 2, of which 1 had been"),
        ({"law": "printed"}, "prediction", "law printed on rung mode; registered: consistent on"),
        ({"rung": "eq15"}, "prediction", "law consistent on rung eq15; registered: consistent on"),
        ({"touchbeam": "0.2.0"}, "version", "reported by touchbeam 0.2.0, not 0.1.0"),
        (
            {"analysis": {"correction": "Holm"}},
            "analysis",
            "significance level: None; registered: 0.05",
        ),
        (
            {"untested": ["effect of voltage"]},
            "hypothesis",
            "effect of voltage: not tested, as touchbeam 0.1.0 does not have its test",
        ),
        ({"later": "session slide/2"}, "calibration", "session slide/2 is later than the sessions"),
    ],
)
def test_each_deviation_of_the_study_is_told(change: dict[str, Any], kind: str, told: str) -> None:
    (found,) = deviations(REGISTERED, replace(CONDUCT, **change))
    assert found.kind == kind
    assert told in found.text


@pytest.mark.parametrize(
    ("change", "kind", "told"),
    [
        ({"registration": None}, "registration", "sessions without it or under another one: P03/1"),
        ({"registration": "f" * 64}, "registration", "under another one: P03/1"),
        ({"study_sha256": "2" * 64}, "study file", "sessions under another study file: P03/1"),
        ({"touchbeam": "0.2.0"}, "version", "sessions by a touchbeam other than 0.1.0: P03/1"),
        (
            {"calibration": ""},
            "calibration",
            "registered: session slide/1; in force: the paper's values, in sessions: P03/1",
        ),
        ({"number": 2}, "sessions", "more than the 1 registered for each: P03/1"),
    ],
)
def test_each_deviation_of_a_session_is_told(change: dict[str, Any], kind: str, told: str) -> None:
    run = replace(RUN, name="P03/1", **change)
    (found,) = deviations(REGISTERED, replace(CONDUCT, sessions=[*CONDUCT.sessions, run]))
    assert found.kind == kind
    assert told in found.text
