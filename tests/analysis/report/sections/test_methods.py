"""Provenance: the stated parameters are those that were used."""

import re
from dataclasses import replace

import pytest

from analysis.loading.study_data import load_study_data
from analysis.report.report import report, report_html, report_json
from analysis.sensitivity import predictive_checks
from analysis.statistics import omnibus
from device.friction.calibration import Calibration
from device.friction.changes import CONDITIONS, LAW, predicted_contrast
from device.friction.rungs import TOP_RUNG
from tests.analysis.reports import EXTENDED, ORIGIN, PAPER, cohort, plain_report


def test_the_stated_rung_is_the_one_used_for_predictions() -> None:
    numbers = report_json(plain_report())
    stated = re.search(r"\brung ([\w-]+)", numbers["provenance"]["model parameters"])
    assert stated is not None
    trial = next(trial for trial in numbers["trials"] if trial["condition"] == "voltage")
    by_rung = {
        rung: predicted_contrast(CONDITIONS["voltage"], LAW, rung) for rung in ("mode", TOP_RUNG)
    }
    assert trial["predicted"][LAW] == by_rung[stated[1]]
    assert by_rung[TOP_RUNG] != pytest.approx(by_rung["mode"], rel=1e-9)


def test_the_seeds_of_permutations_and_predictive_checks_are_stated() -> None:
    assert predictive_checks.SEED == omnibus.SEED
    stated = report_json(plain_report())["provenance"]["seeds"]
    assert stated.endswith(f"; permutations and predictive checks {predictive_checks.SEED}")


def test_a_calibrated_rig_is_used_and_named() -> None:
    own = Calibration(damping_ratio=0.004, gain=1.1, origin="session slide/1")
    found = load_study_data(cohort(EXTENDED, 2), rehearsals=False, rules=EXTENDED.exclusions)
    plain, calibrated = (
        report("a study", found, EXTENDED, origin, shown=("methods",))
        for origin in (replace(ORIGIN, alone=True), replace(ORIGIN, alone=True, rig=own))
    )
    stated = report_json(calibrated)["provenance"]["model parameters"]
    assert "damping ratio 0.004" in stated
    assert "gain of the drive 1.1, rig session slide/1" in stated
    assert f"with the rig as calibrated: {own};" in report_html(calibrated)
    assert "as calibrated" not in report_html(plain)
    for kept, before in zip(calibrated.trials.ranges, plain.trials.ranges, strict=True):
        assert kept.value != before.value
        assert set(kept.by_damping) & {"0.004"}


def test_a_calibration_does_not_apply_to_published_scores() -> None:
    own = replace(ORIGIN, rig=Calibration(damping_ratio=0.004, origin="session slide/1"))
    calibrated = report("a study", plain_report().loaded, PAPER, own)
    assert report_json(calibrated) == report_json(plain_report())
