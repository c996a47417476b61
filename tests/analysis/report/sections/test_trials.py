"""Tables of the trials."""

from analysis.report.report import report_html
from tests.analysis.reports import plain_report


def test_published_trials_have_standard_touches_instead_of_planned_ones() -> None:
    published = report_html(plain_report())
    assert "<td>standard</td>" in published
    assert "<td>as planned</td>" not in published
