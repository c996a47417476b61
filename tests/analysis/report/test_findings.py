"""Scale of the scores: named in the report's texts and used by its figures."""

from dataclasses import replace
from functools import cache

import numpy as np

from analysis.loading.study_data import load_study_data
from analysis.report.findings import Scale
from analysis.report.report import Report, report, report_html
from protocol.journal.events import Answered
from tests.analysis.chains import chain
from tests.analysis.reports import ORIGIN, PAPER, plain_report, session_events

HUNDRED = PAPER.model_copy(
    update={"rating": PAPER.rating.model_copy(update={"minimum": 0, "maximum": 100})}
)


@cache
def of_a_hundred() -> Report:
    """Return a report of two sessions with scores ten times those of the paper."""
    rng = np.random.default_rng(1)
    sessions = [
        chain(
            replace(event, score=10 * event.score)
            if isinstance(event, Answered) and event.score
            else event
            for event in session_events(PAPER, slot, rng)
        )
        for slot in range(2)
    ]
    return report("a study", load_study_data(sessions, rehearsals=False), HUNDRED, ORIGIN)


def test_the_scale_is_the_studys_or_that_of_the_published_table() -> None:
    assert of_a_hundred().scale == Scale(0, 100)
    assert str(of_a_hundred().scale) == "0 to 100"
    assert replace(plain_report(), study=HUNDRED).scale == Scale(0, 10)


def test_captions_methods_and_figures_name_the_studys_scale() -> None:
    page = report_html(of_a_hundred())
    assert "condition, 0 (no effect) to 100 (very effective)." in page
    assert "strength of the effect from 0 (no effect) to 100 (very effective)." in page
    assert ">score, 0 to 100</text>" in page
    assert ">rating, 0 to 100</text>" in page
    assert "to 10 (very effective)" not in page
    assert "0 to 10 -->" not in page


def test_only_the_highest_score_of_the_scale_is_at_the_ceiling() -> None:
    warning = "of the scores are the highest possible"
    assert f"8% {warning}" in report_html(plain_report())
    assert warning not in report_html(of_a_hundred())
