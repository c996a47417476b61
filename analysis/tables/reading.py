"""The cells of any table, from the bytes of a file: separated text, or a workbook (.xlsx)."""

import json
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from analysis.tables import separated
from analysis.tables.separated import Encoding
from analysis.tables.table_cells import (
    COMMA_NUMBER,
    NUMBER,
    SAMPLE,
    Cells,
    Decimal,
    Rows,
    TableError,
    is_missing,
    title_rows,
)
from protocol.errors import listed

_IMPORT_ID = re.compile(r"""\{\s*["']ImportId["']\s*:\s*["']([^"']*)["'].*\}""")
"""A cell of the third header row of an export of Qualtrics."""
_OF_QUALTRICS = frozenset(
    {
        "startDate", "endDate", "status", "ipAddress", "progress", "duration", "finished",
        "recordedDate", "recipientLastName", "recipientFirstName", "recipientEmail",
        "externalDataReference", "locationLatitude", "locationLongitude", "distributionChannel",
        "userLanguage",
    }
)  # fmt: skip
"""Columns that every export of Qualtrics has, by their ImportId."""
_OTHERS = {
    rb"\$FL\d": "an SPSS file",
    rb"\x1f\x8b": "a compressed file",
    rb"(?i)<(!doctype|!--|html|head|meta|body|table)\b": "HTML",
    rb"<\?xml": "XML",
}
"""How files start that are no tables."""
_ZIP, _OLD_EXCEL = b"PK\x03\x04", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"


def cells_in(
    content: bytes,
    source: str,
    *,
    most: int,
    of: str = "rows",
    encoding: Encoding | None = None,
    decimal: Decimal | None = None,
    sheet: str | None = None,
) -> Cells:
    """Return the cells of the file `source`.

    Lines of one cell above the header are titles, and left out, as are blank lines and columns. A
    file of text is UTF-8, or UTF-16 where its first bytes say so, unless `encoding` is given. Its
    separator is the one that gives rows of one length, and most numbers where several do.

    Args:
        content: of the file.
        source: what to call it in messages.
        most: how many rows there may be below the header.
        of: what those rows are, for the message on too many.
        encoding: of a file of text, if it is not one of these.
        decimal: the mark in its numbers, if they do not tell.
        sheet: of a workbook; by default the only one that holds anything.

    Raises:
        TableError: it is no table; the message says where and why.
    """
    if content.startswith(_ZIP):
        from analysis.tables.workbook import sheet_in

        name, rows = sheet_in(content, source, sheet, most=most)
        told, marks = ["a workbook"], separated.mark_of_texts(rows)
        whole = f"{source}, sheet {name}"
        return _cells(rows, whole, told, decimal=decimal or marks, most=(most, of), word="row")
    if content.startswith(_OLD_EXCEL):
        raise TableError(
            f"{source}: is a workbook of old Excel or has a password; save it as .xlsx without one"
        )
    if other := _other_kind(content):
        raise TableError(f"{source}: is {other}; save it as CSV or .xlsx")
    if sheet is not None:
        raise TableError(f"{source}: --sheet needs a workbook (.xlsx), got a file of text")
    text, named = separated.text_in(content, source, encoding)
    rows, separator = separated.rows_in(text, source, most=most + SAMPLE, of=of)
    told = [separated.SEPARATORS[separator], *[named] * (named != "UTF-8")]
    mark = decimal or separated.decimal_mark(rows, text, separator, source)
    if mark == "comma":
        _require_no_thousands(rows, source)
    told += ["decimal commas"] * (mark == "comma")
    return _cells(rows, source, told, decimal=mark, most=(most, of))


def _other_kind(content: bytes) -> str:
    """Return what a file is that is no table; nothing if it may be one."""
    start = content[:99].removeprefix(b"\xef\xbb\xbf").lstrip()
    if kind := next((kind for mark, kind in _OTHERS.items() if re.match(mark, start)), ""):
        return kind
    if start.startswith((b"{", b"[")):
        try:
            json.loads(content)
        except (ValueError, RecursionError):
            return ""
        return "JSON"
    return ""


def _cells(
    rows: Rows,
    source: str,
    understood: Sequence[str],
    *,
    decimal: Decimal,
    most: tuple[int, str],
    word: str = "line",
) -> Cells:
    titles = title_rows(rows)
    _require_one_header(rows, titles, source, word)
    body = rows[titles:]
    if not body:
        raise TableError(f"{source}: must have a header and at least one row, got nothing")
    (start, header), *below = body
    if len(below) > most[0]:
        raise TableError(
            f"{source}: must have at most {most[0]} {most[1]}, got more; divide the table"
        )
    of_qualtrics = _of_qualtrics(below)
    below = below[2:] if of_qualtrics is not None else below
    count = len(below)
    below = _without_practice(header, below)
    width = _width(header)
    longer = word == "line" and all(len(row) == len(header) + 1 for _, row in below)
    if longer and any(row[-1] for _, row in below):
        header, width = ["", *header], width + 1  # R writes names of rows without a heading
    wide = max([width, *(_width(row) for _, row in below)])
    for line, row in below if wide > len(header) or word == "line" else ():
        if len(row) < len(header) or _width(row) > len(header):
            raise TableError(
                f"{source}, {word} {line}: must have {len(header)} cells as the header, "
                f"got {len(row)}"
            )
    padded = [row + [""] * (wide - len(row)) for row in (header, *(row for _, row in below))]
    own = of_qualtrics or ()
    used = [at for at in range(wide) if at not in own and any(row[at] for row in padded)]
    is_whole = used == list(range(len(padded[0])))
    kept = padded if is_whole else [[row[at] for at in used] for row in padded]
    said = [f"{titles} title line{'s' * (titles > 1)} above the header"] * bool(titles)
    if of_qualtrics is not None:
        said += ["two further header rows and the own columns of Qualtrics left out"]
    if practised := count - len(below):
        said += [f"{practised} row{'s' * (practised > 1)} of a practice loop left out"]
    return Cells(
        source=source,
        header=kept[0],
        rows=kept[1:],
        lines=[start, *(line for line, _ in below)],
        decimal=decimal,
        understood=(*understood, *said),
        line_word=word,
    )


