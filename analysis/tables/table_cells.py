"""The cells of a table and what they say: names, numbers, nothing."""

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from analysis.cells import unguarded
from protocol.errors import BadInput, listed
from protocol.study.fields import LONGEST_NAME, require_printable

Decimal = Literal["point", "comma"]

MINUS = "\N{MINUS SIGN}"
SIGN = f"[+{MINUS}-]?"
# `float` alone would also take "nan", "inf" and "1_0".
NUMBER = re.compile(rf"{SIGN}(\d+(\.\d*)?|\.\d+)([eE]{SIGN}\d+)?")
COMMA_NUMBER = re.compile(rf"{SIGN}\d*,\d+([eE]{SIGN}\d+)?")
FORMULA = re.compile(r"=[^)]*[(\d].*")
MISSING = frozenset(
    {
        "",
        "na",
        "n/a",
        "#n/a",
        "<na>",
        "nan",
        "-",
        "--",
        "–",
        "—",
        MINUS,
        ".",
        "null",
        "none",
        "missing",
    }
)
"""What stands for no value, in lower case."""

MOST_NAMED = 12
"""Columns that a message names, before it counts the others."""
SAMPLE = 200
"""Rows by which a separator, and the header below titles, are found."""
Rows = list[tuple[int, list[str]]]
"""Each row that is not blank with its place in the file."""


class TableError(BadInput):
    """A table that cannot be used; the message says where."""


@dataclass(frozen=True, kw_only=True)
class Cells:
    """The header and the rows of a table, as texts without spaces around them.

    - `header`: a name for each column, which may be blank; `rows` are as long, none is blank.
    - `lines`: where the header stands, and then each row.
    - `decimal`: the mark in numbers; `understood`: what the file is, in words.
    """

    source: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    lines: Sequence[int]
    decimal: Decimal = "point"
    understood: tuple[str, ...] = ()
    line_word: str = "line"

    def where(self, row: int | None = None, column: int | None = None) -> str:
        """Return how a message names a row, the header if None, and perhaps a column of it."""
        line = self.lines[0 if row is None else row + 1]
        place = f"{self.source}, {self.line_word} {line}"
        return place if column is None else f"{place}, column {self.named(column)}"

    def named(self, column: int) -> str:
        """Return the name of a column as people know it."""
        return self.header[column] or f"{column + 1} (without a name)"

    def names(self, columns: Sequence[int] | None = None) -> str:
        """Return the names of columns, of all if None, in words: 12, and how many more."""
        at = range(len(self.header)) if columns is None else columns
        more = f" and {len(at) - MOST_NAMED} more" * (len(at) > MOST_NAMED)
        return f"{listed(map(self.named, at[:MOST_NAMED]))}{more}"

    def is_numeric(self, column: int) -> bool:
        """Return whether most of what stands in a column are numbers."""
        given = [row[column] for row in self.rows if not is_missing(row[column])]
        numbers = sum(self.number(cell) is not None for cell in given)
        return bool(given) and 2 * numbers >= len(given)

    def without(self, words: str | None) -> "Cells":
        """Return the cells with blanks for further words, by commas, that stand for no value."""
        missing = {word.strip().casefold() for word in (words or "").split(",")}
        rows = ([cell * (cell.casefold() not in missing) for cell in row] for row in self.rows)
        return replace(self, rows=list(rows)) if words else self

    def require_no_formula(self, row: int, column: int) -> None:
        """Refuse a formula where a number should stand."""
        if FORMULA.fullmatch(text := self.rows[row][column]):
            raise TableError(
                f"{self.where(row, column)}: is a formula, {text[:40]!r}; save the table with the "
                "values of its formulas"
            )

    def number(self, text: str) -> float | None:
        """Return the number in a cell; None if it is none."""
        if self.decimal == "comma" and "," in text:
            text = text.replace(",", ".") if COMMA_NUMBER.fullmatch(text) else ""
        return float(text.replace(MINUS, "-")) if NUMBER.fullmatch(text) else None


def is_missing(text: str) -> bool:
    """Return whether a cell says that there is no value.

    >>> [is_missing(text) for text in ("n/a", "-", "", "0")]
    [True, True, True, False]
    """
    return text.casefold() in MISSING


def is_excluded(text: str) -> bool:
    """Return whether a cell of the column excluded says so: yes, or why.

    >>> [is_excluded(text) for text in ("session", "TRUE", "no", "False", "0", "")]
    [True, True, False, False, False, False]
    """
    return not is_missing(text) and text.casefold() not in {"no", "false", "0", "0.0"}


def cell_name(cell: str, where: str) -> str:
    """Return the name in a cell, which may be blank; refuse one that is too long or hides marks."""
    name = unguarded(cell.strip())
    if len(name) > LONGEST_NAME:
        raise TableError(
            f"{where}: a name must have at most {LONGEST_NAME} characters, "
            f"got {len(name)}, {name[:20]!r}..."
        )
    try:
        return require_printable(name)
    except ValueError as error:
        raise TableError(f"{where}: a name {error}, got {name!r}; remove them") from None


def title_rows(rows: Rows) -> int:
    """Return how many rows stand above the header: of one cell, or legends before a wider one."""
    filled = [sum(map(bool, row)) for _, row in rows[:SAMPLE]]
    most = max(filled, default=0)
    if most < 2:
        return 0
    first, widest = (
        next(at for at, many in enumerate(filled) if many >= least) for least in (2, most)
    )
    # A row with numbers is no header: then the first one has too few names, which is refused.
    has_numbers = any(NUMBER.fullmatch(cell) for cell in rows[widest][1])
    is_legend = first < widest and 2 * max(filled[first:widest]) <= most and not has_numbers
    return widest if is_legend else first


def folded(name: str) -> str:
    """Return what people and spreadsheets take a name for: without case, width and double spaces.

    >>> folded("Ｐ01  A") == folded("p01 a")
    True
    """
    return " ".join(unicodedata.normalize("NFKC", name).casefold().split())
