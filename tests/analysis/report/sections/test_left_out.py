"""Exclusions and interruptions."""

import numpy as np

from analysis.loading.study_data import load_study_data
from analysis.report.report import report, report_html
from tests.analysis.chains import chain
from tests.analysis.reports import ORIGIN, PAPER, plain_report, session_events


def test_only_complete_sessions_are_reported_as_uninterrupted() -> None:
    undisturbed = "No interruptions or notes were recorded."
    events = chain(session_events(PAPER, 0, np.random.default_rng(1)))
    pages = [
        report_html(report("a", load_study_data([found], rehearsals=False), PAPER, ORIGIN))
        for found in (events, events[:-1])
    ]
    assert undisturbed in pages[0]
    assert undisturbed not in pages[1]
    assert "unfinished sessions: P01" in pages[1]
    published = report_html(plain_report())
    assert undisturbed not in published
    assert "Interruptions are unknown for a published table." in published
    assert "unfinished sessions: unknown for a published table" in published
