"""The trials behind the numbers."""

from analysis.report.report import report_html
from tests.analysis.reports import plain_report


def test_of_a_published_trial_no_plan_is_claimed() -> None:
    published = report_html(plain_report())
    assert "<td>standard</td>" in published
    assert "<td>as planned</td>" not in published
