"""The report: every form of it says the same, keeps its bytes, and trusts no text."""

import json
import re
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from analysis.loading.study_data import loaded
from analysis.report.illustrations import FIGURES
from analysis.report.report import FIGURE_FILES, report, report_files, report_html, report_json
from analysis.report.table4_text import table4_tex
from tests.analysis.reports import (
    NAMES,
    ORIGIN,
    PAPER,
    SCORES,
    made,
    plain_report,
    session_events,
    study_report,
)


class Page(HTMLParser):
    """What a reader finds on the page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.words.append(data.strip())


def test_page_csv_and_json_say_the_same() -> None:
    files = report_files(plain_report())
    numbers = json.loads(files["report.json"])
    averages = files["table4.csv"].decode().splitlines()[-1].split(",")
    words = Page(files["report.html"].decode()).words
    assert averages == ["average", "5.00", "7.50", "9.00", "7.17"]
    assert [f"{mean:.2f}" for mean in numbers["table4"]["column_means"].values()] == averages[1:4]
    assert all(average in words for average in averages)
    assert f"χ²(2) = {numbers['friedman']['chi2']:.4f}" in " ".join(words)


def test_a_missing_score_has_no_test_and_says_why() -> None:
    numbers = report_json(made([[5, 7, np.nan], *SCORES[1:]]))
    assert numbers["table4"]["rows"][0]["scores"] == [5, 7, None]
    assert numbers["friedman"]["chi2"] is None
    assert "1 of 12 are missing" in numbers["friedman"]["reason"]


def test_a_subject_who_scored_nothing_is_still_a_row() -> None:
    numbers = report_json(made([[np.nan] * 3, *SCORES[1:2]]))
    assert numbers["table4"]["rows"][0]["comprehensive"] is None


def test_one_subject_agrees_with_nobody_and_equal_scores_are_no_test() -> None:
    result = made([[7, 7, 7]])
    numbers = report_json(result)
    assert numbers["kendall_w"] is None
    assert "at least 2 subjects" in numbers["friedman"]["reason"]
    for pair in numbers["pairwise"]:
        assert (pair["p"], pair["p_holm"]) == (None, None)
        assert "no difference in any subject" in pair["reason"]
    assert "No pair of conditions can be tested." in report_html(result)


def nulls_without_reason(value: Any, path: str = "") -> list[str]:
    """The numbers that are lacking although nothing beside them says why."""
    if isinstance(value, list):
        return [lost for entry in value for lost in nulls_without_reason(entry, path)]
    if not isinstance(value, dict):
        return []
    silent = [
        f"{path}.{name}"
        for name, entry in value.items()
        if entry is None and not {"reason", f"{name}_reason"} & value.keys()
    ]
    return silent + [
        lost
        for name, entry in value.items()
        for lost in nulls_without_reason(entry, f"{path}.{name}")
    ]


@pytest.mark.parametrize(
    "scores",
    [
        [[5, 5, 5]] * 3,
        [[5, 5, 5], [6, 6, 6]],
        [[5, 7, 9]],
        [[5, 7, np.nan], *SCORES[1:]],
        [[5, 7, np.nan], [6, 9, np.nan], [4, 4, np.nan]],
    ],
)
def test_every_lacking_number_says_why(scores: list[list[float]]) -> None:
    numbers = report_json(made(scores))
    told = {name: entry for name, entry in numbers.items() if name not in {"trials", "table4"}}
    lost = [path for path in nulls_without_reason(told) if "column_means" not in path]
    # Each subject's shrinkage is lacking for the reason that stands beside the common one.
    assert [path for path in lost if "subject_shrinkage" not in path] == []


def test_equal_scores_say_why_there_is_no_correlation() -> None:
    numbers = report_json(made([[5, 5, 5]] * 3))
    assert numbers["icc"]["subjects"]["3,1"] is None
    assert "do not vary" in numbers["icc"]["subjects"]["reason"]
    law = numbers["laws"][0]
    assert (law["spearman"], law["p"], law["r_needed"]) == (None, None, None)
    assert law["reason"] == "all contrasts, or all mean ratings, are equal"
    assert "same score" in numbers["kendall_w_reason"]


def test_of_a_published_trial_no_plan_is_claimed() -> None:
    published = report_html(plain_report())
    assert "<td>standard</td>" in published
    assert "<td>as planned</td>" not in published


def test_a_session_counts_as_uninterrupted_only_where_that_is_known() -> None:
    undisturbed = "No session was interrupted, and nothing was noted."
    events = session_events(PAPER, 0, np.random.default_rng(1))
    pages = [
        report_html(report("a", loaded([found], rehearsals=False), PAPER, ORIGIN))
        for found in (events, events[:-1])
    ]
    assert undisturbed in pages[0]
    assert undisturbed not in pages[1]
    assert "unfinished sessions: P01" in pages[1]
    published = report_html(plain_report())
    assert undisturbed not in published
    assert "What interrupted the sessions behind a published table is not known." in published
    assert "unfinished sessions: not known" in published


def test_rehearsals_are_marked_on_top() -> None:
    events = session_events(PAPER, 0, np.random.default_rng(1), kind="rehearsal")
    page = report_html(report("a", loaded([events], rehearsals=True), PAPER, ORIGIN))
    assert 0 < page.index("<strong>Rehearsals.") < page.index("<table")
    assert "<strong>Rehearsals." not in report_html(plain_report())


def test_the_page_needs_no_network_and_names_its_parts() -> None:
    tags = Page(report_html(plain_report())).tags
    sources = [v for _, attrs in tags for k, v in attrs.items() if k in {"src", "href"} and v]
    assert all(source.startswith("#") for source in sources)
    assert ("html", {"lang": "en"}) in tags
    assert {attrs.get("scope") for tag, attrs in tags if tag == "th"} == {"col", "row"}


def test_text_from_a_file_stays_text() -> None:
    page = report_html(made(SCORES[:1], who="<script>alert(1)</script>"))
    assert "<script>" not in page


def test_a_cell_that_begins_like_a_formula_stays_text() -> None:
    files = report_files(made(SCORES[:1], names=("=cmd()", "@sum", "voltage")))
    header = files["table4.csv"].decode().splitlines()[0]
    assert header == "subject,'=cmd(),'@sum,voltage,comprehensive"


def test_every_figure_is_there_as_svg_and_png_with_title_and_table() -> None:
    result = study_report()
    files = report_files(result)
    figures = {f"figures/{name}.{kind}" for name in FIGURES for kind in ("svg", "png")}
    assert files.keys() - {"table4.csv", "table4.tex", "report.html", "report.json"} == figures
    assert figures == set(FIGURE_FILES)
    page = Page(files["report.html"].decode())
    tables = [attrs.get("id") for tag, attrs in page.tags if tag == "table"]
    for name, shown in result.illustrations.items():
        svg = files[f"figures/{name}.svg"].decode()
        assert f'<title id="{name}-title">' in svg
        assert f'<desc id="{name}-desc">' in svg
        assert shown.table.name in tables
    ids = [attrs["id"] for _, attrs in page.tags if "id" in attrs]
    assert len(ids) == len(set(ids)), "figures keep their ids to themselves"


def test_every_score_leads_to_its_trials_and_every_average_to_predictions() -> None:
    page = Page(report_html(study_report()))
    links = [attrs["href"] for tag, attrs in page.tags if tag == "a"]
    targets = {f"#{attrs['id']}" for _, attrs in page.tags if "id" in attrs}
    assert set(links) <= targets
    assert {f"#trials-{row}-{column}" for row in range(1, 5) for column in range(1, 6)} <= set(
        links
    )
    assert links.count("#predictions") == 5


def test_names_that_the_figures_font_lacks_are_numbered_and_dollars_are_no_formulas() -> None:
    svg = made(SCORES[:1], names=("电压", "$a^$", "pressure")).illustrations["scores"].drawing.svg
    assert "<!-- condition 1 -->" in svg
    assert "<!-- $a^$ -->" in svg


def test_missing_scores_are_read_in_three_ways() -> None:
    numbers = report_json(made([[5, 7, np.nan], [8, 6, 7], [6, 6, 10], [7, 9, 6]]))
    means = {
        name: reading["column_means"]["pressure"]
        for name, reading in numbers["missing_readings"].items()
    }
    assert means == {"missing": pytest.approx(23 / 3), "zero": 5.75, "lowest": 7.0}
    assert numbers["friedman"]["skillings_mack"]["df"] == 2
    assert numbers["missing_readings"]["zero"]["friedman"]["chi2"] is not None


def test_a_condition_nobody_scored_is_named_beside_the_test_that_leaves_it_out() -> None:
    result = made([[5, 7, np.nan, 8], [6, 9, np.nan, 7], [4, 5, np.nan, 9]], names=(*NAMES, "d"))
    assert report_json(result)["skillings_mack"]["left_out"] == ["pressure"]
    assert "equal conditions, without pressure, which nobody scored: T(2)" in report_html(result)
    holed = report_html(made([[5, 7, np.nan], *SCORES[1:]]))
    assert "test of equal conditions: T(2)" in holed


def test_catch_and_opposite_trials_give_change_detection() -> None:
    numbers = report_json(study_report())
    detection = numbers["sensitivity_models"]["M3"]["detection"]
    assert [entry["subject"] for entry in detection] == ["P01", "P02", "P03", "P04"]
    assert numbers["checks"]["catch_trials"]["overall"]["false_alarms"]["trials"] == 16
    assert numbers["checks"]["drift"]["df"] > 0


def test_a_study_in_which_nobody_scored_still_has_a_report() -> None:
    page = report_html(made([[np.nan] * 3]))
    assert "no score was given" in page


def test_what_would_show_something_else_is_not_in_the_page_nor_in_latex() -> None:
    found = made(names=("vol\x1btage", "\u202eerutcurts", "pressure"))
    page, tex = report_html(found), table4_tex(found.table.main.table4)
    for text in (page, tex):
        assert not re.search(
            "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]", text
        )
        assert "vol\ufffdtage" in text
    assert "<svg" in page
