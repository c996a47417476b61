"""Effects of conditions, and the reasons for missing ones."""

from analysis.report.report import report_json
from tests.analysis.reports import made


def test_correlations_of_equal_scores_are_null_with_a_reason() -> None:
    numbers = report_json(made([[5, 5, 5]] * 3))
    law = numbers["laws"][0]
    assert (law["spearman"], law["p"]) == (None, None)
    assert law["reason"] == "all contrasts, or all mean ratings, are equal"
    assert "same score" in numbers["kendall_w_reason"]
