"""The report: its formats agree, and every missing number has a reason."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.report.drawing import FORMATS
from analysis.report.report import FIGURE_FILES, report_files, report_html, report_json
from tests.analysis.reports import SCORES, ReadPage, made, plain_report, study_report


def test_page_csv_and_json_agree() -> None:
    files = report_files(plain_report(), figures=False)
    assert not files.keys() & FIGURE_FILES
    numbers = json.loads(files["report.json"])
    averages = files["table4.csv"].decode().splitlines()[-1].split(",")
    words = ReadPage(files["report.html"].decode()).words
    assert averages == ["average", "5.00", "7.50", "9.00", "7.17"]
    assert [f"{mean:.2f}" for mean in numbers["table4"]["column_means"].values()] == averages[1:4]
    assert all(average in words for average in averages)
    assert f"χ²(2) = {numbers['friedman']['chi2']:.4f}" in " ".join(words)


def nulls_without_reason(value: Any, path: str = "") -> list[str]:
    """Return the paths of missing numbers that have no reason beside them."""
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
def test_every_missing_number_has_a_reason(scores: list[list[float]]) -> None:
    numbers = report_json(made(scores))
    checked = {name: entry for name, entry in numbers.items() if name not in {"trials", "table4"}}
    lost = [path for path in nulls_without_reason(checked) if ".means." not in path]
    assert lost == []


def test_a_cell_that_starts_like_a_formula_is_kept_as_text() -> None:
    files = report_files(made(SCORES[:1], names=("=cmd()", "@sum", "voltage")), figures=False)
    header = files["table4.csv"].decode().splitlines()[0]
    assert header == "subject,'=cmd(),'@sum,voltage,mean"


def test_every_figure_is_written_in_all_formats_with_title_and_table() -> None:
    result = study_report()
    files = report_files(result, figures=True)
    names = [figure.name for figure in result.figures]
    figures = {f"figures/{name}{end}" for name in names for end in FORMATS}
    drawn = {figure.name for figure in result.figures if figure.drawing is not None}
    written = files.keys() - {"table4.csv", "table4.tex", "report.html", "report.json"}
    assert written == {
        path for path in figures if Path(path).name.split(".")[0].removesuffix("-column") in drawn
    }
    of_design = ("factor-", "groups", "track-", "psychometric-")
    absent = tuple(f"figures/{name}" for name in (*of_design, "relative-gains"))
    others = {path for path in FIGURE_FILES if not path.startswith(absent)}
    assert figures == others, "it has no factors, groups or tracks, and its gains are not told"
    page = ReadPage(files["report.html"].decode())
    tables = [attrs.get("id") for tag, attrs in page.tags if tag == "table"]
    for figure in result.figures:
        name = figure.name
        if name not in drawn:
            continue
        svg = files[f"figures/{name}.svg"].decode()
        assert f'<title id="{name}-title">' in svg
        assert f'<desc id="{name}-desc">' in svg
        if name not in {"people-levels", "people"}:  # others tell these numbers
            assert figure.table is not None
            assert figure.table.name in tables
        assert "<text" in svg
        assert files[f"figures/{name}.pdf"].startswith(b"%PDF")
    ids = [attrs["id"] for _, attrs in page.tags if "id" in attrs]
    assert len(ids) == len(set(ids)), "ids are unique across figures"


def test_a_study_without_scores_has_a_report() -> None:
    page = report_html(made([[np.nan] * 3]))
    assert "no score was given" in page


def test_each_key_comes_from_one_section_and_a_number_is_followed_by_its_reason() -> None:
    result = study_report()
    keys = [key for section in result.sections for key in section.data]
    assert len(keys) == len(set(keys))
    numbers = list(report_json(made([[5, 7, 9]])))
    assert numbers.index("kendall_w_reason") == numbers.index("kendall_w") + 1
    assert numbers[0] == "title"
    assert numbers[-2:] == ["trials", "provenance"]


def test_a_figure_that_is_not_drawn_has_no_file() -> None:
    lacking = FIGURE_FILES - report_files(plain_report(), figures=True).keys()
    missing = {Path(path).name.split(".")[0].removesuffix("-column") for path in lacking}
    numbered = ("factor-", "track-", "psychometric-")
    factors = {name for name in missing if name.startswith(numbered)}
    others = {
        *("course", "forces", "groups", "levels", "noticed", "places", "reaction-times"),
        "relative-gains",
    }
    assert missing - factors == others
