"""Published tables of scores: a wide CSV file, a row per subject, a column per condition."""

import csv
import io
import re
from collections.abc import Sequence

import numpy as np

from analysis.cells import csv_fault, unguarded
from analysis.estimates import FloatArray, ScoreTable
from device.friction.changes import CONDITIONS
from protocol.errors import BadInput, listed
from protocol.pseudonyms import pseudonym
from protocol.study.fields import LONGEST_NAME, require_printable
from protocol.study.rules import PAPERS_SCALE

# The paper's Table 4 has an average below and a comprehensive score at the right.
_NAMES_OF_MEANS = frozenset({"average", "comprehensive", "mean", "total"})
LEAST_OTHERS = 3
LEAST_ROWS = 3
MOST_SUBJECTS = 100_000
MOST_CONDITIONS = 100
MOST_BYTES = 2**25
"""Of a file: three for each of the most scores."""
# Each may be off by half of the last digit; the rest allows for binary fractions.
_PRINTED = 0.0101
"""How far two means to two decimals may lie apart that were the same before rounding."""


def mean_column(scores: FloatArray) -> int | None:
    """Return the column that is the mean of all others in every row, None if none is.

    It takes at least three others and three rows in which they differ: in fewer, and where all are
    equal, scores meet their mean by chance. A value that only a mean can have - a fraction, where
    all others are whole - is proof in a single row. `scores` has shape (rows, columns), NaN where
    none was given.
    """
    if scores.shape[1] <= LEAST_OTHERS:
        return None
    given = ~np.isnan(scores)
    values = np.where(given, scores, 0.0)
    # Arrays of one entry per cell, about the others in its row: their number, mean and range.
    others = given.sum(axis=1, keepdims=True) - given
    there = others > 0
    means = (values.sum(axis=1, keepdims=True) - values) / np.maximum(others, 1)
    met = np.where(there, given & (np.abs(values - means) <= _PRINTED), ~given)
    telling = there & (_highest_of_others(scores) > -_highest_of_others(-scores))
    fractions = (values % 1 > 0).sum(axis=0)
    proof = (fractions > 0) & (fractions == fractions.sum())
    is_mean = met.all(axis=0) & there.any(axis=0) & (proof | (telling.sum(axis=0) >= LEAST_ROWS))
    return int(np.argmax(is_mean)) if is_mean.any() else None


def _highest_of_others(scores: FloatArray) -> FloatArray:
    """Return for each cell the highest of the other scores in its row, -inf if there is none."""
    known = np.where(np.isnan(scores), -np.inf, scores)
    # It is the row's highest score, except for the highest itself, whose others begin at the
    # second.
    second, first = np.partition(known, -2, axis=1)[:, -2:].T[:, :, None]
    return np.where(known == first, second, first)


_KNOWN = {name.casefold(): name for name in CONDITIONS}


def condition_name(text: str) -> str:
    """Return the model's name of a condition for one that differs from it in case only.

    >>> condition_name("Frequency"), condition_name("Colour")
    ('frequency', 'Colour')
    """
    return _KNOWN.get(text.casefold(), text)


def unpredicted_note(conditions: Sequence[str]) -> str | None:
    """Return in one line which conditions have no predicted contrast; None if all have one."""
    others = [name for name in conditions if name not in CONDITIONS]
    if not others:
        return None
    return (
        f"No contrast is predicted for {listed(others)}: "
        f"the friction model knows {', '.join(CONDITIONS)}."
    )


SCALE = (float(PAPERS_SCALE.minimum), float(PAPERS_SCALE.maximum))
# `float` alone would also take "nan", "inf" and "1_0".
NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")


class TableError(BadInput):
    """A file of scores that cannot be used; the message says where."""


