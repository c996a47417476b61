"""Tables of any dialect become the same cells, or are refused in one line."""

import datetime as dt
from pathlib import Path

import pytest

from analysis.tables.reading import cells_in
from analysis.tables.table_cells import Cells, TableError, is_missing
from tests.analysis.tables.books import book, with_part

PLAIN = "subject,rough,smooth\nP1,3.5,n/a\nP2,4.25,6\n"
BY_TABS = PLAIN.replace(",", "\t")
GERMAN = PLAIN.replace(",", ";").replace(".", ",")


def read(content: str | bytes, source: str = "t.csv", **known: object) -> Cells:
    data = content.encode() if isinstance(content, str) else content
    return cells_in(data, source, most=1000, **known)  # type: ignore[arg-type]


def values(cells: Cells) -> list[list[float | None]]:
    return [[cells.number(cell) for cell in row[1:]] for row in cells.rows]


@pytest.mark.parametrize(
    ("content", "understood"),
    [
        (PLAIN.encode(), ("commas",)),
        (b"\xef\xbb\xbf" + PLAIN.encode(), ("commas",)),
        (GERMAN.encode(), ("semicolons", "decimal commas")),
        (BY_TABS.encode(), ("tabs",)),
        (BY_TABS.replace(".", ",").encode("utf-16"), ("tabs", "UTF-16", "decimal commas")),
        (GERMAN.encode("utf-16-le"), ("semicolons", "UTF-16", "decimal commas")),
        (GERMAN.encode("utf-16-be"), ("semicolons", "UTF-16", "decimal commas")),
        (PLAIN.replace(",", "|").encode(), ("bars",)),
        (PLAIN.replace(",", " ").encode(), ("spaces",)),
        (f"sep=;\n{GERMAN}".encode(), ("semicolons", "decimal commas")),
        (PLAIN.replace("3.5", '"3,5"').replace("4.25", '"4,25"').encode(),
         ("commas", "decimal commas")),
        (PLAIN.replace("\n", "\r").encode(), ("commas",)),
        (("\n" + PLAIN.replace("\n", "\n\n") + ",,\n").encode(), ("commas",)),
        (PLAIN.replace("\n", ",,\n").encode(), ("commas",)),
        (b"subject;rough;smooth\nP1;3,5;n/a\nP2;4,25;6,0\n", ("semicolons", "decimal commas")),
        (book(Ratings=[["subject", "rough", "smooth"], ["P1", 3.5, "n/a"], ["P2", 4.25, 6]]),
         ("a workbook",)),
        (book(A=[], B=[[None], ["subject", "rough", "smooth"], ["P1", "3,5", None],
                       ["P2", 4.25, 6.0]]), ("a workbook",)),
    ],
)  # fmt: skip
def test_dialects_hold_the_same_cells(content: bytes, understood: tuple[str, ...]) -> None:
    cells = read(content)
    assert list(cells.header) == ["subject", "rough", "smooth"]
    assert [row[0] for row in cells.rows] == ["P1", "P2"]
    assert values(cells) == [[3.5, None], [4.25, 6]]
    assert cells.understood == understood


@pytest.mark.parametrize("text", [PLAIN, GERMAN, BY_TABS])
def test_a_typographic_minus_is_one(text: str) -> None:
    for score in ("3", "4"):
        text = text.replace(score, f"\u2212{score}")
    cells = read(text)
    assert values(cells) == [[-3.5, None], [-4.25, 6]]
    assert cells.is_numeric(1)
    assert is_missing("\u2212")


def test_latin_1_is_read_when_asked_for() -> None:
    text = "Proband;Höhe “x”\nP1;3\n"
    cells = read(text.encode("cp1252"), encoding="latin-1")
    assert (list(cells.header), cells.understood) == (
        ["Proband", "Höhe “x”"],
        ("semicolons", "Latin-1"),
    )
    with pytest.raises(TableError, match=r"UTF-8 text at line 1; .* add --encoding latin-1"):
        read(text.encode("cp1252"))


def test_chinese_is_read_when_asked_for() -> None:
    text = "被试,材料,评分\nP1,木,3\nP1,铁,4\n"
    with pytest.raises(TableError, match=r"line 1; .* add --encoding gb18030, as it seems"):
        read(text.encode("gbk"))
    cells = read(text.encode("gbk"), encoding="gb18030")
    assert (cells.header, cells.understood) == (["被试", "材料", "评分"], ("commas", "GB 18030"))
    with pytest.raises(TableError, match="as gb18030 text at line 2; leave --encoding out, or sa"):
        read("a,b\nx,\xff\n".encode("latin-1"), encoding="gb18030")


def test_a_name_in_brackets_is_no_other_kind_of_file() -> None:
    assert read("<id>,[rough],{x}\nP1,3,4\n").header == ["<id>", "[rough]", "{x}"]
    assert read("< 5,> 5\n1,2\n").header == ["< 5", "> 5"]


