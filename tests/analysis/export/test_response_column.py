"""The column of responses: that of the report, beside the score and any question of that name."""

import csv
import io
import json

import numpy as np

from analysis.export.csv_tables import csv_tables
from analysis.export.dataset import dataset
from protocol.journal.events import StoredEvent
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study, template
from tests.analysis.chains import chain
from tests.analysis.reports import EXTENDED, session_events, study_report

QUESTION = """
[[question]]
name = "response"
kind = "number"
when = "before"
minimum = 18
maximum = 99
text.en = "Your age?"
text.zh = "年龄？"
"""


def exported(study: Study, chains: list[list[StoredEvent]]) -> tuple[list[dict[str, str]], str]:
    tables = csv_tables(dataset(chains, study, "0", rehearsals=False))
    return list(csv.DictReader(io.StringIO(tables["trials.csv"]))), tables["trials.json"]


def test_it_is_the_response_of_the_report() -> None:
    rng = np.random.default_rng(1)
    chains = [chain(session_events(EXTENDED, slot, rng)) for slot in range(4)]
    rows, sidecar = exported(EXTENDED, chains)
    told = {(row["subject"], row["index"]): row["response"] for row in study_report().trial_records}
    written = {(row["participant"], int(row["trial_index"])): row["response"] for row in rows}
    assert {cell: float(text) if text else None for cell, text in written.items()} == told
    assert set(written.values()) >= {"", "0", "9"}, "whole numbers, as scores are"
    counted = [row for row in rows if row["trial_kind"] == "trial"]
    for row in counted:
        as_expected = row["agrees"] == "true"
        assert row["response"] == (str(int(row["score"]) + 1) if as_expected else "0")
    assert {row["response"] for row in rows if row["trial_kind"] == "catch"} == {""}
    assert "counted from 1 at the lowest" in json.loads(sidecar)["response"]["description"]


def test_a_question_of_that_name_keeps_it() -> None:
    study = parsed_study(template("paper") + QUESTION)
    events = chain(session_events(study, 0, np.random.default_rng(1)))
    rows, sidecar = exported(study, [events])
    names = list(rows[0])
    assert names.index("trial_response") < names.index("response")
    assert {row["response"] for row in rows} == {""}, "nobody was asked"
    scored = [row for row in rows if row["score"]]
    assert all(int(row["trial_response"]) == int(row["score"]) + 1 for row in scored)
    assert scored
    assert "Your age?" in json.loads(sidecar)["response"]["description"]
