"""Checks of whole sessions: the page says on which trials each of them rests."""

from analysis.report.report import report_html
from tests.analysis.reports import study_report


def test_the_page_says_after_which_trials_carry_over_is_tested() -> None:
    assert "Carry-over from the scored trial directly before: " in report_html(study_report())
