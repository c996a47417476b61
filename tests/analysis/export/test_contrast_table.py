"""The exported table of contrasts: what the report has for each trial, and the trials it omits."""

import json
from collections.abc import Callable, Sequence
from typing import Any

import pytest
from numpy.random import default_rng

from analysis.export.dataset import Dataset, dataset
from analysis.export.formats import csv_export
from analysis.export.trial_table import CONTRAST_COLUMNS
from analysis.loading.study_data import load_study_data
from analysis.report.findings import Origin
from analysis.report.report import report, report_json
from device.friction.calibration import NOMINAL, Calibration
from device.friction.changes import RUNG
from device.friction.laws import LAWS
from protocol.journal.events import StoredEvent, StudyRegistered
from tests.analysis.chains import chain, published_chain
from tests.analysis.export.data_slips import csv_rows
from tests.analysis.export.test_formats import nasty
from tests.analysis.friction.recorded_sessions import recorded_cohort
from tests.analysis.report.sections.test_registered import NEW, OLD, REGISTERED, SHA256, session
from tests.analysis.reports import PAPER, session_events

Chains = Sequence[Sequence[StoredEvent]]
# With the kind of trial, because catch trials stand under their condition, at a contrast of 0.
KEY = ("participant", "session", "session_kind", "trial_index", "trial_kind")
CALIBRATED = Calibration(damping_ratio=0.003, origin="session slide/9")


def exported(data: Dataset) -> list[dict[str, str]]:
    return csv_rows(csv_export(data)["contrasts.csv"])


def data_set(chains: Chains, rig: Calibration) -> Dataset:
    return dataset(chains, PAPER, "0", rehearsals=False, rig=rig)


def reported(chains: Chains, rig: Calibration) -> list[dict[str, Any]]:
    origin = Origin(command="touchbeam report study", study_sha256=SHA256, rig=rig)
    loaded = load_study_data(chains, rehearsals=False)
    trials: list[dict[str, Any]] = report_json(report("a study", loaded, PAPER, origin))["trials"]
    return trials


def recorded() -> Chains:
    return recorded_cohort(PAPER, 3, skipped=3)[0]


def registered() -> Chains:
    """A registered study with a session under no registration."""
    lock = StudyRegistered(
        registration=REGISTERED.digest, study_sha256=SHA256, text=REGISTERED.text()
    )
    run = [session(slot, rig) for slot, rig in enumerate((OLD, NEW, OLD))]
    run.append(session_events(PAPER, 3, default_rng(3)))
    return [chain([lock]), *map(chain, run)]


def imported() -> Chains:
    return [published_chain(f"P{who}", {"voltage": 5.0 + who, "pressure": 3.0}) for who in range(3)]


@pytest.mark.parametrize("made", [recorded, registered, imported])
def test_contrasts_are_those_of_the_report(made: Callable[[], Chains]) -> None:
    chains = made()
    rows = exported(data_set(chains, CALIBRATED))
    found = {
        (row["participant"], row["trial_index"] or row["condition"], row["law"]): row
        for row in rows
    }
    trials = reported(chains, CALIBRATED)
    assert len(rows) == len(found) == len(LAWS) * len(trials)
    for trial in trials:
        index = trial["condition"] if trial["kind"] == "published" else str(trial["index"])
        measured = trial["measured"] or {"contrast": None, "error": None}
        for law, predicted in trial["predicted"].items():
            row = found[trial["subject"], index, law]
            assert number(row["predicted_contrast"]) == predicted
            assert number(row["measured_contrast"]) == measured["contrast"]
            assert number(row["measured_contrast_error"]) == measured["error"]
            assert row["touch_measured"] == str(trial["touch_measured"]).lower()
            assert row["rung"] == RUNG


def number(cell: str) -> float | None:
    return float(cell) if cell else None


def test_a_registered_study_keeps_its_calibrations() -> None:
    nominal, calibrated = (exported(data_set(registered(), rig)) for rig in (NOMINAL, CALIBRATED))
    assert nominal == calibrated
    nominal, calibrated = (exported(data_set(recorded(), rig)) for rig in (NOMINAL, CALIBRATED))
    assert nominal != calibrated


def test_every_trial_has_a_row_for_each_law() -> None:
    files = csv_export(nasty(rehearsals=True))
    rows = csv_rows(files["contrasts.csv"])
    described = json.loads(files["contrasts.json"])
    assert list(rows[0]) == list(described) == [column.name for column in CONTRAST_COLUMNS]
    assert described["law"]["levels"].keys() == LAWS.keys()
    assert described["trial_kind"] == json.loads(files["trials.json"])["trial_kind"]
    wanted = [
        (*(trial[name] for name in KEY), law)
        for trial in csv_rows(files["trials.csv"])
        for law in LAWS
    ]
    assert [(*(row[name] for name in KEY), row["law"]) for row in rows] == wanted


def test_without_its_registration_a_study_is_predicted_on_the_present_rig() -> None:
    changed = StudyRegistered(registration=REGISTERED.digest, study_sha256=SHA256, text="changed")
    unlocked = data_set([chain([changed]), chain(session(0, None))], CALIBRATED)
    known = data_set([chain(session(0, None))], CALIBRATED)
    assert exported(unlocked) == exported(known)
