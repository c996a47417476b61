"""Exclusions and interruptions."""

from dataclasses import replace

import numpy as np

from analysis.loading.study_data import load_study_data
from analysis.report.report import report, report_html, report_json
from analysis.report.results import DIFFER, paragraphs
from analysis.report.sections.session_checks import left_out_lines
from protocol.journal.events import Answered, SessionExcluded, SessionOpened, TrialExcluded
from protocol.study.rules import Exclusions
from tests.analysis.chains import chain
from tests.analysis.reports import EXTENDED, ORIGIN, PAPER, cohort, plain_report, session_events


def test_only_complete_sessions_are_reported_as_uninterrupted() -> None:
    undisturbed = "No interruptions or notes were recorded."
    events = chain(session_events(PAPER, 0, np.random.default_rng(1)))
    pages = [
        report_html(report("a", load_study_data([found], rehearsals=False), PAPER, ORIGIN))
        for found in (events, events[:-1])
    ]
    assert undisturbed in pages[0]
    assert undisturbed not in pages[1]
    assert "unfinished sessions: P01, session 1" in pages[1]
    published = report_html(plain_report())
    assert undisturbed not in published
    assert (
        "Interruptions, and the order in which scores were given, are unknown for an" in published
    )
    assert "unfinished sessions: unknown for an imported table" in published


def test_the_terminal_names_who_is_left_out_and_why() -> None:
    rng = np.random.default_rng(1)
    sessions = [session_events(PAPER, slot, rng) for slot in range(3)]
    sessions[0].append(TrialExcluded(index=3, reason="a noise"))
    sessions[1].append(SessionExcluded(reason="fell asleep"))
    sessions[2].pop()
    rehearsed = session_events(PAPER, 0, rng, kind="rehearsal")
    found = load_study_data(map(chain, [*sessions, rehearsed]), rehearsals=False)
    assert left_out_lines(found) == [
        "Left out: P02, session 1 (operator): fell asleep",
        "Left out: P01, session 1, trial 3 (operator): a noise",
        "Left out: rehearsals: 1",
        "Not finished: P03, session 1",
    ]


def test_rehearsals_that_are_included_are_not_counted_as_left_out() -> None:
    rng = np.random.default_rng(1)
    sessions = [
        chain(session_events(PAPER, n, rng, kind=kind))
        for n, kind in enumerate(("participant", "rehearsal"))
    ]
    for included in (False, True):
        found = load_study_data(sessions, rehearsals=included)
        page = report_html(report("a", found, PAPER, ORIGIN))
        assert f"rehearsals left out: {int(not included)}" in page


def test_an_older_study_says_whom_its_rule_left_out_for_not_noticing() -> None:
    """On the page and at the terminal; a study of today leaves nobody out so."""
    told = {}
    for version in ("1.0.0", "2.0.0"):
        sessions = [session_events(PAPER, slot, np.random.default_rng(slot)) for slot in range(3)]
        opened, *others = sessions[0]
        unnoticed = [
            replace(it, agrees=False, score=None) if isinstance(it, Answered) else it
            for it in others
        ]
        sessions[0] = [opened, *unnoticed]
        under = [
            [
                replace(it, versions={"touchbeam": version})
                if isinstance(it, SessionOpened)
                else it
                for it in events
            ]
            for events in sessions
        ]
        study = PAPER.model_copy(update={"exclusions": Exclusions(max_missing_scores=0.5)})
        data = load_study_data(map(chain, under), rehearsals=False, rules=study.exclusions)
        told[version] = report("a", data, study, ORIGIN), left_out_lines(data)
    said = "Left out only because they noticed few changes: P01."
    found, lines = told["1.0.0"]
    assert said in report_html(found)
    assert any(line.startswith(said) for line in lines)
    assert report_json(found)["left_out_for_not_noticing"] == ["P01"]
    assert "more than 50% of the scores missing is left out" in report_html(found)
    found, lines = told["2.0.0"]
    assert (lines, report_json(found)["left_out_for_not_noticing"]) == ([], [])
    assert said not in report_html(found)
    assert "50% of the planned trials without an answer is left out" in report_html(found)


def test_the_first_screen_names_whom_the_rules_left_out() -> None:
    study = EXTENDED.model_copy(update={"exclusions": Exclusions(max_false_alarms=0.2)})
    data = load_study_data(cohort(study, 4), rehearsals=False, rules=study.exclusions)
    out = [it.participant for it in data.left_out if it.by == "rule"]
    assert 0 < len(out) < 4
    answer = dict(paragraphs(report("a study", data, study, ORIGIN)))[DIFFER]
    assert f"left out by the study's rules ({', '.join(out)})" in answer
    everybody = load_study_data(cohort(study, 4), rehearsals=False)
    assert "left out" not in dict(paragraphs(report("a study", everybody, study, ORIGIN)))[DIFFER]
