"""A study that an earlier version registered, with its power and a text for a registry.

Every kind of hypothesis is registered. Two sessions were run, the study file amended, and a third
one run.
"""

import json
from dataclasses import replace
from pathlib import Path

import pytest

import touchbeam
from protocol.journal.events import SessionOpened
from protocol.registration.registration import FILE, Registration, registration_in
from runner.clock import WallClock
from runner.journal.cohort import states
from runner.journal.opening import read_journal
from runner.study.folder import StudyFolder
from runner.study.registered import register, registration_of
from tests.old_studies import old_study
from tests.runner.command_line import typed
from tests.runner.registered_study import drawn_again, events_of, run_session

DIGEST = "d62175234843377772061f61792dfbc703ccf6c6c2e6d63cba060a501383d0aa"
SUPPORTED = {
    "conditions differ": True,
    "effect of voltage": None,
    "100 V, frequency 1 above 50 V, frequency 1": False,
    "young above old between groups": False,
    "voltage by frequency": None,
    "gains differ": None,
    "ratings follow the prediction": None,
    "order of conditions as predicted": False,
    "noticed more than catch trials": True,
    "100 V, frequency 1 noticed more than catch trials": False,
    "threshold of rising above that of falling": False,
    "threshold of rising": None,
    "Weber fraction of rising below 0.15": ...,
}
"""Not where a fit of so few answers decides on an interval."""
UNTESTED = (
    *("effect of voltage", "voltage by frequency"),
    *("gains differ", "ratings follow the prediction"),
)
"""Their tests left with version 1."""


@pytest.fixture
def study(tmp_path: Path) -> Path:
    return old_study("registered_study", tmp_path / "study")


def registration(study: Path) -> Registration:
    found = registration_of(study)
    assert found is not None
    return found


def test_the_registration_loads_without_what_left_it(study: Path) -> None:
    text = (study / FILE).read_text(encoding="utf-8")
    assert "\n[power]\n" in text
    found = registration(study)
    assert (found.digest, found.text()) == (DIGEST, text)
    assert found.hypotheses == tuple(SUPPORTED)
    assert found.groups == {"young": 2, "old": 1}
    assert not hasattr(found, "power")


def test_it_is_verified_and_its_text_for_a_registry_left_alone(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = (study / "registration.txt").read_bytes()
    assert typed("verify", study) == 0
    session = "completed  11 of 11 trials answered, 0 aborted, 0 answered twice, chain unbroken"
    assert capsys.readouterr().out.splitlines() == [
        "ok    the study itself  amended  2 events, chain unbroken",
        *(f"ok    {name}/1  {session}" for name in ("A01", "B01", "A02")),
    ]
    assert typed("check", study) == 0
    said = capsys.readouterr()
    assert f"Registered: {DIGEST}, which seeds the orders." in said.out
    assert "study.toml was amended after the registration." in said.out
    # A table of this study file that has left with what obeyed it.
    assert said.err.splitlines() == [
        f"touchbeam: warning: {study / 'study.toml'}: ignored: [forecast] (touchbeam power says "
        "how wide intervals will be)"
    ]
    assert (study / "registration.txt").read_bytes() == before


def test_its_orders_follow_from_its_digest_as_ever(study: Path) -> None:
    run_session(study, "A03", group="young")
    with read_journal(study / "study.db") as journal:
        sessions = [state.opened for state in states(journal).values()]
    assert len(sessions) == 4
    for opened in sessions:
        assert isinstance(opened, SessionOpened)
        assert opened.registration == DIGEST
        drawn = [(trial.index, trial.kind, trial.condition) for trial in drawn_again(opened)]
        assert [(trial.index, trial.kind, trial.condition) for trial in opened.trials] == drawn
    assert typed("verify", study) == 0


def test_its_hypotheses_are_judged_and_its_deviations_listed(study: Path) -> None:
    assert typed("report", study, "--sections", "table4") == 0
    told = json.loads((study / "report" / "report.json").read_text(encoding="utf-8"))
    told = told["registration"]
    assert told["digest"] == DIGEST
    assert told["utc"].startswith("2026-11-28T13:46:36")
    assert [result["name"] for result in told["results"]] == list(SUPPORTED)
    for result in told["results"]:
        if SUPPORTED[result["name"]] is not ...:
            assert result["supported"] is SUPPORTED[result["name"]], result
        assert result["tested"] is (result["name"] not in UNTESTED)
        assert result["protected"], "the primary hypothesis is tested"
        if result["name"] in UNTESTED:
            why = f"whose test of {result['name']} this version does not have"
            assert result["found"] == f"registered with touchbeam 1.0.0, {why}"
    assert (told["schema"], told["rung"]) == (1, "timoshenko-patched")
    assert [it["text"] for it in told["deviations"]] == [
        "amended at 2026-11-28 13:46 UTC, which broke the lock: a comment",
        "the present study file is not the registered one",
        "sessions under another study file: A02/1",
        f"reported by touchbeam {touchbeam.__version__}, not 1.0.0",
        *(
            f"{name}: not tested, as touchbeam {touchbeam.__version__} does not have its test"
            for name in UNTESTED
        ),
        "sensitivity model: noticing (probit), then rating (ordinal mixed model) with a column for "
        "who noticed, integrated over their variances; registered: M2, ordinal mixed model, "
        "integrated over its variances",
        "withheld scores: missing; registered: missing; beside it read as zero and as the lowest "
        "score",
    ]


def test_a_lost_file_comes_back_from_the_journal_as_it_was(study: Path) -> None:
    before = (study / FILE).read_bytes()
    (study / FILE).unlink()
    assert typed("verify", study) == 1
    assert typed("register", study) == 0
    assert (study / FILE).read_bytes() == before


def test_the_same_plan_keeps_its_text_and_its_digest(study: Path) -> None:
    """Though this version would write another text, of which the digest were another one."""
    kept = registration(study)
    made = replace(kept, written="")
    assert made.digest != kept.digest
    for journal in ("study.db", "empty"):
        if journal == "empty":
            (study / "study.db").unlink()
        found, replaced = register(StudyFolder(path=study), made, WallClock())
        assert (found.digest, replaced) == (DIGEST, "")
        assert registration_in((study / FILE).read_text(encoding="utf-8")).digest == DIGEST
        (first, *_) = events_of(study, "@study")
        assert first.payload["registration"] == DIGEST
