"""Provenance: the stated parameters are those that were used."""

import re

import pytest

from analysis.report.report import report_json
from analysis.sensitivity import predictive_checks
from analysis.statistics import monte_carlo
from device.friction.changes import CONDITIONS
from device.friction.contrasts import LAW, predicted_contrast
from device.friction.rungs import TOP_RUNG
from tests.analysis.reports import plain_report


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
    assert predictive_checks.SEED == monte_carlo.SEED
    stated = report_json(plain_report())["provenance"]["seeds"]
    assert stated.endswith(f"; permutations and predictive checks {predictive_checks.SEED}")
