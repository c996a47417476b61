"""Building blocks of a section: tables, figures, lists and data for the other files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Literal

from analysis.estimates import NotEstimable
from analysis.kept import Kept
from analysis.report.drawing import Draw, Drawing, Words, kept_drawing
from analysis.report.wording import p_value

ColumnKind = Literal["number", "word", "text", "ranking", "sentence"]


@dataclass(frozen=True, kw_only=True)
class Column:
    """Column of a table; its `kind` sets alignment and width on the page.

    A `number` is aligned right. A `word` is aligned left under a right-aligned header. A `text` is
    aligned left like its header; `ranking` and `sentence` are texts with a minimum width on screen.
    """

    name: str
    kind: ColumnKind = "number"


def columns(*names: str, kind: ColumnKind = "number") -> list[Column]:
    """Return columns of the same kind."""
    return [Column(name=name, kind=kind) for name in names]


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
    return Cell(text=p_value(p), why=f"p = {p:.6g}" if known else "", missing=not known)


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
        keep: what keeps the drawing.
        instead: paragraph above the table if the figure is not drawn.
        front: whether it stands among the results, with its table in the section.
    """

    kind: ClassVar = "figure"

    name: str
    title: str = ""
    caption: str = ""
    draw: Draw | None = None
    keep: Kept = field(default_factory=Kept)
    instead: str = ""
    table: Table | None = None
    front: bool = False

    @cached_property
    def drawing(self) -> Drawing | None:
        """The drawn figure, or None if there is nothing to draw."""
        words = Words(name=self.name, title=self.title, description=self.caption)
        return None if self.draw is None else kept_drawing(self.draw, words, self.keep)


@dataclass(frozen=True, kw_only=True)
class Items:
    """List with an optional heading; shows nothing if `lines` is empty.

    With `front` it stands among the results, below Table 4.
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
    """Section of the page, with its part of the report's other files.

    Attributes:
        name: id in the page.
        title: heading.
        blocks: contents, in order.
        data: entries of `report.json`, by key.
        files: texts of additional files, by name.
    """

    name: str
    title: str
    blocks: Sequence[Block]
    data: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)

    @property
    def figures(self) -> list[Figure]:
        """Figures of the section, drawn or not."""
        return [block for block in self.blocks if isinstance(block, Figure)]
