"""The section on measured friction: only where something was recorded, beside the predicted."""

from dataclasses import replace
from functools import cache

import pytest

from analysis.loading.study_data import load_study_data
from analysis.report.report import Report, report, report_html, report_json
from analysis.report.results import paragraphs
from analysis.sensitivity.ordinal_model import OrdinalSensitivity
from tests.analysis.friction.recorded_sessions import recorded_cohort
from tests.analysis.report.test_report import nulls_without_reason
from tests.analysis.reports import ORIGIN, PAPER, ReadPage, plain_report, study_report

MEASURED = "Do they follow the change that was measured?"


@cache
def measured_report() -> Report:
    chains, _ = recorded_cohort(PAPER, 4, skipped=2)
    return report("a study", load_study_data(chains, rehearsals=False), PAPER, ORIGIN)


def test_a_report_without_recordings_says_nothing_of_them() -> None:
    numbers = report_json(plain_report())
    assert "measured" not in numbers
    assert {trial["measured"] for trial in numbers["trials"]} == {None}
    assert "Sensitivity to measured friction" not in report_html(plain_report())


def test_measured_contrasts_and_gains_stand_beside_the_predicted_ones() -> None:
    page = ReadPage(report_html(measured_report()))
    tables = {attrs.get("id") for tag, attrs in page.tags if tag == "table"}
    assert {"measured-contrasts", "measured-gains", "measured-spread", "predictors"} <= tables
    assert "Sensitivity to measured friction" in page.words
    text = " ".join(page.words)
    assert "4 scored trials, because it was not recorded" in text


def test_the_results_in_words_take_the_measured_gains() -> None:
    told = dict(paragraphs(measured_report()))
    assert "of measured contrast" in told[MEASURED]
    assert MEASURED not in dict(paragraphs(study_report())), "where no friction was measured"
    assert "not a matter of skin" in told["Are some people more sensitive?"]
    assert (
        "skin and perception" in dict(paragraphs(study_report()))["Are some people more sensitive?"]
    )


@pytest.mark.parametrize(
    ("gain", "ends", "told", "shown"),
    [
        (2.5, (1.0, 4.0), "2.50 points in the group, 95% CI [1.00, 4.00], ", "so ratings follow"),
        (
            *(-2.5, (-4.0, -1.0)),
            *("−2.50 points in the group, 95% CI [−4.00, −1.00], ", "so ratings fall where"),
        ),
        (
            *(-0.5, (-2.0, 1.0)),
            *("−0.50 points in the group, 95% CI [−2.00, 1.00], ", "which includes 0, so"),
        ),
    ],
)
def test_a_measured_gain_is_told_by_a_number_with_its_sign(
    gain: float, ends: tuple[float, float], told: str, shown: str
) -> None:
    fit = study_report().trials.m2
    assert isinstance(fit, OrdinalSensitivity)
    found = measured_report()
    assert found.measured is not None
    measured = replace(found.measured)
    lines = replace(fit.lines, gain=gain, gain_interval=ends)
    vars(measured)["m2"] = replace(fit, lines=lines)
    answer = dict(paragraphs(replace(found, measured=measured)))[MEASURED]
    answer = answer.replace("\N{NO-BREAK SPACE}", " ")
    assert f"ratings change by {told}{shown}" in answer


def test_json_has_models_predictors_and_a_reason_for_each_missing_number() -> None:
    numbers = report_json(measured_report())
    found = numbers["measured"]
    assert list(found["models"]) == ["M1", "M2", "M3"]
    assert len(found["predictors"]) == 4
    assert found["left_out"] == {"it was not recorded": 4}
    assert [entry["condition"] for entry in found["conditions"]] == list(PAPER.conditions)[:5]
    assert nulls_without_reason(found) == []
    trials = [trial for trial in numbers["trials"] if trial["kind"] == "trial"]
    known = [trial["measured"] for trial in trials if trial["measured"] is not None]
    assert (len(trials), len(known)) == (20, 16)
    assert all(each.keys() == {"contrast", "error"} and each["error"] > 0 for each in known)
    unknown = [trial["measured_reason"] for trial in trials if trial["measured"] is None]
    assert unknown == ["it was not recorded"] * 4
