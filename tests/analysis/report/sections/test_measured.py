"""Friction as it was measured: what the model of the answers takes where touches were recorded."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from analysis.estimates import Estimate
from analysis.loading.study_data import load_study_data
from analysis.report.report import Report, report, report_html, report_json
from analysis.report.results import paragraphs
from analysis.sensitivity.answers_model import Rated
from tests.analysis.friction.recorded_sessions import recorded_cohort
from tests.analysis.report.test_report import nulls_without_reason
from tests.analysis.reports import (
    ORIGIN,
    PAPER,
    ReadPage,
    cohort,
    plain_report,
    study_report,
    with_sensitivity,
)

MEASURED = "Do they follow the change that was measured?"


@cache
def measured_report() -> Report:
    chains, _ = recorded_cohort(PAPER, 4, skipped=2)
    return report("a study", load_study_data(chains, rehearsals=False), PAPER, ORIGIN)


def test_a_report_without_recordings_says_nothing_of_them() -> None:
    numbers = report_json(plain_report())
    assert "measured" not in numbers
    assert {trial["measured"] for trial in numbers["trials"]} == {None}
    assert numbers["rating"]["predictor"] == "predicted contrast"
    assert "measured contrast" not in report_html(plain_report())


def test_where_friction_was_measured_the_model_takes_it_for_the_predicted_one() -> None:
    found = measured_report()
    page = ReadPage(report_html(found))
    tables = [attrs.get("id") for tag, attrs in page.tags if tag == "table"]
    assert tables.count("gains") == tables.count("measured-contrasts") == 1
    text = " ".join(page.words)
    assert "4 scored trials, because it was not recorded" in text
    assert "points per unit of measured contrast" in text
    assert "per unit of predicted contrast" not in text.partition("Sensitivity")[2]
    assert found.measured is not None
    np.testing.assert_array_equal(found.predictor[0], found.measured.trials.best)
    figure = next(it for it in found.figures if it.name == "model")
    assert "The line is the group's" not in figure.caption, "not among predicted contrasts"


def test_few_recordings_leave_the_model_to_predicted_contrasts() -> None:
    """Where less than half of the trials that count have a measured contrast."""
    recorded, _ = recorded_cohort(PAPER, 1)
    chains = [*recorded, *cohort(PAPER, 4)[1:]]
    found = report("a study", load_study_data(chains, rehearsals=False), PAPER, ORIGIN)
    assert found.predictor[1] is False
    numbers = report_json(found)
    assert numbers["rating"]["predictor"] == "predicted contrast"
    assert len(numbers["sensitivity"]) == 4, "nobody is left out for a want of recordings"
    assert "measured" in numbers


def test_the_results_in_words_take_the_measured_gains() -> None:
    told = dict(paragraphs(measured_report()))
    assert "of measured contrast" in told[MEASURED]
    assert MEASURED not in dict(paragraphs(study_report())), "where no friction was measured"
    for found, skin in (
        (measured_report(), "not a matter of skin"),
        (study_report(), "skin and perception cannot be told apart"),
    ):
        rating = found.sensitivity.rating
        assert isinstance(rating, Rated)
        known = replace(found.sensitivity, rating=replace(rating, untold=None))
        answer = dict(paragraphs(with_sensitivity(found, known)))["Are some people more sensitive?"]
        assert skin in answer


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
    found = measured_report()
    rating = found.sensitivity.rating
    assert isinstance(rating, Rated)
    other = replace(rating, gain=Estimate(value=gain, interval=ends))
    known = with_sensitivity(found, replace(found.sensitivity, rating=other))
    answer = dict(paragraphs(known))[MEASURED]
    answer = answer.replace("\N{NO-BREAK SPACE}", " ")
    assert f"ratings change by {told}{shown}" in answer


def test_json_has_measured_conditions_and_a_reason_for_each_missing_number() -> None:
    numbers = report_json(measured_report())
    assert numbers["rating"]["predictor"] == "measured contrast"
    found = numbers["measured"]
    assert found.keys() == {"conditions", "left_out"}
    assert found["left_out"] == {"it was not recorded": 4}
    assert [entry["condition"] for entry in found["conditions"]] == list(PAPER.conditions)[:5]
    assert nulls_without_reason(found) == []
    trials = [trial for trial in numbers["trials"] if trial["kind"] == "trial"]
    known = [trial["measured"] for trial in trials if trial["measured"] is not None]
    assert (len(trials), len(known)) == (20, 16)
    assert all(each.keys() == {"contrast", "error"} and each["error"] > 0 for each in known)
    unknown = [trial["measured_reason"] for trial in trials if trial["measured"] is None]
    assert unknown == ["it was not recorded"] * 4
