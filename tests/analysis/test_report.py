"""The report: every form of it says the same, keeps its bytes, and trusts no text."""

import json
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from analysis.report import Report, report, report_html, report_json, write_report
from analysis.scores import ScoreTable
from analysis.session_scores import Loaded


def made(scores: object, kinds: tuple[str, ...] = ("participant",), who: str = "P0") -> Report:
    array = np.array(scores, dtype=float)
    rows, columns = array.shape
    table = ScoreTable(
        subjects=tuple(f"{who}{row}" for row in range(rows)),
        conditions=tuple(f"c{column}" for column in range(columns)),
        scores=array,
    )
    return report("a study", Loaded(table=table, kinds=kinds, rehearsals_left_out=0, unfinished=()))


SCORES = [[5, 7, 9], [4, 8, 9], [6, 6, 10], [5, 9, 8]]


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


def test_page_csv_and_json_say_the_same(tmp_path: Path) -> None:
    result = made(SCORES)
    write_report(result, tmp_path)
    numbers = json.loads((tmp_path / "report.json").read_text())
    averages = (tmp_path / "table4.csv").read_text().splitlines()[-1].split(",")
    words = Page((tmp_path / "report.html").read_text()).words
    assert averages == ["average", "5.00", "7.50", "9.00", "7.17"]
    assert [f"{mean:.2f}" for mean in numbers["table4"]["column_means"].values()] == averages[1:4]
    assert all(average in words for average in averages)
    assert f"χ²(2) = {numbers['friedman']['chi2']:.4f}" in " ".join(words)


def test_the_same_input_gives_the_same_bytes() -> None:
    assert report_html(made(SCORES)) == report_html(made(SCORES))


def test_a_missing_score_has_no_test_and_says_why() -> None:
    numbers = report_json(made([[5, 7, np.nan], *SCORES[1:]]))
    assert numbers["table4"]["rows"][0]["scores"] == [5, 7, None]
    assert numbers["friedman"]["chi2"] is None
    assert "1 of 12 are missing" in numbers["friedman"]["reason"]


def test_a_subject_who_scored_nothing_is_still_a_row() -> None:
    numbers = report_json(made([[np.nan] * 3, *SCORES[1:]]))
    assert numbers["table4"]["rows"][0]["comprehensive"] is None


def test_rehearsals_are_marked_on_top() -> None:
    page = report_html(made(SCORES, kinds=("participant", "rehearsal")))
    assert 0 < page.index("<strong>Rehearsals.") < page.index("<table>")
    assert "<strong>Rehearsals." not in report_html(made(SCORES))


def test_the_page_needs_no_network_and_names_its_parts() -> None:
    tags = Page(report_html(made(SCORES))).tags
    sources = [v for _, attrs in tags for k, v in attrs.items() if k in {"src", "href"} and v]
    assert all(source.startswith("#") for source in sources)
    assert ("html", {"lang": "en"}) in tags
    assert {attrs.get("scope") for tag, attrs in tags if tag == "th"} == {"col", "row"}


def test_text_from_a_file_stays_text() -> None:
    page = report_html(made(SCORES, who="<script>alert(1)</script>"))
    assert "<script>" not in page


def test_nothing_is_written_where_nothing_can_be(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="Not a directory"):
        write_report(made(SCORES), tmp_path / "file" / "report")
    assert (tmp_path / "file").read_text() == ""
