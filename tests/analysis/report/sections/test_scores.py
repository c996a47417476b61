"""Table 4 on the page and as data: missing scores, and the link of each cell."""

import numpy as np
import pytest

from analysis.loading.published import unpredicted_note
from analysis.report.report import report_html, report_json
from tests.analysis.reports import SCORES, ReadPage, made, plain_report, study_report


def test_a_subject_without_scores_has_a_row() -> None:
    numbers = report_json(made([[np.nan] * 3, *SCORES[1:2]]))
    assert numbers["table4"]["rows"][0]["comprehensive"] is None


def test_missing_scores_are_read_in_three_ways() -> None:
    numbers = report_json(made([[5, 7, np.nan], [8, 6, 7], [6, 6, 10], [7, 9, 6]]))
    means = {
        name: reading["column_means"]["pressure"]
        for name, reading in numbers["missing_readings"].items()
    }
    assert means == {"missing": pytest.approx(23 / 3), "zero": 5.75, "lowest": 7.0}
    assert numbers["friedman"]["skillings_mack"]["df"] == 2
    assert numbers["missing_readings"]["zero"]["friedman"]["chi2"] is not None


def test_names_with_commas_are_told_apart() -> None:
    names = ("5 N, slow", "5 N, fast", "voltage")
    note = unpredicted_note(names)
    assert note
    assert note.startswith("No contrast is predicted for 5 N, slow; 5 N, fast: the")
    page = report_html(made([[np.nan, np.nan, 5], [np.nan, np.nan, 6]], names=names))
    assert "not among the conditions analysed: 5 N, slow; 5 N, fast." in page


def test_every_score_links_to_its_trials_and_every_average_to_predictions() -> None:
    page = ReadPage(report_html(study_report()))
    links = [attrs["href"] for tag, attrs in page.tags if tag == "a"]
    targets = {f"#{attrs['id']}" for _, attrs in page.tags if "id" in attrs}
    assert set(links) <= targets
    assert {f"#trials-{row}-{column}" for row in range(1, 5) for column in range(1, 6)} <= set(
        links
    )
    assert links.count("#predictions") == 5


def test_the_table_bears_its_name() -> None:
    assert "<caption><strong>Table 4.</strong> Scores by subject" in report_html(plain_report())