def _require_one_header(rows: Rows, titles: int, source: str, word: str) -> None:
    for at in range(max(titles - 1, 0), titles + 1):
        if names := _names_in_two(rows[at : at + 3]):
            raise TableError(
                f"{source}, {word}s {rows[at][0]} and {rows[at + 1][0]}: two header rows; write "
                f"one, such as {listed(names[:2])}"
            )


def _names_in_two(rows: Rows) -> list[str]:
    """Return the names of columns that two rows give together; none if the first gives them alone.

    A name of the upper row stands above several of the lower one: once, before blanks, as in merged
    cells, or again and again, as pandas writes it, with a third row of names of rows alone.
    """
    if len(rows) < 3:
        return []
    (_, upper), (_, lower), (_, third) = rows
    spanning = [*upper, *[""] * (len(lower) - len(upper))]
    for at, name in enumerate(spanning[1:], start=1):
        spanning[at] = name or spanning[at - 1]
    both = zip(spanning, lower, strict=False)
    pairs = [(name, part) for name, part in both if name and not is_missing(part)]
    of_rows = pairs[1:] if third[0] and not any(third[1:]) else []
    repeated = len({name for name, _ in pairs}) < len(pairs) > len({name for _, name in pairs})
    numbers = [bool(NUMBER.fullmatch(name)) for _, name in pairs]
    below = sum(bool(NUMBER.fullmatch(cell) or COMMA_NUMBER.fullmatch(cell)) for cell in third)
    if not repeated or len(set(pairs)) < len(pairs):
        return []
    if of_rows or (not any(numbers) and 2 * below >= len(pairs)):
        return [f"{name}_{part}" for name, part in of_rows or pairs]
    return []


_LOOP = re.compile(r"(.+)\.thisN")
_PRACTICE = re.compile(r"(prac|training|warm_?up|familiari|übung).*", re.IGNORECASE)


def _without_practice(header: Sequence[str], below: Rows) -> Rows:
    """Return the rows of PsychoPy but for those of a loop of practice beside another loop."""
    loops = {at: loop[1] for at, name in enumerate(header) if (loop := _LOOP.fullmatch(name))}
    practice = [at for at, loop in loops.items() if _PRACTICE.fullmatch(loop)]
    if len(practice) in {0, len(loops)}:
        return below
    return [
        (line, row) for line, row in below if not any("".join(row[at : at + 1]) for at in practice)
    ]


def _require_no_thousands(rows: Rows, source: str) -> None:
    """Refuse points in numbers whose decimal mark is the comma: `1.000` is 1000 to many."""
    for line, row in rows:
        for cell in row:
            if _THOUSANDS.fullmatch(cell):
                raise TableError(
                    f"{source}, line {line}: {cell} may be {cell.replace('.', '')} or "
                    f"{float(cell.split(',')[0].replace('.', '', cell.count('.') - 1)):g}; write "
                    "numbers without points where the comma is the decimal mark"
                )


_THOUSANDS = re.compile(r"-?[1-9]\d{0,2}(\.\d{3})+(,\d+)?")


def _of_qualtrics(below: Rows) -> set[int] | None:
    """Return the columns that are Qualtrics's own; None if the table is no export of it.

    Below the names of columns it has a row of the questions, and one of `{"ImportId":"QID1"}`.
    """
    ids = [_IMPORT_ID.fullmatch(cell) for cell in below[1][1] if cell] if len(below) > 1 else []
    if not (ids and all(ids)):
        return None
    own = enumerate(map(_IMPORT_ID.fullmatch, below[1][1]))
    return {at for at, known in own if known and known[1] in _OF_QUALTRICS}


def _width(row: Sequence[str]) -> int:
    """Return how many cells there are up to the last that is not blank."""
    return max((at + 1 for at, cell in enumerate(row) if cell), default=0)


def frame_cells(frame: Any, source: str) -> Cells:
    """Return the cells of a data frame, whose first row is called line 2.

    Raises:
        TableError: it is no data frame, or has no columns.
    """
    if not (hasattr(frame, "columns") and hasattr(frame, "iloc")):
        raise TableError(
            f"{source}: must be a data frame of pandas, got {type(frame).__name__}; "
            "pandas.DataFrame(...) makes one"
        )
    header = [str(name).strip() for name in frame.columns]
    if not header:
        raise TableError(f"{source}: must have columns, got none")
    texts = (map(_frame_text, frame.iloc[:, at]) for at in range(len(header)))
    rows = [list(row) for row in zip(*texts, strict=True)]
    return Cells(source=source, header=header, rows=rows, lines=range(1, len(rows) + 2))


def _frame_text(value: object) -> str:
    plain = value.item() if isinstance(value, np.generic) else value
    return "" if plain is None or str(plain) in {"<NA>", "nan", "NaT"} else str(plain).strip()
