"""The columns of a table of scenes: their defaults, their rules, and the cells that break them."""

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from analysis.cells import csv_fault
from analysis.estimates import BoolArray
from analysis.tables.separated import require_commas
from device.arrays import FloatArray
from device.beam.eq15 import describes
from device.beam.spectral import HIGHEST_MODE
from device.friction.prediction import Ratio
from device.friction.scenes import Drive, FingerContact
from device.friction.surfaces import PAPERS, BeamSurface
from protocol.errors import BadInput, meant, shown
from protocol.study.touch import Coverage, Direction

Cells = Sequence[str] | NDArray[Any]
"""A column's cells: the texts of a file, or numbers, of which NaN is a blank cell."""


@dataclass(frozen=True)
class NumberColumn:
    """A column of numbers: its default (nan: none) and what a value must keep to.

    `reach`: the least and the largest size of a value that is not 0. Far beyond what any device
    does, and so that no product of them leaves the range of numbers.
    """

    default: float
    rule: str
    keeps: Callable[[FloatArray], BoolArray]
    reach: tuple[float, float] = (1e-9, 1e9)
    word: str = ""
    """What may stand for a number, read as nan."""


@dataclass(frozen=True)
class WordColumn:
    """A column of words: the default first."""

    words: tuple[str, ...]


def _between(low: float, high: float) -> Callable[[FloatArray], BoolArray]:
    return lambda values: (values >= low) & (values <= high)


def _finite(what: str, keeps: Callable[[FloatArray], BoolArray]) -> Callable[[float], NumberColumn]:
    """Return the maker of columns of such finite numbers, from their default."""
    rule = f"must be a {what}"
    return lambda own: NumberColumn(own, rule, lambda values: np.isfinite(values) & keeps(values))


_positive = _finite("finite number above 0", lambda values: values > 0)
_not_negative = _finite("finite number of at least 0", lambda values: values >= 0)
_count = _finite(
    "whole number of at least 1", lambda values: (values >= 1) & (values == np.floor(values))
)


@lru_cache(maxsize=16)
def columns_of(surface: BeamSurface) -> Mapping[str, NumberColumn | WordColumn]:
    """Return the columns of scenes on a surface, by name."""
    structure, touch, length_m = surface.structure, FingerContact(), surface.length_m
    place_m = min(touch.x_m, length_m)
    return {
        "voltage_v": _not_negative(Drive().voltage_v),
        "frequency_hz": replace(
            _positive(np.nan),
            rule="must be `resonance` or a finite number above 0",
            word="resonance",
        ),
        "x_m": NumberColumn(place_m, f"must lie in [0, {length_m:g}]", _between(0.0, length_m)),
        "contact_m": _positive(touch.contact_m),
        "direction": WordColumn(get_args(Direction)),
        "coverage": WordColumn(get_args(Coverage)),
        "same_direction_fraction": NumberColumn(
            np.nan, "must lie in [0, 1]", _between(0.0, 1.0), reach=(0.0, 1.0)
        ),
        "ratio": WordColumn(get_args(Ratio) if describes(structure.beam) else ("mode",)),
        "body_count": _count(structure.body_count),
        "body_load_n": _positive(touch.body_load_n),
        "finger_load_n": _positive(np.nan),
        "body_mass_kg": _not_negative(structure.body_mass_kg),
        "friction_coefficient": _positive(structure.friction_coefficient),
        "damping_ratio": NumberColumn(
            structure.beam.damping_ratio,
            "must lie strictly between 0 and 1",
            lambda values: (values > 0) & (values < 1),
        ),
        "mode": replace(_count(surface.mode), reach=(1, HIGHEST_MODE)),
        "sliding_speed_m_s": _positive(touch.sliding_speed_m_s),
        "body_height_m": _not_negative(structure.body_height_m),
    }


COLUMNS = columns_of(PAPERS)


@dataclass(frozen=True, kw_only=True, eq=False)
class SceneTable:
    """Scenes as read: a column each, defaults filled in, and the line of each row.

    Columns have shape (n,), or (1,) for a value that all scenes share.
    """

    source: str
    lines: Sequence[int]
    numbers: Mapping[str, FloatArray]
    words: Mapping[str, NDArray[np.str_]]

    def complaint(self, row: int, column: str, rule: str, value: object) -> BadInput:
        """Return the error that names file, line, column, rule and value."""
        return bad_cell(self.source, self.lines[row], column, rule, value)


def bad_cell(source: str, line: int, column: str, rule: str, value: object) -> BadInput:
    return BadInput(f"{source}, line {line}, column {column}: {rule}, got {shown(value)}")


def _checked_header(source: str, header: Sequence[str]) -> None:
    """Refuse unknown and repeated columns."""
    for name in header:
        if name not in COLUMNS:
            raise BadInput(
                f"{source}, line 1: unknown column {shown(name)}; {meant(name, COLUMNS)}"
            )
        if list(header).count(name) > 1:
            raise BadInput(f"{source}, line 1: column {name!r} stands twice")


def _rows(source: str, text: str) -> tuple[list[str], list[list[str]], list[int]]:
    """Return header, rows of cells and their lines; blank lines are skipped."""
    # Spreadsheets put a byte order mark before UTF-8; a stray quotation mark must not join cells.
    reader = csv.reader(io.StringIO(text.removeprefix("\ufeff"), newline=""), strict=True)
    begins = 1
    try:
        header = [name.strip() for name in next(reader, [])]
        if not header:
            raise BadInput(f"{source}, line 1: a line of column names is due, got none")
        require_commas(header, f"{source}, line 1")
        _checked_header(source, header)
        rows, lines = [], []
        begins = reader.line_num + 1
        for row in reader:
            begins = reader.line_num + 1
            if row:
                rows.append(row)
                lines.append(reader.line_num)
    except csv.Error as error:
        raise BadInput(f"{source}, line {begins}: {csv_fault(error)}") from None
    for row, line in zip(rows, lines, strict=True):
        if len(row) != len(header):
            raise BadInput(f"{source}, line {line}: {len(header)} cells are due, got {len(row)}")
    return header, rows, lines