def test_names_of_rows_without_a_heading_are_a_column() -> None:
    cells = read('"rough" "smooth"\n"P1" 3 4\n"P2" 5 6\n')
    assert (list(cells.header), cells.rows[0]) == (["", "rough", "smooth"], ["P1", "3", "4"])


def test_lines_above_the_header_are_titles() -> None:
    cells = read("Experiment 1\n\nsubject;a;b\nP1;3;4\n")
    assert (cells.lines, cells.understood[-1]) == ([3, 4], "1 title line above the header")
    assert cells.where(0, 1) == "t.csv, line 4, column a"


def test_a_legend_above_a_wider_header_is_a_title_and_numbers_are_no_header() -> None:
    cells = read("Experiment 2\n1 = smooth;;7 = rough;;\nID;A;B;C;D\nS1;4;7;6;6\n")
    assert (list(cells.header), cells.understood[-1]) == (
        ["ID", "A", "B", "C", "D"],
        "2 title lines above the header",
    )
    with pytest.raises(TableError, match="must have 2 cells as the header, got 5"):
        read("ID;A\nS1;4;7;6;6\n")


def test_a_header_is_no_title_where_a_comma_stands_in_numbers_alone() -> None:
    cells = read("subject;item;x\nP1;a;0,5\nP1;b;0,25\n")
    assert list(cells.header) == ["subject", "item", "x"]


def test_quotation_marks_mean_nothing_where_they_are_stray_between_tabs() -> None:
    assert read('subject\ta\nP1 "x\t3\n').rows == [['P1 "x', "3"]]


def test_values_of_a_workbook_are_texts() -> None:
    when = dt.date(2024, 5, 6)
    cells = read(book(S=[["a", "b", "c", "d"], [True, when, 0.1, 12345678901234567890]]), "b.xlsx")
    assert cells.rows == [["true", "2024-05-06T00:00:00", "0.1", "1.234567890123457e+19"]]
    assert cells.where(0, 3) == "b.xlsx, sheet S, row 2, column d"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", r"t.csv: must have a header and at least one row, got nothing"),
        (b"a,b\n1,2\n3\n", "line 3: must have 2 cells as the header, got 1"),
        (b"a,b\n1,2,3\n3,4\n", "line 2: must have 2 cells as the header, got 3"),
        (b"a;b\n1,5;2.5\n", "'1,5' in line 2 and '2.5' in line 2: is the comma or the point"),
        ("a;b\n\u22121,500;2\n".encode(), "may be -1.5 or \u22121500; add --decimal comma, or"),
        (b"a;b\n1,500;2\n", "'1,500' may be 1.5 or 1500; add --decimal comma, or"),
        (b"a,b;c\nx,y;z\n", "separated by commas or semicolons; save it with tabs"),
        (b'a,"b\n1,2\n', "line 1: a quotation mark is opened and never closed"),
        (b"PK\x03\x04 nothing", "t.csv: is a damaged archive"),
        (b"$FL2@(#) SPSS DATA FILE", "t.csv: is an SPSS file; save it as CSV or .xlsx"),
        (b'\xef\xbb\xbf <HTML><table>', "t.csv: is HTML; save it as CSV or .xlsx"),
        (b'[{"a": 1,\n"b": 2}]', "t.csv: is JSON; save it as CSV or .xlsx"),
        (b"\x1f\x8b\x08", "is a compressed file; save it as CSV or .xlsx"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "workbook of old Excel or has a password"),
        (book(A=[["a"]], B=[["b"]]), r"several sheets hold something \(A, B\); add --sheet"),
        (book(A=[]), "must have a header and at least one row, got nothing"),
        (book(A=[["a", "b"], [1, 2, 3]]), "sheet A, row 2: must have 2 cells as the header"),
        (book(A=[["a", "b"], ["P1", "=1+1"]]), "sheet A, row 2: the formulas have no stored"),
        ("a,b\n" + "1,2\n" * 1001, "must have at most 1000 rows, got more; divide"),
        ("a,b\n" + "1,2\n" * 2001, "must have at most 1000 rows, got more; divide"),
        (book(A=[["a", "b"], *[[1, 2]] * 1001]), "must have at most 1000 rows, got more"),
        (book(A=[["a", "b"], *[[1, 2]] * 2001]), "must have at most 1000 rows, got more"),
    ],
)  # fmt: skip
def test_what_is_no_table_is_refused_in_one_line(content: bytes | str, message: str) -> None:
    with pytest.raises(TableError, match=message) as refused:
        read(content)
    assert "\n" not in str(refused.value)


def test_a_sheet_is_chosen_by_name() -> None:
    two = book(A=[["a", "b"], [1, 2]], B=[["c", "d"], [3, 4]])
    assert read(two, sheet="B").header == ["c", "d"]
    with pytest.raises(TableError, match="has no sheet 'C'; it has A, B"):
        read(two, sheet="C")
    with pytest.raises(TableError, match="--sheet needs a workbook"):
        read(PLAIN, sheet="C")


