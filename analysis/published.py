"""Published tables of scores: a wide CSV file, a row per subject, a column per condition."""

import csv
import io
import re
from collections.abc import Sequence

import numpy as np

from analysis.scores import ScoreTable
from protocol.errors import BadInput

SCALE = (0.0, 10.0)
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")


class TableError(BadInput):
    """A file of scores that cannot be used; the message says where."""


def published_table(text: str, source: str = "scores.csv") -> ScoreTable:
    """Return the scores in `text`: first column `subject`, then one column per condition.

    A blank cell is a missing score. Scores lie in [0, 10].

    Args:
        text: the file's text, with or without a byte order mark, comma-separated.
        source: what to call it in messages.

    Raises:
        TableError: no header, a row of another length, a repeated name, or a cell that is neither
            blank nor a score; the message gives line, column, value and rule.
    """
    rows = _rows(text.removeprefix("\ufeff"), source)
    if len(rows) < 2 or len(rows[0]) < 2:
        raise TableError(f"{source}: must have a header and at least one row and one condition")
    header = [name.strip() for name in rows[0]]
    if header[0].casefold() not in {"subject", "subjects", "participant"}:
        raise TableError(f"{source}, line 1: the first column must be 'subject', got {header[0]!r}")
    if not all(header):
        raise TableError(f"{source}, line 1: every condition must have a name, got {header[1:]!r}")
    subjects, scores = [], []
    for line, row in enumerate(rows[1:], start=2):
        _require_length(row, header, f"{source}, line {line}")
        if not row[0].strip():
            raise TableError(f"{source}, line {line}: a subject must have a name, got {row[0]!r}")
        subjects.append(row[0].strip())
        scores.append(_scores(row[1:], header[1:], f"{source}, line {line}"))
    return _table(subjects, header[1:], scores, source)


def _rows(text: str, source: str) -> list[list[str]]:
    try:
        return [row for row in csv.reader(io.StringIO(text)) if any(row)]
    except csv.Error as error:
        raise TableError(f"{source}: cannot be read as CSV ({error})") from error


def _require_length(row: Sequence[str], header: Sequence[str], where: str) -> None:
    if len(row) != len(header):
        raise TableError(f"{where}: must have {len(header)} cells as the header, got {len(row)}")


def _scores(cells: Sequence[str], names: Sequence[str], where: str) -> list[float]:
    return [
        _score(cell.strip(), f"{where}, column {name}")
        for cell, name in zip(cells, names, strict=True)
    ]


def _score(cell: str, where: str) -> float:
    if not cell:
        return float("nan")
    if not _NUMBER.fullmatch(cell):
        raise TableError(f"{where}: a score must be a number or blank, got {cell[:40]!r}")
    value = float(cell)
    if not SCALE[0] <= value <= SCALE[1]:
        raise TableError(f"{where}: a score must lie in [0, 10], got {cell}")
    return value


def _table(
    subjects: list[str], conditions: list[str], scores: list[list[float]], source: str
) -> ScoreTable:
    try:
        return ScoreTable(
            subjects=tuple(subjects), conditions=tuple(conditions), scores=np.array(scores)
        )
    except ValueError as error:
        raise TableError(f"{source}: {error}") from error