def _number(text: str) -> float | None:
    """Return the number that a cell holds, or None; underscores make none here."""
    try:
        return None if "_" in text else float(text)
    except ValueError:
        return None


def _numbers(
    source: str, name: str, column: NumberColumn, cells: Cells, lines: Sequence[int]
) -> FloatArray:
    """Return a column of numbers; blank cells and the column's word take its default."""
    if isinstance(cells, np.ndarray):
        values = cells.astype(np.float64)
        blank = np.isnan(values)
        values[blank] = column.default
        given = np.flatnonzero(~blank)
    else:
        given = np.flatnonzero([bool(cell) and cell != column.word for cell in cells])
        values = np.full(len(cells), column.default, dtype=np.float64)
        for row in given:
            if (number := _number(cells[row])) is None:
                raise bad_cell(source, lines[row], name, column.rule, cells[row])
            values[row] = number
    if not given.size:
        return values
    checked = values if given.size == values.size else values[given]
    wrong = given[~column.keeps(checked)]
    if wrong.size:
        raise bad_cell(source, lines[wrong[0]], name, column.rule, str(cells[wrong[0]]))
    low, high = column.reach
    beyond = given[(checked != 0) & ~((checked >= low) & (checked <= high))]
    if beyond.size:
        # The message must not forbid a 0 that the column's own rule allows.
        zero = "be 0 or " if column.keeps(np.zeros(1))[0] else ""
        rule = f"must {zero}lie in [{low:g}, {high:g}]"
        raise bad_cell(source, lines[beyond[0]], name, rule, str(cells[beyond[0]]))
    return values


def _words(
    source: str, name: str, column: WordColumn, cells: Cells, lines: Sequence[int]
) -> NDArray[np.str_]:
    """Return a column of words; blank cells take its default."""
    texts = cells if not isinstance(cells, np.ndarray) else [str(cell) for cell in cells]
    if not {"", *column.words}.issuperset(texts):
        for cell, line in zip(texts, lines, strict=False):
            if cell and cell not in column.words:
                rule = f"must be one of {', '.join(column.words)}"
                raise bad_cell(source, line, name, rule, cell)
    return np.array([cell or column.words[0] for cell in texts], dtype=np.str_)


def scene_table(
    source: str,
    text: str,
    defaults: Mapping[str, float] | None = None,
    surface: BeamSurface = PAPERS,
) -> SceneTable:
    """Return the scenes of a CSV text, on a surface.

    The first line names the columns, all of which are optional. `source` is the file's name, for
    messages; `defaults` are values for blank cells, such as a study's, in place of the paper's.

    Raises:
        BadInput: a column is unknown or repeated, a row too short or long, or a cell breaks its
            column's rule; the message names file, line, column, rule and value.
    """
    header, rows, lines = _rows(source, text)
    cells = [[cell.strip() for cell in column] for column in zip(*rows, strict=True)]
    given = dict(zip(header, cells, strict=True)) if rows else {}
    return _table(source, given, lines, defaults, surface)


def column_table(
    source: str,
    columns: Mapping[str, NDArray[Any]],
    count: int,
    defaults: Mapping[str, float] | None = None,
    surface: BeamSurface = PAPERS,
) -> SceneTable:
    """Return the scenes of arrays, of shape (count,) each, or (1,) for a value that all share.

    NaN and None are blank cells. See `scene_table` for the rest.
    """
    _checked_header(source, [*columns])
    cells = {name: _cells_of(column) for name, column in columns.items()}
    # Line 1 would hold the names, so that messages count as in a file.
    return _table(source, cells, range(2, count + 2), defaults, surface)


def _cells_of(column: NDArray[Any]) -> Cells:
    """Return an array's numbers as they are, anything else as the text it would be in a file."""
    if column.dtype == np.float64 or column.dtype.kind in "iu":
        return column
    cells = column.tolist() if column.dtype == np.object_ else column
    return ["" if _is_missing(cell) else str(cell).strip() for cell in cells]


def _is_missing(cell: Any) -> bool:
    try:
        return cell is None or bool(cell != cell)  # NaN alone differs from itself  # noqa: PLR0124
    except TypeError:  # the NA of pandas neither does nor does not
        return True


def _table(
    source: str,
    given: Mapping[str, Cells],
    lines: Sequence[int],
    defaults: Mapping[str, float] | None,
    surface: BeamSurface,
) -> SceneTable:
    """Return the table of given columns; what all scenes share has shape (1,)."""
    numbers, words = {}, {}
    for name, column in columns_of(surface).items():
        cells = given.get(name)
        if isinstance(column, WordColumn):
            own = column.words[:1] if cells is None else _words(source, name, column, cells, lines)
            words[name] = np.asarray(own)
        else:
            if defaults and name in defaults:
                column = replace(column, default=defaults[name])  # noqa: PLW2901 - for this table
            numbers[name] = (
                np.array([column.default], dtype=np.float64)
                if cells is None
                else _numbers(source, name, column, cells, lines)
            )
    return SceneTable(source=source, lines=lines, numbers=numbers, words=words)
