"""The results in words: what is said of clear, of unclear and of missing results."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from analysis.estimates import FloatArray
from analysis.report.findings import Findings
from analysis.report.page import masthead
from analysis.report.report import report_json
from analysis.report.results import DIFFER, FOLLOW, paragraphs
from analysis.report.wording import p_equals
from analysis.statistics.slope import Slope
from device.friction.changes import LAW
from protocol.registration.registration import FOLLOWS, OMNIBUS
from protocol.study.rules import Publication
from tests.analysis.reports import PAPER, made, plain_report, study_report

CLEAR = [[1, 5, 9], [2, 6, 10], [0, 4, 8], [1, 5, 10], [2, 4, 9], [1, 6, 8], [0, 5, 9]]


def said(found: Findings) -> dict[str, str]:
    """Return the answers by question, with plain spaces."""
    return {asked: told.replace("\N{NO-BREAK SPACE}", " ") for asked, told in paragraphs(found)}


def test_clear_differences_are_told_with_their_size_and_interval() -> None:
    found = said(made(CLEAR))
    assert found["Do the conditions differ?"].startswith(
        "Seven participants rated three conditions from 0 to 10. "
        "Scores differed between conditions, Friedman's χ²(2) = 14.00, p < .001 (p < .001 "
        "corrected), "
    )
    which = found["Which ones?"]
    assert "pressure (M = 9.00) was above voltage (M = 1.00) by 8.00, 95% CI [" in which
    assert "p = .047, r = 1.00" in which


def test_the_larger_mean_comes_first_whatever_the_order_of_the_columns() -> None:
    which = said(made([row[::-1] for row in CLEAR]))["Which ones?"]
    assert "voltage (M = 9.00) was above pressure (M = 1.00) by 8.00, 95% CI [7." in which


def test_no_difference_is_not_told_as_equality() -> None:
    found = said(made([[5, 6, 7], [7, 6, 5], [6, 6, 6], [5, 7, 6]]))
    assert "which does not show that they are equal" in found["Do the conditions differ?"]
    assert found["Which ones?"] == (
        "No pair is told, because the conditions were not found to differ."
    )


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
    assert found[DIFFER].startswith(
        "Four participants gave 80 answers on five conditions, 65 of them as expected. Each answer "
        "counts as a response from 0 to 11: 0 if the change was not answered as expected, else its "
        "score, counted from 1. No difference between conditions was found, which does not show "
    )
    assert found[FOLLOW].startswith(
        f"Per unit of predicted contrast (change of log friction; law {LAW}), mean responses "
        "change by "
    )
    told = found["Are some people more sensitive?"]
    assert told.startswith("How sensitive each person is cannot be told from these data: ")
    assert " Levels are from " in told
    assert " In order alone: Spearman's ρ = " in found[FOLLOW]


def test_the_head_names_what_is_known() -> None:
    facts = masthead(plain_report()).facts
    assert facts["participants"] == "4, with 12 ratings of three conditions"
    assert facts["sessions"].startswith("imported from a table")
    assert "device" not in facts
    recorded = masthead(study_report())
    assert recorded.facts["sessions"].startswith("4, 20")
    assert recorded.facts["participants"] == "4, with 80 answers and 65 ratings of five conditions"
    assert "ethics" not in recorded.facts


def test_the_head_counts_what_was_rated() -> None:
    facts = masthead(made([[np.nan, 7, 9], [np.nan, 8, np.nan], [np.nan, np.nan, np.nan]])).facts
    assert facts["participants"] == "2, with three ratings of two conditions"


def test_the_head_has_the_authors_facts() -> None:
    known = Publication(authors=("A. One", "B. Two"), ethics_approvals=("Board 7",))
    study = PAPER.model_copy(update={"publication": known})
    head = masthead(replace(plain_report(), study=study))
    assert (head.authors, head.facts["ethics"]) == ("A. One, B. Two", "Board 7")


CONTRASTS = "against contrasts in any other order"
"""Where the verdict on the slope begins."""


@pytest.mark.parametrize(
    ("value", "ends", "p", "told", "verdict"),
    [
        (2.5, (1.0, 4.0), 0.008, "2.50 points, 95% CI [1.00, 4.00], p = .008", "they follow it"),
        (
            *(-2.5, (-4.0, -1.0), 0.008, "−2.50 points, 95% CI [−4.00, −1.00], p = .008"),
            "they fall where a larger change is predicted",
        ),
        (
            *(-0.5, (-2.0, 1.0), 0.4, "−0.50 points, 95% CI [−2.00, 1.00], p = .400"),
            "these data do not show that they follow it",
        ),
    ],
)
def test_responses_follow_by_a_number_with_its_sign(
    value: float, ends: tuple[float, float], p: float, told: str, verdict: str
) -> None:
    made = study_report()
    slope = made.trials.slope
    assert isinstance(slope, Slope)
    trials = replace(made.trials)
    vars(trials)["slope"] = replace(slope, value=value, interval=ends, p=p)
    found = replace(made, trials=trials)
    vars(found)["questions"] = replace(made.questions, p_holm={OMNIBUS: 0.001, FOLLOWS: p})
    answer = said(found)[FOLLOW]
    corrected = p_equals(p).replace("\N{NO-BREAK SPACE}", " ")
    number, _, others = told.partition(" points")
    tenth = f"{value / 10:.2f}".replace("-", "−")
    each = f" points ({tenth} per .10, which is a change of about 10%)"
    assert f"mean responses change by {number}{each}{others} ({corrected} corrected) " in answer
    at_best = "" if p < 0.05 else " (five conditions have at best p = .008, before any correction)"
    after = answer.partition(CONTRASTS)[2].replace("\N{NO-BREAK SPACE}", " ")
    assert after.startswith(f"{at_best}: {verdict}. In order alone: Spearman's")


def test_the_slope_of_a_published_table_is_that_of_the_brute_force() -> None:
    """Every order of the contrasts, and least squares with a level of each person."""
    made_of = [[2, 5, 9], [1, 6, 7], [3, 4, 8], [5, 5, 6]]
    found = made(made_of)
    predicted = {row["condition"]: row["predicted"][LAW] for row in found.trial_records}
    contrasts = np.array([predicted[name] for name in found.loaded.table.conditions])
    levels = np.kron(np.eye(4), np.ones((3, 1)))

    def fitted(order: FloatArray) -> tuple[float, float]:
        design = np.column_stack([np.tile(order, 4), levels])
        (slope, *_), *_ = np.linalg.lstsq(design, np.ravel(made_of).astype(float), rcond=None)
        return float(slope), abs(float(slope)) * float(np.std(order))

    slopes = [fitted(np.array(order)) for order in permutations(contrasts)]
    p = np.mean([size >= slopes[0][1] * (1 - 1e-9) for _, size in slopes])
    slope = report_json(found)["responses"]["slope"]
    assert slope["value"] == pytest.approx(slopes[0][0])
    assert slope["p"] == pytest.approx(p)
    assert (
        "(three conditions with such contrasts cannot show it, at best p = .167): "
        in said(found)[FOLLOW]
    )
    assert slope["ci"] is None
    assert "these contrasts have too few orders" in slope["ci_reason"]


def test_each_sentence_begins_with_a_capital() -> None:
    scores = [[10 * column + row % 3 for column in range(5)] for row in range(12)]
    names = ("P1 voltage", "B", "C", "D", "E")
    which = said(made(np.array(scores) / 5, names=names))["Which ones?"]
    assert which.endswith(". Seven other pairs differed, too.")
    assert "was above P1 voltage" in which
