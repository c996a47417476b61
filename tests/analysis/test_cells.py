"""Cells as text: whatever somebody typed comes back, and nothing runs in a spreadsheet."""

import csv
import io
import re

from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.cells import csv_cell, csv_text, tsv_cell, tsv_text, unguarded
from analysis.export.dataset import label, labels
from tests.analysis.hostile_study import NOTES

TYPED = st.text() | st.sampled_from(NOTES)
PRINTABLE = st.characters(exclude_categories=["Cc", "Cs"], exclude_characters="\u2028\u2029\ufeff")
PLAIN = st.text(PRINTABLE)
FORMULA = re.compile(r"[\s\"]*[=+\-@＝＋－＠]")
FORMULA_WITHIN = re.compile(rf"(^|[;,\t\n]){FORMULA.pattern}")


@settings(deadline=None)
@given(st.lists(st.lists(PLAIN, min_size=2, max_size=2)))
def test_csv_keeps_every_text_but_blanks_and_formulas(rows: list[list[str]]) -> None:
    written = csv_text(["a", "b"], rows)
    read = list(csv.reader(io.StringIO(written, newline="")))[1:]
    assert read == [[csv_cell(text) if text.strip() else "" for text in row] for row in rows]


@given(PLAIN.filter(lambda text: "'" not in text))
def test_a_guard_is_taken_off_again_and_is_nowhere_else(text: str) -> None:
    assert unguarded(csv_cell(text)) == text
    assert FORMULA.search(text) or csv_cell(text) == text


@given(st.lists(TYPED | st.sampled_from(["a;", "b\t", "c\n", ", ", '"', "=1+1"])).map("".join))
def test_no_cell_starts_a_formula_wherever_a_spreadsheet_splits_the_file(text: str) -> None:
    for part in re.split("[;\t\n]", csv_cell(text)):
        assert not FORMULA.match(part)
    for part in re.split("[;,\t\n]", tsv_cell(text)):
        assert not FORMULA.match(part)


def test_a_heading_is_guarded_once() -> None:
    for heading in ("=1+1", "'=1+1"):
        assert csv_text([heading], []) == "'=1+1\n"


def test_a_formula_after_a_semicolon_is_guarded() -> None:
    assert csv_cell("a;=1+1") == "a;'=1+1"
    assert csv_text(["a"], [[("a;=1+1", "-1")]]) == "a\na\\;'=1+1;'-1\n"
    assert csv_cell("warm, -5 °C; dry") == "warm, -5 °C; dry"
    assert tsv_cell('"=1+1", =2') == "'\"=1+1\",' =2"


@settings(deadline=None)
@given(st.lists(st.tuples(TYPED, TYPED)))
def test_a_tsv_record_is_one_line_of_as_many_cells(rows: list[tuple[str, str]]) -> None:
    written = tsv_text(["a", "b"], [list(row) for row in rows])
    lines = written.splitlines()
    assert len(lines) == len(rows) + 1
    assert all(line.count("\t") == 1 and "" not in line.split("\t") for line in lines)
    written.encode()


@settings(deadline=None)
@given(
    PLAIN.filter(lambda text: text.strip() not in {"", "n/a"} and not FORMULA_WITHIN.search(text))
)
def test_a_tsv_text_can_be_read_back(text: str) -> None:
    tabs = f"{text}\t\\t\n\\n"
    meant = {"\\\\": "\\", "\\t": "\t", "\\n": "\n"}
    assert re.sub(r"\\[\\tn]", lambda match: meant[match[0]], tsv_cell(tabs)) == tabs


def test_numbers_truth_and_nothing() -> None:
    cells = [-0.5, 7, True, None, "", (1.0, None), (None, None), ("1;5 mm", "=2"), ()]
    names = [f"c{place}" for place in range(len(cells))]
    assert csv_text(names, [cells]).splitlines()[1] == r"-0.5,7,true,,,1.0;n/a,,1\;5 mm;'=2,"
    assert tsv_text(names, [cells]).splitlines()[1].split("\t") == [
        "-0.5",
        "7",
        "true",
        "n/a",
        "n/a",
        "1.0;n/a",
        "n/a",
        r"1\;5 mm;'=2",
        "n/a",
    ]


def test_a_text_is_never_taken_for_a_missing_value() -> None:
    assert tsv_cell("n/a") == "'n/a"


@settings(deadline=None)
@given(st.lists(st.text(max_size=4) | st.sampled_from(["P-1", "P1", "p1", "P1x2", "P_1", "王"])))
def test_labels_are_alphanumeric_and_never_alike(names: list[str]) -> None:
    found = labels(names)
    assert found.keys() == set(names)
    assert all(re.fullmatch("[0-9A-Za-z]+", text) for text in found.values())
    assert len({text.casefold() for text in found.values()}) == len(found)


@settings(deadline=None)
@given(st.lists(st.sampled_from(["P01", "P02", "abc"]), unique=True))
def test_a_name_that_is_a_label_keeps_it(names: list[str]) -> None:
    assert labels(["P-01", *names]) | {name: name for name in names} == labels(["P-01", *names])
    assert label("P-01") == "P01"
