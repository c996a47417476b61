"""The rows of a text whose cells are separated by commas, semicolons, tabs, bars or spaces."""

import csv
import io
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import islice
from typing import Literal

from analysis.cells import csv_fault
from analysis.tables.table_cells import (
    COMMA_NUMBER,
    MINUS,
    NUMBER,
    SAMPLE,
    SIGN,
    Decimal,
    Rows,
    TableError,
    is_missing,
    title_rows,
)

Encoding = Literal["utf-8", "utf-16", "latin-1", "gb18030"]

_POINT_NUMBER = re.compile(rf"{SIGN}\d*\.\d+([eE]{SIGN}\d+)?")
_THOUSANDS = re.compile(rf"{SIGN}[1-9]\d{{0,2}},\d{{3}}")

SEPARATORS: Mapping[str, str] = {
    ",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars", " ": "spaces",
}  # fmt: skip


def text_in(content: bytes, source: str, encoding: Encoding | None) -> tuple[str, str]:
    """Return the text of a file, and the name of its encoding."""
    if encoding == "latin-1":
        try:  # what Windows calls Latin-1, with its quotation marks and dashes
            return content.decode("cp1252"), "Latin-1"
        except UnicodeDecodeError:
            return content.decode("latin-1"), "Latin-1"
    if encoding == "gb18030":
        return _decoded(content, source, encoding), "GB 18030"
    wide = encoding == "utf-16" or (encoding is None and _is_utf_16(content))
    try:
        if not wide:
            return content.decode("utf-8-sig"), "UTF-8"
        if content.startswith((b"\xff\xfe", b"\xfe\xff")):
            return content.decode("utf-16"), "UTF-16"
        # Without a mark the letters of a separated text tell: half of each is 0.
        last = content[1:400:2].count(0) >= content[0:400:2].count(0)
        return content.decode("utf-16-le" if last else "utf-16-be"), "UTF-16"
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        name = "UTF-16" if wide else "UTF-8"
        other = (
            "gb18030, as it seems to be Chinese (GBK)"
            if _is_chinese(content)
            else "latin-1 if it was saved for Western Europe (ANSI)"
        )
        raise TableError(
            f"{source}: cannot be read as {name} text at line {line}; save the file as UTF-8, or "
            f"add --encoding {other}"
        ) from None


def _decoded(content: bytes, source: str, encoding: str) -> str:
    try:
        return content.decode(encoding)
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise TableError(
            f"{source}: cannot be read as {encoding} text at line {line}; leave --encoding out, or "
            "save the file as UTF-8"
        ) from None


def _is_chinese(content: bytes) -> bool:
    """Return whether bytes that are no UTF-8 are Chinese: letters of Europe give rare signs."""
    try:
        letters = [sign for sign in content.decode("gb18030") if not sign.isascii()]
    except UnicodeDecodeError:
        return False
    usual = sum(bool(sign.encode("gb2312", "ignore")) for sign in letters)
    return 2 * usual > len(letters)


def _is_utf_16(content: bytes) -> bool:
    start = content[:400]
    zeros = start[0::2].count(0), start[1::2].count(0)
    return start.startswith((b"\xff\xfe", b"\xfe\xff")) or max(zeros) > len(start) / 5


def rows_in(text: str, source: str, *, most: int, of: str) -> tuple[Rows, str]:
    """Return the rows of a text that are not blank, and what separates their cells."""
    told = re.match(r"sep=(.)\r?\n", text)  # Excel's own line, which tells it the separator
    if told and told[1] in SEPARATORS:
        text = text[told.end() :]
        return _all_rows(text, told[1], source, most=most, of=of, first=2), told[1]
    separator = _separator(text, source)
    return _all_rows(text, separator, source, most=most, of=of), separator


def _all_rows(
    text: str, separator: str, source: str, *, most: int, of: str, first: int = 1
) -> Rows:
    rows: Rows = []
    line = first
    try:
        for line, row in _parsed(text, separator, first):
            if any(row):
                rows.append((line, row))
                # Before more of them fill the memory.
                if len(rows) > most + 1:
                    raise TableError(
                        f"{source}: must have at most {most - SAMPLE} {of}, got more; divide the "
                        "table"
                    )
            line += 1  # noqa: PLW2901 - where a row that cannot be read begins
    except csv.Error as error:
        raise TableError(f"{source}, line {line}: {csv_fault(error)}") from error
    return rows


def _parsed(text: str, separator: str, first: int = 1) -> Iterator[tuple[int, list[str]]]:
    """Yield each row with the last of its lines.

    Strict, because a stray quotation mark would otherwise silently join cells; in a table with tabs
    they mean nothing where they are stray.
    """
    plain = separator == "\t" and not _is_quoted(text, separator)
    reader = csv.reader(
        io.StringIO(text, newline=None),
        delimiter=separator,
        strict=True,
        skipinitialspace=separator == " ",
        quoting=csv.QUOTE_NONE if plain else csv.QUOTE_MINIMAL,
    )
    for row in reader:
        yield reader.line_num + first - 1, [cell.strip() for cell in row]