def published_table(
    text: str, source: str = "scores.csv", *, keep_means: bool = False
) -> ScoreTable:
    """Return the scores in `text`: first column `subject`, then one column per condition.

    A blank cell is a missing score. Scores lie on `SCALE`. An apostrophe before `=`, `+`, `-` or
    `@` is the guard of an exported name and no part of it. A condition that the friction model
    knows is called as the model calls it, whatever the case. A subject is a pseudonym.

    `source` is what messages call the file, which is comma-separated, with or without a byte order
    mark; `keep_means` is whether a column or row that is the mean of all others holds scores.

    Raises:
        TableError: no header, too many rows or columns, a row of another length, a repeated name,
            a cell that is neither blank nor a score, or a column or row of means; the message gives
            line, column, value and rule.
    """
    # Spreadsheets put a byte order mark before UTF-8.
    (start, first), *rows = csv_rows(text.removeprefix("\ufeff"), source)
    at_header = f"{source}, line {start}"
    # First, so that the message names the cause instead of one of its consequences.
    require_commas(first, at_header)
    if len(first) > MOST_CONDITIONS + 1:
        raise TableError(
            f"{at_header}: must have at most {MOST_CONDITIONS} conditions, got {len(first) - 1}; "
            "import them in parts"
        )
    if not rows or len(first) < 2:
        raise TableError(f"{source}: must have a header and at least one row and one condition")
    header = _header(first, at_header)
    subjects, scores = [], []
    for line, row in rows:
        where = f"{source}, line {line}"
        if len(row) != len(header):
            raise TableError(
                f"{where}: must have {len(header)} cells as the header, got {len(row)}"
            )
        subjects.append(_subject(row[0], where))
        cells = zip(row[1:], header[1:], strict=True)
        scores.append([_score(cell.strip(), f"{where}, column {name}") for cell, name in cells])
    try:
        table = ScoreTable(
            subjects=tuple(subjects), conditions=tuple(header[1:]), scores=np.array(scores)
        )
    except ValueError as error:
        raise TableError(f"{source}: {error}") from error
    if not keep_means:
        _require_no_means(table, source, [start, *(line for line, _ in rows)])
    return table


def _header(cells: list[str], at_header: str) -> list[str]:
    header = [condition_name(cell_name(cell, at_header)) for cell in cells]
    if header[0].casefold() not in {"subject", "subjects", "participant"}:
        raise TableError(f"{at_header}: the first column must be 'subject', got {header[0]!r}")
    if not all(header):
        raise TableError(f"{at_header}: every condition must have a name, got {header[1:]!r}")
    for name in [name for name in header if name.casefold() in _NAMES_OF_MEANS]:
        raise TableError(f"{at_header}, column {name}: holds no scores; remove the column")
    return header


def csv_rows(
    text: str, source: str, *, most: int = MOST_SUBJECTS, of: str = "subjects", do: str = "import"
) -> list[tuple[int, list[str]]]:
    """Return the rows that are not blank, at least one, each with its line in the file.

    Raises:
        TableError: there is none, there are more than a header and `most`, or it is no CSV.
    """
    # Strict, because a stray quotation mark would otherwise silently join cells.
    reader = csv.reader(io.StringIO(text, newline=None), strict=True)
    rows, line = [], 1
    try:
        for row in reader:
            if any(row):
                rows.append((reader.line_num, row))
                # A header and a row per subject, before more of them fill the memory.
                if len(rows) > most + 1:
                    raise TableError(
                        f"{source}: must have at most {most} {of}, got more; {do} them in parts"
                    )
            line = reader.line_num + 1
    except csv.Error as error:
        raise TableError(f"{source}, line {line}: {csv_fault(error)}") from error
    if not rows:
        raise TableError(f"{source}: must have a header and at least one row, got nothing")
    return rows


def require_commas(header: Sequence[str], where: str) -> None:
    """Refuse a table whose cells something else separates."""
    for mark, name in ((";", "semicolons"), ("\t", "tabs")):
        if len(header) == 1 and mark in header[0]:
            raise TableError(
                f"{where}: the cells are separated by {name}; save the table with commas between "
                "them, and points in numbers"
            )


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


def _subject(cell: str, where: str) -> str:
    if not (name := cell_name(cell, where)):
        raise TableError(f"{where}: a subject must have a name, got {cell!r}")
    if name.casefold() in _NAMES_OF_MEANS:
        raise TableError(f"{where}: the row {name!r} holds no scores of a subject; remove the row")
    try:
        return pseudonym(name)  # it becomes the name of a session, which no withdrawal erases
    except BadInput as error:
        raise TableError(f"{where}: {error}; number the subjects") from None


def _require_no_means(table: ScoreTable, source: str, lines: Sequence[int]) -> None:
    """Refuse means under another name."""
    kept = "add --keep-means if it holds scores"
    if (column := mean_column(table.scores)) is not None:
        raise TableError(
            f"{source}, line {lines[0]}, column {table.conditions[column]}: is the mean of all "
            f"other columns; remove the column, or {kept}"
        )
    if (row := mean_column(table.scores.T)) is not None:
        raise TableError(
            f"{source}, line {lines[row + 1]}: the row {table.subjects[row]!r} is the mean of all "
            f"others; remove the row, or {kept}"
        )


def _score(cell: str, where: str) -> float:
    if not cell:
        return float("nan")
    if not NUMBER.fullmatch(cell):
        raise TableError(f"{where}: a score must be a number or blank, got {cell[:40]!r}")
    value = float(cell)
    if not SCALE[0] <= value <= SCALE[1]:
        raise TableError(
            f"{where}: a score must lie in [{SCALE[0]:g}, {SCALE[1]:g}], got {cell[:40]}"
        )
    return value
