"""Tests of the differences between conditions, and the reasons for missing tests."""

from html import unescape

import numpy as np

from analysis.report.report import report_html, report_json
from tests.analysis.reports import NAMES, SCORES, made


def test_friedmans_test_of_an_incomplete_table_is_null_with_a_reason() -> None:
    numbers = report_json(made([[5, 7, np.nan], *SCORES[1:]]))
    assert numbers["table4"]["rows"][0]["scores"] == [5, 7, None]
    assert numbers["friedman"]["chi2"] is None
    assert "1 of 12 are empty" in numbers["friedman"]["reason"]


def test_a_single_subject_with_equal_scores_allows_no_test() -> None:
    result = made([[7, 7, 7]])
    numbers = report_json(result)
    assert numbers["kendall_w"] is None
    assert "at least 2 subjects" in numbers["friedman"]["reason"]
    for pair in numbers["pairwise"]:
        assert (pair["p"], pair["p_holm"]) == (None, None)
        assert "no difference in any subject" in pair["reason"]
    assert "No pair of conditions can be tested." in report_html(result)


def test_a_condition_without_scores_is_omitted_from_the_omnibus_test_and_named() -> None:
    result = made([[5, 7, np.nan, 8], [6, 9, np.nan, 7], [4, 5, np.nan, 9]], names=(*NAMES, "d"))
    assert report_json(result)["skillings_mack"]["left_out"] == ["pressure"]
    reason = "in place of Friedman's test, because cells are empty"
    omitted = f"equal conditions ({reason}; omitted, since empty: pressure): T(2)"
    assert omitted in unescape(report_html(result))
    holed = report_html(made([[5, 7, np.nan], *SCORES[1:]]))
    assert f"test of equal conditions ({reason}): T(2)" in unescape(holed)


def test_the_page_says_when_no_scores_of_so_few_subjects_can_show_a_difference() -> None:
    none = "No pair of conditions differs significantly after Holm's correction."
    few = f"{none} So few participants cannot show it: p (Holm) is at least"
    one_way = np.arange(4)[:, None] + [5, 6, 7]
    assert f"{few} 0.38." in unescape(report_html(made(one_way)))
    assert f"{few} 1." in unescape(report_html(made(one_way[:1])))
    page = unescape(report_html(made([[5, 6, 7], [7, 6, 5]] * 4)))
    assert none in page
    assert few not in page


def test_which_p_decides_is_said() -> None:
    """Exact of a few, of shufflings where these are too many to list, of chi-square of a large
    table."""
    rng = np.random.default_rng(1)
    names = tuple(f"condition {number}" for number in range(8))
    told = {
        "p_exact": made(SCORES),
        "p_monte_carlo": made(rng.integers(0, 11, (9, 8)).tolist(), names=names),
        "p": made(rng.integers(0, 11, (70, 8)).tolist(), names=names),
    }
    words = {
        "p_exact": "exact permutation p",
        "p_monte_carlo": "shufflings within subjects",
        "p": "(of chi-square, which is accurate in a table of this size)",
    }
    for used, result in told.items():
        found = report_json(result)["friedman"]
        assert found["p_used"] == used
        assert found[used] is not None
        assert words[used] in unescape(report_html(result))
