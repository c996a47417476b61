"""Cells without a score: which may be read as an answer, and how the others are told apart."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.loading.study_data import (
    StudyData,
    Why,
    load_study_data,
    notes,
    withheld_beside_scores,
)
from analysis.report.report import Report, report, report_html, report_json
from protocol.journal.events import Event, TrialExcluded
from protocol.study.rules import Exclusions
from tests.analysis.chains import chain, scored_session
from tests.analysis.reports import ORIGIN, PAPER, made

NAMES = ["voltage", "structure", "pressure"]


def session(who: str, scores: list[int | None], *, finished: bool = True) -> list[Event]:
    """A session that answered as many trials as there are scores; None where one was withheld."""
    events = scored_session(who, zip(NAMES, scores, strict=False), NAMES)
    return events if finished else events[:-1]


def loaded(*sessions: list[Event], rules: Exclusions | None = None) -> StudyData:
    return load_study_data(map(chain, sessions), rehearsals=False, rules=rules)


def a_study() -> StudyData:
    """A withheld score, a trial excluded, a session cut short, and one of which nothing is left."""
    excluded = [TrialExcluded(index=index, reason="a noise") for index in range(3)]
    return loaded(
        session("P01", [9, None, 5]),
        [*session("P02", [8, 7, 6]), excluded[1]],
        session("P03", [7], finished=False),
        [*session("P04", [4, 4, 4]), *excluded],
        session("P05", [8, 6, 5]),
    )


def reported(found: StudyData) -> Report:
    shown = ("table4", "methods", "tests", "left-out", "trials")
    return report("a study", found, PAPER, replace(ORIGIN, alone=True), shown)


def test_each_empty_cell_knows_why() -> None:
    assert a_study().empty == {
        (0, 1): Why.WITHHELD,
        (1, 1): Why.EXCLUDED,
        (2, 1): Why.NOT_REACHED,
        (2, 2): Why.NOT_REACHED,
        (3, 0): Why.EXCLUDED,
        (3, 1): Why.EXCLUDED,
        (3, 2): Why.EXCLUDED,
    }


def test_programs_read_why_in_words_that_stay() -> None:
    cells = report_json(reported(a_study()))["table4"]["empty"]
    assert [cell["why"] for cell in cells[:3]] == ["withheld", "excluded", "not reached"]


def test_a_trial_left_out_by_a_rule_is_excluded_too() -> None:
    rules = Exclusions(min_reaction_s=0.15)
    found = loaded(session("P01", [9, 8, 7]), rules=rules)
    assert found.empty == {(0, 0): Why.EXCLUDED}


def test_only_a_withheld_score_is_read_as_0_or_as_the_lowest() -> None:
    numbers = report_json(reported(a_study()))
    means = {name: read["column_means"] for name, read in numbers["missing_readings"].items()}
    assert means["missing"]["structure"] == 6
    assert means["zero"] == {"voltage": 8, "structure": 3, "pressure": pytest.approx(16 / 3)}
    assert means["lowest"]["structure"] == pytest.approx(5.5)
    assert means["lowest"]["pressure"] == pytest.approx(16 / 3)


def test_a_score_withheld_beside_others_is_one_of_the_scores_that_are_averaged() -> None:
    """P01 withheld one of three scores of voltage; the lowest of single scores is 4."""
    repeated = [("voltage", 9), ("voltage", None), ("voltage", 6), ("structure", 4)]
    found = loaded(
        scored_session("P01", [*repeated, ("structure", 8), ("pressure", 5)], NAMES),
        session("P02", [7, 8, 9]),
    )
    assert found.table.is_complete
    first = {name: table.scores[0].tolist() for name, table in found.readings().items()}
    assert first == {
        "missing": [7.5, 6, 5],
        "zero": [pytest.approx(15 / 3), 6, 5],
        "lowest": [pytest.approx(19 / 3), 6, 5],
    }
    assert all(table.scores[1].tolist() == [7, 8, 9] for table in found.readings().values())
    numbers = report_json(reported(found))["missing_readings"]
    assert numbers["zero"]["column_means"]["voltage"] == pytest.approx(6)
    assert 'id="readings"' in report_html(reported(found))


@pytest.mark.parametrize("score", [None, 7])
def test_an_empty_and_a_complete_table_have_one_reading(score: int | None) -> None:
    found = loaded(session("P01", [score] * 3))
    assert found.readings() == {"missing": found.table}


def test_a_blank_cell_of_a_published_table_is_read_as_withheld() -> None:
    numbers = report_json(made([[5, 7, np.nan], [8, 6, 7], [6, 6, 10]]))
    blank = {"subject": "P00", "condition": "pressure", "why": "blank"}
    assert numbers["table4"]["empty"] == [blank]
    assert numbers["missing_readings"]["zero"]["column_means"]["pressure"] == pytest.approx(17 / 3)


def test_the_page_marks_and_counts_each_kind() -> None:
    page = report_html(reported(a_study()))
    link = '<a href="#trials-1-2" aria-label="not given: its trials">–</a>'
    assert f'title="not given">{link}' in page
    assert page.count('title="excluded">×</td>') == 4
    assert page.count('title="not reached">○</td>') == 2
    for said in (
        "– not given, as the answer disagreed with the expectation: 1 cell, also read as 0",
        "× without a score, as the trials are excluded: 4 cells, missing throughout.",
        "○ without a trial, as the session did not get there: 2 cells, missing throughout.",
        "No score at all, and not among the subjects analysed: P04.",
    ):
        assert said in page


def test_without_a_withheld_score_the_page_has_no_readings() -> None:
    found = loaded(session("P01", [9, 8], finished=False), session("P02", [9, 8, 7]))
    assert 'id="readings"' not in report_html(reported(found))
    assert 'id="readings"' in report_html(reported(a_study()))


def test_who_has_no_score_is_named_and_not_counted() -> None:
    result = reported(a_study())
    page = report_html(result)
    assert "4 subjects and 3 conditions had scores and were analysed" in page
    assert "analysed; without scores: P04." in page
    assert report_json(result)["table4"]["unscored_subjects"] == ["P04"]


def test_a_condition_nobody_scored_is_named_and_not_counted() -> None:
    found = loaded(session("P01", [9, 8]), session("P02", [7, 8]))
    assert "Scored by nobody, and not among the conditions analysed: pressure." in notes(
        found.table, found.empty
    )
    page = report_html(reported(found))
    assert "2 subjects and 2 conditions had scores and were analysed" in page
    assert "analysed; without scores: pressure." in page


def test_a_complete_table_has_nothing_to_note() -> None:
    assert 'id="table4-notes"' not in report_html(made())


def test_scores_withheld_in_cells_with_other_scores_are_counted() -> None:
    repeated = [("voltage", 9), ("structure", None), ("structure", 7), ("voltage", 8)]
    found = loaded(
        scored_session("P01", repeated, NAMES), scored_session("P02", repeated[:3], NAMES)
    )
    page = report_html(reported(found))
    assert "Not given in cells with other scores: 2 of 7 scores (structure 2)." in page
    assert "also read as 0 and as the lowest score." in page
    assert "Notes below distinguish" in page, "of pressure, which nobody scored"
    assert withheld_beside_scores(found.trials[found.trials["score"].notna()]) == []
    assert withheld_beside_scores(a_study().trials) == []


def test_a_study_whose_scores_were_all_withheld_has_a_report() -> None:
    page = report_html(reported(loaded(session("P01", [None] * 3))))
    assert "No score at all, and not among the subjects analysed: P01." in page
