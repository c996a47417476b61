"""The page: warnings at the top, its parts, and escaping of texts."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from analysis.loading.study_data import load_study_data
from analysis.report.blocks import Section, Table, columns
from analysis.report.page import SECTIONS, Masthead, page_html, rendered
from analysis.report.report import report, report_html
from analysis.report.table4_text import table4_tex
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


def test_rehearsals_are_marked_on_top() -> None:
    events = chain(session_events(PAPER, 0, np.random.default_rng(1), kind="rehearsal"))
    page = report_html(report("a", load_study_data([events], rehearsals=True), PAPER, ORIGIN))
    assert 0 < page.index("<strong>Rehearsals.") < page.index("<table")
    assert "<strong>Rehearsals." not in report_html(plain_report())


def test_the_page_needs_no_network_and_names_its_parts() -> None:
    tags = ReadPage(report_html(plain_report())).tags
    sources = [v for _, attrs in tags for k, v in attrs.items() if k in {"src", "href"} and v]
    assert all(source.startswith("#") for source in sources)
    assert ("html", {"lang": "en"}) in tags
    assert {attrs.get("scope") for tag, attrs in tags if tag == "th"} == {"col", "row"}


def test_no_link_leads_to_a_section_that_is_not_shown() -> None:
    found = study_report()
    whole = links(report_html(found))
    assert {target.partition("-")[0] for target in whole} >= {"trials", "cell", "predictions"}
    for name, section in zip(SECTIONS, found.sections, strict=True):
        kept = links(page_html(found, found.sections, [section]))
        assert bool(kept) is (name in {"trials", "model"})
        assert kept <= whole


def links(page: str) -> set[str]:
    """The targets of all links of a page, each of which must be there."""
    tags = [attributes for _, attributes in ReadPage(page).tags]
    targets = {href[1:] for each in tags if (href := each.get("href"))}
    assert targets <= {each.get("id") for each in tags}
    return targets


def test_details_without_any_have_no_heading() -> None:
    found = study_report()
    empty = [section for section in found.sections if section.name == "recovery"]
    assert empty
    assert '<h2 id="details"' in report_html(found)
    assert "Details" not in page_html(found, found.sections, empty)


def test_text_from_a_file_is_escaped() -> None:
    page = report_html(made(SCORES[:1], who="<script>alert(1)</script>"))
    assert "<script>" not in page


def test_control_characters_appear_neither_in_the_page_nor_in_latex() -> None:
    found = made(names=("vol\x1btage", "\u202eerutcurts", "pressure"))
    page, tex = report_html(found), table4_tex(found.table.table4)
    for text in (page, tex):
        assert not re.search(
            "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]", text
        )
        assert "vol\ufffdtage" in text
    assert "<svg" in page


def test_the_documentation_names_every_section() -> None:
    docs = (Path(__file__).parents[3] / "docs" / "report.md").read_text(encoding="utf-8")
    _, _, listed = docs.partition("choose from these sections")
    known = [section.name for section in plain_report().sections]
    assert [name for name in known if f"`{name}`" not in listed.partition("\n\n")[0]] == []


def test_the_page_has_no_marks_of_another_format_and_no_names_of_models_that_left() -> None:
    page = report_html(study_report())
    assert "`" not in page
    text = " ".join(ReadPage(page).words)
    assert not re.search(r"\bM[123]\b|\bJND\b|just noticeable difference|own share", text)


def test_a_table_of_many_rows_has_its_own_bar_to_scroll() -> None:
    rows = [(f"P{number:02d}", "7") for number in range(41)]
    many = Table(name="many", columns=columns("subject", "score"), rows=rows, caption="Many.")
    few = replace(many, name="few", rows=rows[:40])
    section = Section(title="Scores", blocks=[many, few])
    tags = ReadPage(rendered(Masthead(title="", authors="", facts={}), [], [section])).tags
    assert [attrs["class"] for _, attrs in tags if attrs.get("role") == "region"] == [
        "wide roomy long",
        "wide roomy",
    ]
