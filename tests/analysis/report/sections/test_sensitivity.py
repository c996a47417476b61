"""Sensitivities and the detection of changes."""

import numpy as np
import pytest

from analysis.report.report import report_html, report_json
from tests.analysis.reports import made, study_report


def test_catch_and_opposite_trials_give_change_detection() -> None:
    numbers = report_json(study_report())
    detection = numbers["sensitivity_models"]["M3"]["detection"]
    assert [entry["subject"] for entry in detection] == ["P01", "P02", "P03", "P04"]
    assert numbers["checks"]["catch_trials"]["overall"]["false_alarms"]["trials"] == 16
    assert numbers["checks"]["drift"]["df"] > 0


def test_a_single_subject_has_no_relative_gain() -> None:
    scores = [[5, 7, 9, 4, 8]]
    names = ("voltage", "structure", "pressure", "frequency", "direction")
    numbers = report_json(made(scores, names=names))
    assert numbers["sensitivity"] == []
    reason = "its integration over the differences between people"
    assert reason in numbers["sensitivity_reason"]
    (line,) = numbers["sensitivity_simple"]["subjects"]
    assert (line["relative_gain"], line["relative_gain_ci"]) == (None, [None, None])
    assert line["relative_gain_reason"] == "a single subject has no others to compare with"
    m1 = numbers["sensitivity_models"]["M1"]
    assert m1["population"] is None
    assert m1["population_reason"] == "a single subject tells nothing about a population"


def test_ratings_without_a_latent_scale_leave_the_simple_comparison() -> None:
    result = made([[5, 7, 7], [7, 7, 5], [5, 5, 7]])
    numbers = report_json(result)
    assert numbers["sensitivity_model"] == "M2"
    assert numbers["sensitivity"] == []
    assert "at least 3 are needed" in numbers["sensitivity_reason"]
    assert len(numbers["sensitivity_simple"]["subjects"]) == 3
    assert "M2 has no estimates: two different ratings" in report_html(result)


def test_a_fit_with_too_few_effective_points_is_withheld(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analysis.sensitivity.integration.LEAST_EFFECTIVE", 1e9)
    result = made()
    numbers = report_json(result)
    assert numbers["sensitivity"] == numbers["sensitivity_simple"]["subjects"] == []
    assert "effective points" in numbers["sensitivity_reason"]
    assert "effective points" in numbers["sensitivity_simple"]["reason"]
    assert 'id="gains"' not in report_html(result)


def test_who_gave_no_score_has_no_row_and_a_single_subject_no_group() -> None:
    names = ("voltage", "structure", "pressure", "frequency")
    scores = [[5, 7, 9, 4], [6, 8, 9, 3], [4, 6, 9, 5], [np.nan] * 4]
    page = report_html(made(scores, names=names))
    table = page[page.index('id="simple"') :]
    assert ">P02<" in table[: table.index("</table>")]
    assert ">P03<" not in table[: table.index("</table>")]
    alone = report_html(made(scores[:1], names=names))
    assert "unbounded,\N{NO-BREAK SPACE}unbounded" not in alone
