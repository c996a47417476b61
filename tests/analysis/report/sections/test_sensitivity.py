"""Sensitivities and the detection of changes."""

from analysis.report.report import report_json
from tests.analysis.reports import study_report


def test_catch_and_opposite_trials_give_change_detection() -> None:
    numbers = report_json(study_report())
    detection = numbers["sensitivity_models"]["M3"]["detection"]
    assert [entry["subject"] for entry in detection] == ["P01", "P02", "P03", "P04"]
    assert numbers["checks"]["catch_trials"]["overall"]["false_alarms"]["trials"] == 16
    assert numbers["checks"]["drift"]["df"] > 0
