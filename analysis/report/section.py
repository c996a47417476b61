"""Sections of the report: what each one shows on the page, and what it adds to the other files."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Literal

from analysis.report.drawing import Drawing, Words

ColumnKind = Literal["number", "word", "text", "ranking", "sentence"]


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column of a table; its `kind` decides how the page sets it.

    A `number` is flush right; a `word` is flush left under a name that is flush right; a `text` is
    flush left with its name, and so are a `ranking` and a `sentence`, which get room on a screen.
    """

    name: str
    kind: ColumnKind = "number"


def columns(*names: str, kind: ColumnKind = "number") -> list[Column]:
    """Return columns of one kind."""
    return [Column(name=name, kind=kind) for name in names]


@dataclass(frozen=True, kw_only=True, slots=True)
class Cell:
    """A cell that is more than its text.

    Attributes:
        text: what it shows.
        target: the id that it leads to, empty if it leads nowhere.
        label: what a screen reader says of that link, if not `text`.
        why: why there is no value, shown when pointed at.
        missing: whether `text` stands for a value that is missing.
        anchor: of the first cell of a row, the id by which others lead to the row.
    """

    text: str
    target: str = ""
    label: str = ""
    why: str = ""
    missing: bool = False
    anchor: str = ""


Row = Sequence[str | Cell]


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table; the first cell of each row names it.

    Attributes:
        name: its id in the page, empty for none.
        label: what a screen reader calls it, if not its caption.
        footer: whether the last row sums up the others.
        unbroken: whether the names of columns and rows keep to one line.
    """

    kind: ClassVar = "table"

    name: str
    caption: str
    columns: Sequence[Column]
    rows: Sequence[Row]
    label: str = ""
    footer: bool = False
    unbroken: bool = False


@dataclass(frozen=True, kw_only=True)
class TableGroup:
    """Tables of the same kind, one below the other."""

    kind: ClassVar = "group"

    name: str
    tables: Sequence[Table]


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A figure, and a table of its numbers below it.

    Attributes:
        name: its id in the page, and of its files.
        draw: draws it; None where there is nothing to draw.
        instead: what stands above the table if the figure is not drawn.
    """

    kind: ClassVar = "figure"

    name: str
    title: str = ""
    caption: str = ""
    draw: Callable[[Words], Drawing] | None = None
    instead: str = ""
    table: Table | None = None

    @cached_property
    def drawing(self) -> Drawing | None:
        """The figure as drawn."""
        words = Words(name=self.name, title=self.title, description=self.caption)
        return None if self.draw is None else self.draw(words)


@dataclass(frozen=True, kw_only=True)
class Items:
    """A list, below a line that introduces it; nothing of either without `lines`."""

    kind: ClassVar = "items"

    lines: Sequence[str]
    heading: str = ""
    name: str = ""


@dataclass(frozen=True, kw_only=True)
class Definitions:
    """Names and what each of them is."""

    kind: ClassVar = "definitions"

    entries: Mapping[str, str]


Block = str | Table | TableGroup | Figure | Items | Definitions | None
"""A text is a paragraph; one that is empty, and None, take a place in which nothing is shown."""


@dataclass(frozen=True, kw_only=True)
class Section:
    """A section of the page, and what it adds to the other files of the report.

    Attributes:
        name: its id in the page.
        title: its heading.
        blocks: what it shows, in order.
        data: its part of `report.json`, by key.
        files: the texts of the files it adds to the report, by name.
    """

    name: str
    title: str
    blocks: Sequence[Block]
    data: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)

    @property
    def figures(self) -> list[Figure]:
        """Its figures, drawn or not."""
        return [block for block in self.blocks if isinstance(block, Figure)]
