"""Cells of Table 4: why one has no score, and which way its changes were felt."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.loading.response import Directions
from analysis.loading.study_data import StudyData, Why, load_study_data
from analysis.report.report import Report, report, report_files, report_html, report_json
from protocol.journal.events import Event, TrialExcluded
from protocol.study.rules import Exclusions
from tests.analysis.chains import asked_session, chain, scored_session
from tests.analysis.reports import ORIGIN, PAPER, made

NAMES = ["voltage", "structure", "pressure"]
SAME = "same"
OTHER = "rougher"


def session(who: str, given: list[int | str | None], *, finished: bool = True) -> list[Event]:
    """A session of as many trials: scores after the expected answer, or another answer."""
    told = [
        (name, own, None) if isinstance(own, str) else (name, "smoother", own)
        for name, own in zip(NAMES, given, strict=False)
    ]
    events = asked_session(who, told, NAMES)
    return events if finished else events[:-1]


def loaded(*sessions: list[Event], rules: Exclusions | None = None) -> StudyData:
    return load_study_data(map(chain, sessions), rehearsals=False, rules=rules)


def a_study() -> StudyData:
    """Both other answers, a trial excluded, a session cut short, one of which nothing is left."""
    excluded = [TrialExcluded(index=index, reason="a noise") for index in range(3)]
    return loaded(
        session("P01", [9, SAME, 5]),
        [*session("P02", [8, 7, OTHER]), excluded[1]],
        session("P03", [7], finished=False),
        [*session("P04", [4, 4, 4]), *excluded],
        session("P05", [8, 6, 5]),
    )


def reported(found: StudyData) -> Report:
    shown = ("table4", "methods", "tests", "left-out", "trials")
    return report("a study", found, PAPER, replace(ORIGIN, alone=True), shown)


def test_each_empty_cell_knows_why() -> None:
    assert a_study().empty == {
        (0, 1): Why.SAME,
        (1, 1): Why.EXCLUDED,
        (1, 2): Why.CONTRARY,
        (2, 1): Why.NOT_REACHED,
        (2, 2): Why.NOT_REACHED,
        (3, 0): Why.EXCLUDED,
        (3, 1): Why.EXCLUDED,
        (3, 2): Why.EXCLUDED,
    }


def test_an_answer_is_a_response_and_what_was_not_answered_is_none() -> None:
    responses = reported(a_study()).trials.response_tests.table.scores
    none = [np.nan] * 3
    expected = [[10, 0, 6], [9, np.nan, 0], [8, np.nan, np.nan], none, [9, 7, 6]]
    np.testing.assert_array_equal(responses, expected)


def test_programs_read_why_in_words_that_stay() -> None:
    cells = report_json(reported(a_study()))["table4"]["empty"]
    why = [cell["why"] for cell in cells[:4]]
    assert why == ["same", "excluded", "contrary", "not reached"]


def test_a_trial_left_out_by_a_rule_is_excluded_too() -> None:
    rules = Exclusions(min_reaction_s=0.15)
    found = loaded(session("P01", [9, 8, 7]), rules=rules)
    assert found.empty == {(0, 0): Why.EXCLUDED}


@pytest.mark.parametrize(
    ("answers", "why"),
    [
        ([OTHER], Why.CONTRARY),
        ([SAME], Why.SAME),
        ([SAME, OTHER, SAME], Why.CONTRARY),
        ([SAME, SAME], Why.SAME),
    ],
)
def test_a_change_that_was_ever_felt_the_other_way_says_so(answers: list[str], why: Why) -> None:
    given = [("voltage", answer, None) for answer in answers]
    found = loaded(asked_session("P01", given, NAMES), session("P02", [7, 8, 9]))
    assert found.empty[0, 0] is why


def test_a_cell_that_was_not_asked_has_no_way() -> None:
    published = load_study_data(
        [chain(scored_session("P01", [("voltage", 9)], NAMES))], rehearsals=False
    )
    assert published.ways == {}


def test_a_score_is_the_mean_of_those_given_and_bears_a_mark_beside_other_ways() -> None:
    """P01 felt the voltage change the other way twice of three times, and the structure once."""
    repeated = [
        ("voltage", OTHER, None),
        ("voltage", "smoother", 6),
        ("voltage", OTHER, None),
        ("structure", "smoother", 4),
        ("structure", OTHER, None),
        ("structure", "smoother", 8),
        ("pressure", SAME, None),
    ]
    found = loaded(asked_session("P01", repeated, NAMES), session("P02", [7, 8, 9]))
    np.testing.assert_array_equal(found.table.scores[0], [6, 6, np.nan])
    assert found.ways[0, 0] == Directions(expected=1, contrary=2, same=0)
    assert found.ways[0, 1] == Directions(expected=2, contrary=1, same=0)
    assert dict(found.marks) == {(0, 0): "⇄", (0, 1): "⇄", (0, 2): "="}
    result = reported(found)
    page = report_html(result)
    assert 'title="1 as expected, 2 the other way"' in page
    assert ">6 ⇄</a>" in page
    np.testing.assert_allclose(result.trials.response_tests.table.scores[0], [7 / 3, 14 / 3, 0])


def test_a_blank_cell_of_a_published_table_is_unknown() -> None:
    numbers = report_json(made([[5, 7, np.nan], [8, 6, 7], [6, 6, 10]]))
    blank = {"subject": "P00", "condition": "pressure", "why": "blank"}
    assert numbers["table4"]["empty"] == [blank]
    assert numbers["responses"]["means"]["pressure"] == 8.5
    assert numbers["friedman"]["of"] == "score"
    assert numbers["skillings_mack"]["df"] == 2


def test_the_page_marks_and_counts_each_kind() -> None:
    page = report_html(reported(a_study()))
    for at, mark, ways in (("1-2", "=", "1 no change"), ("2-3", "⇄", "1 the other way")):
        link = f'<a href="#trials-{at}" aria-label="{ways}: its trials">{mark}</a>'
        assert f'title="{ways}">{link}' in page
    assert page.count('title="excluded">×</td>') == 4
    assert page.count('title="not reached">○</td>') == 2
    for said in (
        "⇄ some or all changes were felt the other way: 1 cell.",
        "= no change was noticed: 1 cell.",
        "× without a score, as the trials are excluded: 4 cells.",
        "○ without a trial, as the session did not get there: 2 cells.",
        "Subjects without a score that counts, as their trials are left out: P04.",
    ):
        assert said in page


def test_latex_can_set_the_marks_that_its_note_explains() -> None:
    tex = report_files(reported(a_study()), figures=False)["table4.tex"].decode()
    assert r"P01 & 9 & = & 5 & 7.00 \\" in tex
    assert r"P02 & 8 & $\times$ & $\rightleftharpoons$ & 8.00 \\" in tex
    assert r"P03 & 7 & $\circ$ & $\circ$ & 7.00 \\" in tex
    assert r"$\rightleftharpoons$ some or all changes were felt the other way: 1 cell." in tex
    assert not set("⇄×○") & set(tex)


def test_who_has_no_answer_is_named_and_not_counted() -> None:
    result = reported(a_study())
    assert "Four participants and three conditions were analysed" in report_html(result)
    assert report_json(result)["table4"]["unscored_subjects"] == ["P04"]


def test_who_scored_nothing_but_answered_is_counted() -> None:
    found = loaded(session("P01", [9, 8, 7]), session("P02", [SAME, OTHER, SAME]))
    result = reported(found)
    assert "Two participants and three conditions were analysed" in report_html(result)
    assert report_json(result)["table4"]["unscored_subjects"] == ["P02"]
    assert "Subjects without any score: P02." in found.notes


def test_a_condition_nobody_reached_is_named_and_not_counted() -> None:
    found = loaded(session("P01", [9, 8]), session("P02", [7, 8]))
    assert "Conditions without any score: pressure." in found.notes
    assert "Two participants and two conditions were analysed" in report_html(reported(found))


def test_a_complete_table_has_nothing_to_note() -> None:
    assert 'id="table4-notes"' not in report_html(made())
    assert loaded(session("P01", [9, 8, 7])).notes == []


def test_scores_given_after_another_answer_are_in_the_table_and_are_counted() -> None:
    given = [("voltage", OTHER, 4), ("structure", SAME, 2), ("pressure", "smoother", 8)]
    found = loaded(asked_session("P01", given, NAMES), session("P02", [7, 8, 9]))
    assert found.table.scores[0].tolist() == [4, 2, 8]
    assert dict(found.marks) == {(0, 0): "⇄"}
    result = reported(found)
    assert result.trials.response_tests.table.scores[0].tolist() == [0, 0, 9]
    beside = "2 of these scores were given after another answer than the expected one; the tests"
    assert f"{beside} count those trials as 0." in report_html(result)
    numbers = report_json(result)
    assert numbers["friedman"]["of"] == "response"
    assert numbers["scores"]["friedman"]["of"] == "score", "where nobody withheld one"


def test_a_study_whose_changes_were_all_felt_as_none_has_a_report() -> None:
    page = report_html(reported(loaded(session("P01", [SAME] * 3))))
    assert "Subjects without any score: P01." in page
    assert "One participant and three conditions were analysed" in page