def _is_quoted(text: str, separator: str) -> bool:
    """Return whether quotation marks hold cells together, as far as they can be read so."""
    if '"' not in text:
        return False
    try:
        for _ in csv.reader(io.StringIO(text, newline=None), delimiter=separator, strict=True):
            pass
    except csv.Error:
        return False
    return True


def _separator(text: str, source: str) -> str:
    """Return what separates the cells: it gives rows of one length, and most numbers."""
    samples = {mark: _sample(text, mark) for mark in SEPARATORS if mark in text}
    fitting = {mark: rows for mark, rows in samples.items() if _is_even(rows)}
    if len(fitting) > 1:  # a text may hold spaces, and bars, without being separated by them
        usual = {mark: rows for mark, rows in fitting.items() if mark not in " |"}
        fitting = usual or fitting
    if fitting:
        # A header would be a title if a comma stood in its numbers alone.
        titles = {mark: title_rows(rows) for mark, rows in fitting.items()}
        fitting = {
            mark: rows for mark, rows in fitting.items() if titles[mark] == min(titles.values())
        }
        ranks = {mark: _numbers(rows) for mark, rows in fitting.items()}
        best = [mark for mark, rank in ranks.items() if rank == max(ranks.values())]
        if len(best) > 1:
            names = " or ".join(SEPARATORS[mark] for mark in best)
            raise TableError(
                f"{source}: its cells may be separated by {names}; save it with tabs between them"
            )
        return best[0]
    # None fits: by the one that divides the header most, a message can say which row differs.
    usual = {mark: rows for mark, rows in samples.items() if mark not in " |"}
    return max(usual, key=lambda mark: _widest(usual[mark]), default=",")


def _sample(text: str, separator: str) -> Rows:
    rows: Rows = []
    try:
        filled = ((line, row) for line, row in _parsed(text, separator) if any(row))
        rows.extend(islice(filled, SAMPLE))
    except csv.Error:  # said when the whole is read
        pass
    return rows


def _is_even(rows: Rows) -> bool:
    rows = rows[title_rows(rows) :]
    if not rows:
        return False
    header, widths = len(rows[0][1]), {len(row) for _, row in rows[1:]}
    return header > 1 and (widths <= {header} or widths == {header + 1})


def _numbers(rows: Rows) -> tuple[float, int]:
    """Return the share of cells that are numbers or nothing, and how many columns there are."""
    cells = [cell for _, row in rows[1:] for cell in row]
    plain = sum(
        is_missing(cell) or bool(NUMBER.fullmatch(cell) or COMMA_NUMBER.fullmatch(cell))
        for cell in cells
    )
    return plain / max(len(cells), 1), len(rows[0][1])


def _widest(rows: Rows) -> int:
    return max((len(row) for _, row in rows[:20]), default=0)


def decimal_mark(rows: Rows, text: str, separator: str, source: str) -> Decimal:
    """Return the decimal mark of a file's numbers, as far as they tell."""
    if separator == "," and '"' not in text:
        return "point"
    by_comma = list(_matching(rows, COMMA_NUMBER))
    if not by_comma:
        return "point"
    (line, cell), points = by_comma[0], next(_matching(rows, _POINT_NUMBER), None)
    if points is not None:
        raise TableError(
            f"{source}: has {cell!r} in line {line} and {points[1]!r} in line {points[0]}: is the "
            "comma or the point the decimal mark? Add --decimal comma or --decimal point"
        )
    if all(_THOUSANDS.fullmatch(text) for _, text in by_comma):
        number = float(cell.replace(",", ".").replace(MINUS, "-"))
        raise TableError(
            f"{source}, line {line}: {cell!r} may be {number:g} or "
            f"{cell.replace(',', '')}; add --decimal comma, or --decimal point and leave the comma "
            "out"
        )
    return "comma"


def mark_of_texts(rows: Rows) -> Decimal:
    """Return the decimal mark of numbers that a workbook has as texts: its own have points."""
    return "comma" if next(_matching(rows, COMMA_NUMBER), None) else "point"


def _matching(rows: Rows, pattern: re.Pattern[str]) -> Iterator[tuple[int, str]]:
    fits: Callable[[str], object] = pattern.fullmatch
    return ((line, cell) for line, row in rows[1:] for cell in row if fits(cell))


def require_commas(header: Sequence[str], where: str) -> None:
    """Refuse a table whose cells something else separates."""
    for mark, name in ((";", "semicolons"), ("\t", "tabs")):
        if len(header) == 1 and mark in header[0]:
            raise TableError(
                f"{where}: the cells are separated by {name}; save the table with commas between "
                "them, and points in numbers"
            )