BOOK = book(S=[["subject", "a"], ["P1", 3]])
SHEET = "xl/worksheets/sheet1.xml"
START = b'<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><sheetData>'
BOMB = (
    b'<!DOCTYPE x [<!ENTITY a "' + b"lol" * 1000 + b'">'
    + b"".join(b'<!ENTITY a%d "%s">' % (n, b"&a%d;" % (n - 1) * 100 if n else b"&a;" * 100)
               for n in range(6))
    + b"]>" + START
    + b"<row><c t='inlineStr'><is><t>&a5;</t></is></c></row></sheetData></worksheet>"
)  # fmt: skip


@pytest.mark.parametrize(
    ("part", "content", "message"),
    [
        (SHEET, BOMB, "cannot be read as a workbook"),
        (SHEET, b" " * (2**27 + 1), "must have at most 134217728 bytes in 2000 parts"),
        (SHEET, b"<worksheet>", "cannot be read as a workbook|got nothing"),
        (SHEET, START + b'<row r="99999999"><c r="A99999999"><v>1</v></c></row></sheetData>'
         b"</worksheet>", "must have at most 1048576 rows"),
        (SHEET, START + b"".join(b'<row r="%d"><c r="XFD%d"><v>1</v></c></row>' % (n, n)
         for n in range(1, 1300)) + b"</sheetData></worksheet>",
         "20000000 cells, got more|at most 1000 rows"),
        ("xl/workbook.xml", b"<workbook", "cannot be read as a workbook"),
    ],
)  # fmt: skip
def test_a_hostile_workbook_does_no_harm(part: str, content: bytes, message: str) -> None:
    with pytest.raises(TableError, match=message):
        read(with_part(BOOK, part, content), "b.xlsx")


def test_a_workbooks_links_and_formulas_are_not_followed(tmp_path: Path) -> None:
    linked = START + (
        b"<row r='1'><c r='A1' t='str'><v>subject</v></c><c r='B1' t='str'><v>a</v></c></row>"
        b"<row r='2'><c r='A2' t='str'><v>P1</v></c>"
        b"<c r='B2'><f>[1]Other!A1+WEBSERVICE(\"http://127.0.0.1:9/\")</f><v>7</v></c></row>"
        b"</sheetData></worksheet>"
    )
    assert read(with_part(BOOK, SHEET, linked)).rows == [["P1", "7"]]


def test_what_stands_for_no_value() -> None:
    missing = ["NA", "n/a", "NaN", "-", ".", "", "–", "#N/A", "NULL"]
    assert all(map(is_missing, missing))
    assert not any(map(is_missing, ["0", "no", "x"]))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (book(S=[["subject", "dry", None, "oiled"], [None, "smooth", "rough", "smooth", "rough"],
                 ["P0", 2, 4, 3, 5]]), "rows 1 and 2: two header rows; write one, such as dry_smo"),
        (book(S=[["Study 2"], [None, "dry", None, "oiled"],
                 ["subject", "smooth", "rough", "smooth", "rough"], ["P0", 2, 4, 3, None]]),
         "S, rows 2 and 3: two header rows; write one, such as dry_smooth, dry_ro"),
        ("x,fine,fine,rough,rough\nvolt,0,100,0,100\nid,,,,\nP1,5.0,6.0,4.0,5.0\n",
         "t.csv, lines 1 and 2: two header rows; write one, such as fine_0, fine_100"),
    ],
)  # fmt: skip
def test_two_header_rows_are_called_so(content: bytes | str, said: str) -> None:
    with pytest.raises(TableError, match=said):
        read(content)


def test_a_first_row_of_words_is_no_header() -> None:
    for text in (
        "subject,item,felt,,score\na,a,rough,rough,3\nP1,b,smooth,x,4\n",
        "subject,a,a,b\nP1,NA,NA,NA\nP2,1,2,3\n",
        "subject,a,b,c\nP1,low,low,high\nP2,1,2,3\n",
        "subject,a,b,c\nP1,2,2,3\nP2,,,\nP3,1,2,3\n",
    ):
        assert len(read(text).rows) > 1


def test_points_between_thousands_are_refused_beside_decimal_commas() -> None:
    with pytest.raises(TableError, match=r"line 3: 1.000 may be 1000 or 1; write numbers without"):
        read(b"id;a;b\nP1;350,5;200,0\nP2;987,0;1.000\n", decimal="comma")
    assert read(b"id;a;b\nP1;350.5;200.0\nP2;987.0;1.000\n").rows[1][2] == "1.000"


def test_rows_of_a_practice_loop_are_left_out() -> None:
    header = "participant,texture,slider.response,practice.thisN,trials.thisN\n"
    rows = "1,a,7,0,\n1,b,6,1,\n1,a,3,,0\n1,b,4,,1\n"
    cells = read(header + rows)
    assert [row[2] for row in cells.rows] == ["3", "4"]
    assert cells.lines == [1, 4, 5]
    assert cells.understood[-1] == "2 rows of a practice loop left out"
    alone = "participant,texture,slider.response,practice.thisN\n1,a,7,0\n1,b,6,1\n"
    assert len(read(alone).rows) == 2, "nothing else was rated"
