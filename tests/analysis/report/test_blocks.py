"""Rendering of a section: columns, cells, lists and figures."""

from dataclasses import replace
from html import escape
from types import SimpleNamespace

import pytest

from analysis.estimates import NotEstimable
from analysis.report.blocks import (
    Block,
    Cell,
    Column,
    Definitions,
    Figure,
    Items,
    Section,
    Table,
    TableGroup,
    columns,
    estimate,
)
from analysis.report.page import page_html
from tests.analysis.reports import plain_report

SPEED = Table(
    name="speed",
    caption="How fast <everybody> was.",
    columns=[Column(name="subject"), Column(name="m/s"), Column(name="in words", kind="text")],
    rows=[["P01", "0.02", "slow & steady"]],
)


def shown(*blocks: Block) -> str:
    """Return the page of a section with these blocks, from its heading on."""
    page = page_html(plain_report(), [Section(name="speed", title="Speed", blocks=blocks)])
    return page[page.index('<details id="h-speed">') :]


def test_a_columns_kind_sets_the_class_of_its_cells() -> None:
    page = shown(SPEED)
    assert '<th scope="col">m/s</th><th scope="col" class="text">in words</th>' in page
    assert '<th scope="row">P01</th><td>0.02</td><td class="text">slow &amp; steady</td>' in page
    assert f'aria-label="{escape(SPEED.caption)}"' in page


@pytest.mark.parametrize("kind", ["word", "text", "ranking", "sentence"])
def test_the_page_has_a_style_for_each_kind_of_column(kind: str) -> None:
    style, _, _ = page_html(plain_report(), []).partition("</style>")
    assert f".{kind}" in style
    assert "td:nth-child" not in style


def test_a_cell_can_link_elsewhere_and_give_the_reason_for_a_missing_value() -> None:
    empty = Cell(text="–", target="here", label="lost: why", why="lost", missing=True)
    rows = [[Cell(text="P01", anchor="here"), empty, Cell(text="b")]]
    page = shown(replace(SPEED, rows=rows))
    assert '<tr id="here"><th scope="row">P01</th>' in page
    link = '<a href="#here" aria-label="lost: why">–</a>'
    assert f'<td class="number missing" title="lost">{link}</td><td class="text">b</td>' in page
    rows[0][1] = replace(empty, target="elsewhere")
    page = shown(replace(SPEED, rows=rows))
    assert '<td class="number missing" title="lost">–</td><td class="text">b</td>' in page


def test_a_footer_is_separate_and_headers_can_stay_on_one_line() -> None:
    rows = [*SPEED.rows, ["all", "0.02", ""]]
    page = shown(replace(SPEED, rows=rows, footer=True, unbroken=True))
    assert '<tfoot><tr><th scope="row">all</th>' in page
    assert '<table id="speed" class="unbroken">' in page


def test_a_list_without_lines_has_no_heading() -> None:
    assert "What was slow." not in shown(Items(heading="What was slow.", lines=[]))
    page = shown(Items(heading="What was slow.", lines=["P01"], name="slow"))
    assert '<p><strong>What was slow.</strong></p>\n<ul id="slow">\n<li>P01</li>\n</ul>' in page


def test_a_figure_that_is_not_drawn_is_replaced_by_a_paragraph_above_its_table() -> None:
    page = shown(Figure(name="speed", instead="Nobody moved.", table=SPEED), "", None)
    assert 0 < page.index("<p>Nobody moved.</p>") < page.index('<table id="speed">')
    assert "<figure" not in page
    assert "<table" not in shown("At rest.", Figure(name="speed"))


def test_texts_definitions_and_groups_of_tables_appear_in_order() -> None:
    group = TableGroup(name="both", tables=[replace(SPEED, name=""), SPEED])
    page = shown("At rest.", Definitions(entries={"v": "speed"}), group)
    places = [
        page.index(part)
        for part in ("<p>At rest.</p>", "<dt>v</dt><dd>speed</dd>", '<div id="both">', "<table>")
    ]
    assert places == sorted(places)
    assert page.count("<caption>") == 2


def test_columns_share_a_kind() -> None:
    assert columns("a", "b", kind="word")[1] == Column(name="b", kind="word")


def test_columns_show_what_stands_at_a_path_of_each_record() -> None:
    line = SimpleNamespace(gain=1.234, gain_interval=(0.5, 2.0))
    records = [
        SimpleNamespace(name="P01", line=line, test=NotEstimable("too few")),
        SimpleNamespace(name="P02", line=None, test=SimpleNamespace(p=0.01, n=4)),
        SimpleNamespace(line=line, test=None),
    ]
    shown = [
        Column("subject", "name", absent="group"),
        *estimate("gain", "line.gain"),
        Column("n", "test.n"),
        Column("p", "test", lambda test: "?" if isinstance(test, NotEstimable) else "!"),
    ]
    assert [column.name for column in shown] == ["subject", "gain", "95%", "n", "p"]
    assert Table.over(records, shown, name="", caption="").rows == [
        ["P01", "1.23", "[0.50,\N{NO-BREAK SPACE}2.00]", "–", "?"],
        ["P02", "–", "–", "4", "!"],
        ["group", "1.23", "[0.50,\N{NO-BREAK SPACE}2.00]", "–", "!"],
    ]
    with pytest.raises(AttributeError, match="no attribute 'name'"):
        Column("subject", "name").cell(records[2])
