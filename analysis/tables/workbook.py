"""The cells of a workbook (.xlsx) from a stranger: values alone, within bounds.

Nothing is computed, linked or run: openpyxl reads the values that a spreadsheet program stored.
Python's `zipfile` unpacks no more of a part than the archive says, and that is asked first.
"""

import warnings
from collections.abc import Iterator, Sequence
from datetime import date, datetime, time
from io import BytesIO
from typing import Any
from zipfile import BadZipFile, ZipFile

from analysis.tables.table_cells import SAMPLE, Rows, TableError
from protocol.errors import listed
from protocol.study.fields import printable

MOST_UNPACKED = 2**27
"""Bytes of a whole workbook."""
MOST_PARTS = 2_000
MOST_CELLS = 20_000_000
"""With the blank ones before a cell: a far cell in each row would take as many."""
MOST_ROWS = 1_048_576
"""Of a sheet, as Excel has them."""


def sheet_in(content: bytes, source: str, sheet: str | None, *, most: int) -> tuple[str, Rows]:
    """Return the name of a sheet and its rows that are not blank: the only one, or `sheet`.

    Raises:
        TableError: it is no workbook or a too large one, there is no sheet of that name, several
            hold something and none is named, or no formula has a stored result.
    """
    _require_small(content, source)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # on what openpyxl does not keep, such as drop-downs
            return _sheet(content, source, sheet, most)
    except TableError:
        raise
    except Exception as error:  # what a forged part can raise has no common name
        raise TableError(
            f"{source}: cannot be read as a workbook ({type(error).__name__}); save it again as "
            ".xlsx, or as CSV"
        ) from error


def _require_small(content: bytes, source: str) -> None:
    try:
        with ZipFile(BytesIO(content)) as archive:
            parts = archive.infolist()
    except (BadZipFile, ValueError, NotImplementedError, OSError) as error:
        raise TableError(f"{source}: is a damaged archive ({error})") from error
    if "xl/workbook.xml" not in {part.filename for part in parts}:
        raise TableError(
            f"{source}: is an archive and no workbook (.xlsx); save the table as .xlsx or CSV"
        )
    size = sum(part.file_size for part in parts)
    if size > MOST_UNPACKED or len(parts) > MOST_PARTS:
        raise TableError(
            f"{source}: must have at most {MOST_UNPACKED} bytes in {MOST_PARTS} parts when "
            f"unpacked, got {size} in {len(parts)}; save the sheet alone, or as CSV"
        )


def _sheet(content: bytes, source: str, sheet: str | None, most: int) -> tuple[str, Rows]:
    from openpyxl import load_workbook

    values, formulas = (
        load_workbook(BytesIO(content), read_only=True, data_only=stored, keep_links=False)
        for stored in (True, False)
    )
    names = [name for name in values.sheetnames if name not in _no_tables(values)]
    if sheet is not None:
        if sheet not in names:
            known = listed(map(printable, names))
            raise TableError(f"{source}: has no sheet {sheet!r}; it has {known}")
        names = [sheet]
    read = {name: list(_rows(values[name], source, name, most)) for name in names}
    filled = [name for name, rows in read.items() if rows]
    if len(filled) > 1:
        raise TableError(
            f"{source}: several sheets hold something ({listed(map(printable, filled))}); add "
            "--sheet with the name of one"
        )
    if not filled:
        raise TableError(f"{source}: must have a header and at least one row, got nothing")
    _require_stored(formulas[filled[0]], dict(read[filled[0]]), source, filled[0])
    return printable(filled[0]), read[filled[0]]


def _no_tables(book: Any) -> set[str]:
    """Return the names of sheets that hold a chart alone."""
    return {name for name in book.sheetnames if not hasattr(book[name], "iter_rows")}


def _rows(sheet: Any, source: str, name: str, most: int) -> Iterator[tuple[int, list[str]]]:
    """Yield the rows that are not blank, without the blank cells at their ends."""
    filled = 0
    for line, row in _bounded(sheet, f"{source}, sheet {printable(name)}"):
        cells = [_text(cell) for cell in row]
        while cells and not cells[-1]:
            cells.pop()
        if cells:
            filled += 1
            if filled > most + SAMPLE:  # titles may stand above
                raise TableError(f"{source}: must have at most {most} rows, got more; divide it")
            yield line, cells


def _bounded(sheet: Any, where: str) -> Iterator[tuple[int, Sequence[Any]]]:
    sheet.reset_dimensions()  # a stranger's file may say any
    seen = 0
    for line, row in enumerate(sheet.iter_rows(values_only=True), start=1):
        seen += len(row)
        if line > MOST_ROWS or seen > MOST_CELLS:
            raise TableError(
                f"{where}: must have at most {MOST_ROWS} rows and {MOST_CELLS} cells, got more"
            )
        yield line, row


def _require_stored(sheet: Any, values: dict[int, list[str]], source: str, name: str) -> None:
    """Refuse formulas of which no program has stored any result: they would read as missing."""
    first = None
    for line, row in _bounded(sheet, f"{source}, sheet {printable(name)}"):
        stored = values.get(line, [])
        for at, cell in enumerate(row):
            if isinstance(cell, str) and cell.startswith("="):
                if at < len(stored) and stored[at]:
                    return
                first = first or line
    if first is not None:
        raise TableError(
            f"{source}, sheet {printable(name)}, row {first}: the formulas have no stored "
            "results; open the file in a spreadsheet program and save it"
        )


def _text(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return str(int(value)) if value.is_integer() and abs(value) < 2**53 else repr(value)
    if isinstance(value, datetime | date | time):
        return value.isoformat()
    return str(value).strip()
