"""The tests of the conditions, and why there is none."""

import numpy as np

from analysis.report.report import report_html, report_json
from tests.analysis.reports import NAMES, SCORES, made


def test_a_missing_score_has_no_test_and_says_why() -> None:
    numbers = report_json(made([[5, 7, np.nan], *SCORES[1:]]))
    assert numbers["table4"]["rows"][0]["scores"] == [5, 7, None]
    assert numbers["friedman"]["chi2"] is None
    assert "1 of 12 are missing" in numbers["friedman"]["reason"]


def test_one_subject_agrees_with_nobody_and_equal_scores_are_no_test() -> None:
    result = made([[7, 7, 7]])
    numbers = report_json(result)
    assert numbers["kendall_w"] is None
    assert "at least 2 subjects" in numbers["friedman"]["reason"]
    for pair in numbers["pairwise"]:
        assert (pair["p"], pair["p_holm"]) == (None, None)
        assert "no difference in any subject" in pair["reason"]
    assert "No pair of conditions can be tested." in report_html(result)


def test_a_condition_nobody_scored_is_named_beside_the_test_that_leaves_it_out() -> None:
    result = made([[5, 7, np.nan, 8], [6, 9, np.nan, 7], [4, 5, np.nan, 9]], names=(*NAMES, "d"))
    assert report_json(result)["skillings_mack"]["left_out"] == ["pressure"]
    assert "equal conditions, without pressure, which nobody scored: T(2)" in report_html(result)
    holed = report_html(made([[5, 7, np.nan], *SCORES[1:]]))
    assert "test of equal conditions: T(2)" in holed
