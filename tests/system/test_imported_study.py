"""A study that an earlier version made again of a BIDS export: it is used as any other."""

import json
from pathlib import Path

import numpy as np
import pytest

import touchbeam
from protocol.journal.events import UNKNOWN_UTC
from protocol.registration.registration import FILE, registration_in
from tests.analysis.export.data_slips import bids_slips, csv_rows, psychds_slips
from tests.old_studies import old_study
from tests.runner.command_line import typed

SCORES = {"P01": [7, None, 8, 6, 5], "P02": [10, 10, 10, 10, None]}
"""In the order of the study's conditions."""


@pytest.fixture
def imported(tmp_path: Path) -> Path:
    """Two rehearsals of a registered study, without the time of day."""
    return old_study("imported_study", tmp_path / "imported")


def test_its_tables_load(imported: Path) -> None:
    study = touchbeam.load(imported, rehearsals=True)
    expected = np.array(list(SCORES.values()), dtype=float)
    np.testing.assert_array_equal(study.scores.to_numpy(), expected)
    assert study.sessions.session_kind.tolist() == ["rehearsal"] * 2
    assert study.trials.started_utc.min().date() == UNKNOWN_UTC.date()
    assert len(study.traces()) == 320


def test_its_journal_is_whole(imported: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert typed("verify", imported) == 0
    session = "completed  7 of 7 trials answered, 0 aborted, 0 answered twice, chain unbroken"
    assert capsys.readouterr().out.splitlines() == [
        "ok    the study itself  registered  1 event, chain unbroken",
        f"ok    P01/1 (rehearsal)  {session}",
        f"ok    P02/1 (rehearsal)  {session}",
    ]


def test_its_report_knows_the_registration_and_invents_no_day(imported: Path) -> None:
    assert typed("report", imported, "--rehearsals", "--sections", "table4") == 0
    told = json.loads((imported / "report" / "report.json").read_text())["registration"]
    assert told["digest"] == registration_in((imported / FILE).read_text()).digest
    assert told["utc"] is None
    assert [result["name"] for result in told["results"]] == [
        "conditions differ",
        "voltage above structure",
    ]
    # Of what depends on the version that reports nothing is said here.
    kinds = {deviation["kind"] for deviation in told["deviations"]}
    assert kinds <= {"version", "analysis", "prediction"}
    assert "1970" not in (imported / "report" / "report.html").read_text()


def test_it_is_exported(imported: Path, tmp_path: Path) -> None:
    made = {}
    for form in ("csv", "bids", "psychds"):
        assert typed("export", imported, tmp_path / form, "--format", form, "--rehearsals") == 0
        made[form] = {
            path.relative_to(tmp_path / form).as_posix(): path.read_text(encoding="utf-8")
            for path in (tmp_path / form).rglob("*")
            if path.is_file()
        }
    scored = [row for row in csv_rows(made["csv"]["trials.csv"]) if row["trial_kind"] == "trial"]
    assert {
        who: sorted(row["score"] for row in scored if row["participant"] == who) for who in SCORES
    } == {who: sorted("" if it is None else str(it) for it in SCORES[who]) for who in SCORES}
    assert list(bids_slips(made["bids"])) == []
    assert list(psychds_slips(made["psychds"])) == []
