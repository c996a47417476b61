"""The section on other choices of analysis: sentences, tables, figures, and when it is made."""

from dataclasses import replace
from functools import cache

import pytest

from analysis.loading.sessions import load_sessions
from analysis.loading.study_data import study_data
from analysis.multiverse.curve import Multiverse
from analysis.report.report import (
    FIGURE_FILES,
    Report,
    report,
    report_files,
    report_html,
    report_json,
)
from analysis.report.sections.multiverse import in_words
from protocol.journal.events import TrialExcluded
from tests.analysis.chains import chain, published_chain, scored_session
from tests.analysis.reports import ORIGIN, PAPER, ReadPage, plain_report

NAMES = ("voltage", "pressure", "structure")


@cache
def explored() -> Report:
    """A withheld score, and a session with a trial that was excluded."""
    rows = {"P01": (9, 5, 7), "P02": (None, 5, 6), "P03": (4, 6, 8), "P04": (8, 6, 7)}
    sessions = {
        who: scored_session(who, zip(NAMES, row, strict=True), NAMES) for who, row in rows.items()
    }
    sessions["P03"].append(TrialExcluded(index=0, reason="a noise"))
    recorded = load_sessions(map(chain, sessions.values()))
    found = study_data(recorded, rehearsals=False)
    return report("a study", found, PAPER, ORIGIN, ("multiverse",), recorded)


def made() -> Multiverse:
    found = explored().multiverse
    assert found is not None
    return found


def test_nothing_of_it_is_made_unless_it_is_asked_for() -> None:
    assert plain_report().multiverse is None
    assert "multiverse" not in report_json(plain_report())
    assert "h-multiverse" not in report_html(plain_report())
    stale = {"figures/multiverse-voltage-best.svg", "figures/multiverse-order-follows-model.pdf"}
    assert stale <= FIGURE_FILES - report_files(plain_report(), figures=True).keys()


def test_a_sentence_counts_the_analyses_and_names_the_choice_that_matters() -> None:
    said = {curve.claim.id: in_words(curve) for curve in made().curves}
    # Voltage - structure, as decided: 2, 1; of P02 -6 if read as 0, -1 as the lowest score, 5;
    # with P03, -4, and -2 of P02, as the lowest score is then 4.
    # Means 1.5, -1, 2/3; with P03 -1/3, -7/4, -3/4.
    assert said["voltage-best"] == (
        "Voltage is rated above every other condition in 2 of 6 analyses (p < .05 in 0); the "
        "reading of missing scores moves the effect most, on average from −1.38 (as 0) to 0.58 "
        "(left missing)."
    )
    assert said["conditions-differ"].startswith(
        "The conditions differ in 1 of 6 analyses (p < .05)"
    )


def test_analyses_that_cannot_judge_a_claim_are_counted() -> None:
    curve = made().curves[0]
    some = replace(curve, unjudged={"nobody scored": 4})
    assert in_words(some) == f"{in_words(curve)} Four others cannot judge it."


def test_a_single_analysis_is_told_in_words_of_its_own() -> None:
    recorded = load_sessions(
        [published_chain(who, {"voltage": 9, "pressure": 5}) for who in ("P01", "P02")]
    )
    found = study_data(recorded, rehearsals=False)
    alone = report("a study", found, PAPER, ORIGIN, ("multiverse",), recorded)
    assert alone.multiverse is not None
    said = [in_words(curve) for curve in alone.multiverse.curves]
    assert (
        "Voltage is rated above every other condition: supported by the only analysis (p ≥ .05)."
        in said
    )
    page = report_html(alone)
    assert "no score was withheld, so that the three readings are one." in page
    assert "Specification curve" not in page
    assert "multiverse-pairs" not in page, "the tests of pairs say it already"


def test_each_claim_has_a_figure_with_its_numbers_beside_it() -> None:
    files = report_files(explored(), figures=True)
    svg = files["figures/multiverse-voltage-best.svg"].decode()
    for text in ("left missing", "nothing excluded", "least mean", "supported, p ≥ .05"):
        assert f">{text}" in svg, "text is text"
    page = ReadPage(report_html(explored()))
    tables = {attrs.get("id") for tag, attrs in page.tags if tag == "table"}
    assert {"multiverse-pairs", "multiverse-voltage-best"} <= tables


def test_report_json_has_every_analysis() -> None:
    numbers = report_json(explored())["multiverse"]
    claims = {entry["id"]: entry for entry in numbers["claims"]}
    best = claims["voltage-best"]
    assert len(best["by_effect"]) == best["analyses"] == 6
    own = best["by_effect"][best["own"]]
    assert own["chosen"] == {
        "exclusions": "as decided",
        "reading of missing scores": "left missing",
    }
    assert own["effect"] == pytest.approx(1.5)
    assert best["by_option"]["exclusions"]["as decided"]["analyses"] == 3
    assert len(numbers["pairs"]) == 3
    assert set(numbers["single"]) == {"contrast"}
