"""Building blocks of a section: tables, figures, lists and data for the other files."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property, partial
from operator import itemgetter
from typing import Any, ClassVar, Literal

import numpy as np

from analysis.estimates import NotEstimable
from analysis.report import wording
from analysis.report.drawing import Draw, Drawing, Words, drawing

ColumnKind = Literal["number", "word", "text", "ranking", "sentence"]


# With slots, because the tables of a large study have half a million cells.
@dataclass(frozen=True, kw_only=True, slots=True)
class Cell:
    """Cell with a link, an anchor, or a reason for a missing value.

    Attributes:
        text: the text shown.
        target: id that the cell links to, or empty.
        label: accessible name of the link, if other than `text`.
        why: reason for a missing value, or all digits of a rounded one, shown as a tooltip.
        missing: whether `text` marks a missing value.
        anchor: id of the cell; that of a first cell is the id of its row.
    """

    text: str
    target: str = ""
    label: str = ""
    why: str = ""
    missing: bool = False
    anchor: str = ""


Row = Sequence[str | Cell]


def p_cell(p: float | NotEstimable | None) -> Cell:
    """Return a p-value as journals print it, with all its digits as a tooltip."""
    # Journals round p; whoever wants to compute with it needs all digits.
    known = isinstance(p, float)
    return Cell(text=wording.p_value(p), why=f"p = {p:.6g}" if known else "", missing=not known)


def text(value: object) -> str:
    """Return what a column of texts shows of a value."""
    return wording.MISSING if value is None or isinstance(value, NotEstimable) else str(value)


def at(record: Any, path: str) -> Any:
    """Return what stands at a path of attributes, or what is missing on the way to it."""
    for name in path.split("."):
        if record is None or isinstance(record, NotEstimable):
            break
        record = getattr(record, name)
    return record


@dataclass(frozen=True)
class Column:
    """Column of a table: its title, what it shows of a record, and how.

    A `number` is aligned right. A `word` is aligned left under a right-aligned header. A `text` is
    aligned left like its header; `ranking` and `sentence` are texts with a minimum width on screen.

    Attributes:
        name: title.
        of: path of attributes from a record to its value, such as `test.p`, or a function of it.
        shown: makes a cell of the value, whether or not it is known; or the decimals of a number.
        kind: sets alignment and width on the page.
        absent: what a record shows that lacks the attribute, as a group does among its subjects.
    """

    name: str
    of: str | Callable[[Any], Any] = ""
    shown: int | Callable[[Any], str | Cell] = text
    _: KW_ONLY
    kind: ColumnKind = "number"
    absent: str | None = None

    def cell(self, record: Any) -> str | Cell:
        """Return what the column shows of a record."""
        try:
            value = at(record, self.of) if isinstance(self.of, str) else self.of(record)
        except AttributeError:
            if self.absent is None:
                raise
            return self.absent
        return (
            wording.number(value, self.shown) if isinstance(self.shown, int) else self.shown(value)
        )


def columns(*names: str, kind: ColumnKind = "number") -> list[Column]:
    return [Column(name, kind=kind) for name in names]


def estimate(
    name: str, of: str, digits: int = 2, absent: str | None = None
) -> tuple[Column, Column]:
    """Return the columns of an estimate and of its interval, which its record has beside it."""
    ends = partial(wording.interval, digits=digits)
    return (
        Column(name, of, digits, absent=absent),
        Column("95%", f"{of}_interval", ends, absent=absent),
    )


def estimated(
    name: str, of: str, digits: int = 2, absent: str | None = None
) -> tuple[Column, Column]:
    """Return the columns of an `Estimate` and of its interval."""
    ends = partial(wording.interval, digits=digits)
    return (
        Column(name, f"{of}.value", digits, absent=absent),
        Column("95%", f"{of}.interval", ends, absent=absent),
    )


def spread_columns(across: str) -> list[Column]:
    """Return the columns of groups of values, pairs of name and values: number and quartiles."""

    def quantile(share: float) -> Callable[[Any], float]:
        return lambda group: float(np.quantile(group[1], share)) if len(group[1]) else np.nan

    shares = zip(("lowest", "quartile", "median", "quartile", "highest"), range(5), strict=True)
    return [
        Column(across, itemgetter(0)),
        Column("n", lambda group: len(group[1])),
        *(Column(name, quantile(quarters / 4), 2) for name, quarters in shares),
    ]


def law_columns(name: str) -> list[Column]:
    """Return the columns of laws that are compared with the ratings."""
    return [
        Column(name, "law"),
        Column("ln Bayes factor", "ln_bayes_factor", 1),
        Column("Spearman", "order.spearman", 2),
        Column("p", "order.p", wording.p_value),
        Column("order, strongest first", "order", wording.ranking, kind="ranking"),
    ]


@dataclass(frozen=True, kw_only=True)
class Table:
    """Table; the first cell of each row is its header.

    Attributes:
        name: id in the page, or empty.
        label: accessible name, if other than the caption.
        footer: whether the last row summarises the others.
        front: whether it stands among the results, before the sections.
        unbroken: whether column and row headers stay on one line.
    """

    kind: ClassVar = "table"

    name: str
    caption: str
    columns: Sequence[Column]
    rows: Sequence[Row]
    label: str = ""
    footer: bool = False
    unbroken: bool = False
    front: bool = False

    @classmethod
    def over(cls, records: Iterable[Any], columns: Sequence[Column], **told: Any) -> "Table":
        """Return the table with a row for each of `records`, as the columns show it."""
        rows = [[column.cell(record) for column in columns] for record in records]
        return cls(columns=columns, rows=rows, **told)

    def turned(self, corner: str) -> "Table":
        """Return the table with rows in place of its columns, `corner` above their names."""
        names = [column.name for column in self.columns[1:]]
        heads, *lines = zip(*self.rows, strict=True)
        titles = (head if isinstance(head, str) else head.text for head in heads)
        rows = [[name, *line] for name, line in zip(names, lines, strict=True)]
        return replace(self, columns=columns(corner, *titles), rows=rows)


@dataclass(frozen=True, kw_only=True)
class TableGroup:
    """Tables of the same kind, one below another."""

    kind: ClassVar = "group"

    name: str
    tables: Sequence[Table]


@dataclass(frozen=True, kw_only=True)
class Figure:
    """Figure with a table of its numbers below.

    Attributes:
        name: id in the page, and name of its files.
        draw: draws the figure; None if there is nothing to draw.
        instead: paragraph above the table if the figure is not drawn.
        front: whether it stands among the results, with its table in the section.
    """

    kind: ClassVar = "figure"

    name: str
    title: str = ""
    caption: str = ""
    draw: Draw | None = None
    instead: str = ""
    table: Table | None = None
    front: bool = False

    @cached_property
    def drawing(self) -> Drawing | None:
        """The drawn figure, or None if there is nothing to draw."""
        words = Words(name=self.name, title=self.title, description=self.caption)
        return None if self.draw is None else drawing(self.draw, words)


@dataclass(frozen=True, kw_only=True)
class Items:
    """List with an optional heading; shows nothing if `lines` is empty.

    With `front` it stands among the results, below the table of scores.
    """

    kind: ClassVar = "items"

    lines: Sequence[str]
    heading: str = ""
    name: str = ""
    front: bool = False


@dataclass(frozen=True, kw_only=True)
class Definitions:
    """Definition list: names and their values."""

    kind: ClassVar = "definitions"

    entries: Mapping[str, str]


Block = str | Table | TableGroup | Figure | Items | Definitions | None
"""A text is a paragraph; an empty text and None show nothing."""


@dataclass(frozen=True, kw_only=True)
class Section:
    """Section of the page, with its part of the report's other files; without blocks not shown.

    Attributes:
        title: heading.
        blocks: contents, in order.
        data: entries of `report.json`, by key.
        files: texts of additional files, by name.
        name: id in the page.
    """

    title: str = ""
    blocks: Sequence[Block] = ()
    data: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)
    name: str = ""

    @property
    def figures(self) -> list[Figure]:
        """Figures of the section, drawn or not."""
        return [block for block in self.blocks if isinstance(block, Figure)]
