"""Table 4 on the page and as data: missing scores, and the link of each cell."""

import re
from dataclasses import replace

import numpy as np
import pytest

from analysis.loading.study_data import load_study_data
from analysis.report.report import report, report_files, report_html, report_json
from analysis.report.sections.session_checks import left_out_lines
from protocol.journal.events import Answered
from protocol.study.study import Study
from tests.analysis.chains import chain
from tests.analysis.reports import (
    ORIGIN,
    PAPER,
    SCORES,
    ReadPage,
    made,
    plain_report,
    session_events,
    study_report,
)


def test_a_subject_whose_answers_were_not_scored_has_a_row() -> None:
    sessions = [session_events(PAPER, slot, np.random.default_rng(slot)) for slot in range(3)]
    sessions[0] = [
        replace(it, agrees=False, score=None) if isinstance(it, Answered) else it
        for it in sessions[0]
    ]
    found = load_study_data(map(chain, sessions), rehearsals=False)
    numbers = report_json(report("a", found, PAPER, ORIGIN))
    assert numbers["table4"]["rows"][0]["comprehensive"] is None
    assert numbers["table4"]["unscored_subjects"] == ["P01"]


def test_a_subject_of_an_imported_table_without_scores_is_left_out_and_named() -> None:
    """Earlier versions stored such a subject, whose row would rule Friedman's test out."""
    found, known = made([*SCORES, [np.nan] * 3]), made()
    numbers, of_known = map(report_json, (found, known))
    assert "chi2" in of_known["friedman"]
    assert [numbers[name] for name in ("table4", "friedman", "kendall_w")] == [
        of_known[name] for name in ("table4", "friedman", "kendall_w")
    ]
    (out,) = numbers["exclusions"]
    assert (out["by"], out["why"]) == ("import", "no score in the table")
    assert left_out_lines(found.loaded) == [
        f"Left out: {out['participant']} (import): no score in the table"
    ]
    assert left_out_lines(known.loaded) == []


def test_directions_and_mean_responses_stand_below_the_table_and_are_those_of_the_trials() -> None:
    found = study_report()
    numbers = report_json(found)
    counted = [row for row in numbers["trials"] if row["kind"] == "trial"]
    means = numbers["responses"]["means"]
    page = " ".join(ReadPage(report_html(found)).words)
    assert [row["condition"] for row in numbers["directions"]] == list(means)
    for row in numbers["directions"]:
        name = row["condition"]
        own = [trial for trial in counted if trial["condition"] == name]
        same = [trial for trial in own if trial["change"] in {"same", "not swapped"}]
        expected = [trial for trial in own if trial["agrees"]]
        contrary = len(own) - len(expected) - sum(not trial["agrees"] for trial in same)
        ways = [len(expected), contrary, len(own) - len(expected) - contrary]
        assert list(row.values()) == [name, *ways]
        by_person: dict[str, list[float]] = {}
        for trial in own:
            response = trial["score"] + 1 if trial["agrees"] else 0
            assert trial["response"] == response
            by_person.setdefault(trial["subject"], []).append(response)
        mean = np.mean([np.mean(responses) for responses in by_person.values()])
        assert means[name] == pytest.approx(mean)
        assert f"{name}  {' '.join(map(str, ways))} {mean:.2f}" in re.sub(r" +", " ", page).replace(
            f"{name} {ways[0]}", f"{name}  {ways[0]}"
        )


def test_scores_without_answers_have_no_directions() -> None:
    numbers = report_json(plain_report())
    assert numbers["directions"] == []
    assert numbers["scores"] is None
    assert numbers["responses"]["of"] == "score"
    assert numbers["responses"]["means"] == numbers["table4"]["column_means"]
    assert all(trial["response"] == trial["score"] for trial in numbers["trials"])
    assert "These scores come without answers" in report_html(plain_report())


def test_names_with_commas_are_told_apart() -> None:
    names = ("5 N, slow", "5 N, fast", "voltage")
    page = report_html(made([[np.nan, np.nan, 5], [np.nan, np.nan, 6]], names=names))
    assert "Conditions without any score: 5 N, slow; 5 N, fast." in page


def test_every_score_links_to_its_trials_and_every_average_to_predictions() -> None:
    page = ReadPage(report_html(study_report()))
    links = [attrs["href"] for tag, attrs in page.tags if tag == "a"]
    targets = {f"#{attrs['id']}" for _, attrs in page.tags if "id" in attrs}
    assert set(links) <= targets
    assert {f"#trials-{row}-{column}" for row in range(1, 5) for column in range(1, 6)} <= set(
        links
    )
    assert links.count("#predictions") == 5


def test_the_papers_table_alone_bears_the_papers_name() -> None:
    papers = study_report()
    assert papers.is_papers
    page = report_html(papers)
    assert "<caption><strong>Table 4.</strong> Scores by subject" in page
    assert 'scope="col">comprehensive</th>' in page
    assert "comprehensive" in report_files(papers, figures=False)["table4.csv"].decode()
    # Three of its conditions are another table, whatever the study file has.
    to_100 = report("a study", papers.loaded, _to_100(papers.study), ORIGIN)
    for other in (plain_report(), to_100):
        files = report_files(other, figures=False)
        del files["report.json"]  # its keys are others' to read
        shown = b" ".join(files.values()).decode()
        assert "<caption>Scores by subject and condition, 0 to 10" in shown
        assert not re.search("Table 4|comprehensive|paper's ranking", shown)


def _to_100(study: Study) -> Study:
    rating = study.rating.model_copy(update={"maximum": 100, "bands": ()})
    return study.model_copy(update={"rating": rating})
