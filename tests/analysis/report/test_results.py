"""The results in words: what is said of clear, of unclear and of missing results."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.report.findings import Findings
from analysis.report.page import masthead
from analysis.report.results import paragraphs
from analysis.sensitivity.ordinal_model import OrdinalSensitivity
from protocol.study.rules import Publication
from tests.analysis.reports import PAPER, made, plain_report, study_report, with_m2

CLEAR = [[1, 5, 9], [2, 6, 10], [0, 4, 8], [1, 5, 10], [2, 4, 9], [1, 6, 8], [0, 5, 9]]


def said(found: Findings) -> dict[str, str]:
    """Return the answers by question, with plain spaces."""
    return {asked: told.replace("\N{NO-BREAK SPACE}", " ") for asked, told in paragraphs(found)}


def test_clear_differences_are_told_with_their_size_and_interval() -> None:
    found = said(made(CLEAR))
    assert found["Do the conditions differ?"].startswith(
        "Seven participants rated three conditions from 0 to 10. "
        "Ratings differed between conditions, Friedman's χ²(2) = 14.00, p < .001, "
    )
    which = found["Which ones?"]
    assert "pressure (M = 9.00) was rated above voltage (M = 1.00) by 8.00, 95% CI [" in which
    assert "p = .047, r = 1.00" in which


def test_the_larger_mean_comes_first_whatever_the_order_of_the_columns() -> None:
    which = said(made([row[::-1] for row in CLEAR]))["Which ones?"]
    assert "voltage (M = 9.00) was rated above pressure (M = 1.00) by 8.00, 95% CI [7." in which


def test_no_difference_is_not_told_as_equality() -> None:
    found = said(made([[5, 6, 7], [7, 6, 5], [6, 6, 6], [5, 7, 6]]))
    assert "which does not show that they are equal" in found["Do the conditions differ?"]
    assert found["Which ones?"].startswith("No two conditions differed significantly")


def test_missing_scores_change_the_test() -> None:
    scores = [[float(score) for score in row] for row in CLEAR]
    scores[0][1] = np.nan
    assert "Skillings–Mack T(2) = " in said(made(scores))["Do the conditions differ?"]


def test_a_single_subject_gets_no_test() -> None:
    found = said(made([[5, 7, 9]]))
    assert "No test of all conditions could be computed: " in found["Do the conditions differ?"]
    assert "Are some people more sensitive?" not in found


def test_sensitivity_and_order_are_told_of_a_study() -> None:
    found = said(study_report())
    assert (
        "points in the group, 95% CI ["
        in found["Do ratings follow the predicted change of friction?"]
    )
    assert "skin and perception" in found["Are some people more sensitive?"]
    assert "Spearman's ρ = " in found["Does the model predict the order of the conditions?"]


def test_the_head_names_what_is_known() -> None:
    facts = masthead(plain_report()).facts
    assert facts["participants"] == "4, with 12 ratings of three conditions"
    assert facts["sessions"].startswith("a published table")
    assert "device" not in facts
    recorded = masthead(study_report())
    assert recorded.facts["sessions"][:2] == "20"
    assert "ethics" not in recorded.facts


def test_the_head_counts_what_was_rated() -> None:
    facts = masthead(made([[np.nan, 7, 9], [np.nan, 8, np.nan], [np.nan, np.nan, np.nan]])).facts
    assert facts["participants"] == "2, with three ratings of two conditions"


def test_the_head_has_the_authors_facts() -> None:
    known = Publication(authors=("A. One", "B. Two"), ethics_approvals=("Board 7",))
    study = PAPER.model_copy(update={"publication": known})
    head = masthead(replace(plain_report(), study=study))
    assert (head.authors, head.facts["ethics"]) == ("A. One, B. Two", "Board 7")


@pytest.mark.parametrize(
    ("gain", "ends", "told"),
    [
        (2.5, (1.0, 4.0), "a rise of 2.50 points in the group, 95% CI [1.00, 4.00], so ratings f"),
        (
            *(-2.5, (-4.0, -1.0)),
            "a fall of 2.50 points in the group, 95% CI [1.00, 4.00], so ratings fall where",
        ),
        (-0.5, (-2.0, 1.0), "a fall of 0.50 points in the group, 95% CI [−1.00, 2.00], which incl"),
    ],
)
def test_ratings_rise_or_fall_by_a_positive_number(
    gain: float, ends: tuple[float, float], told: str
) -> None:
    made = study_report()
    assert isinstance(made.trials.m2, OrdinalSensitivity)
    lines = replace(made.trials.m2.lines, gain=gain, gain_interval=ends)
    found = said(with_m2(made, replace(made.trials.m2, lines=lines)))
    assert told in found["Do ratings follow the predicted change of friction?"]


def test_each_sentence_begins_with_a_capital() -> None:
    scores = [[10 * column + row % 3 for column in range(5)] for row in range(12)]
    names = ("P1 voltage", "B", "C", "D", "E")
    which = said(made(np.array(scores) / 5, names=names))["Which ones?"]
    assert which.endswith(". Seven other pairs differed, too.")
    assert "rated above P1 voltage" in which
