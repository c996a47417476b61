"""The page of the columns of exported tables, written from their records."""

from collections.abc import Iterable

from protocol.study.columns import (
    COLUMNS,
    GROUP,
    PARTICIPANT_COLUMNS,
    TOUCH_COLUMNS,
    TRACE_COLUMNS,
    TRACK_COLUMNS,
    YES_NO,
    Column,
)

_INTRODUCTION = """\
# Columns of tables

This page is written from the program by `python -m handbook.reference`. [Exported data](../data.md)
says which files have these columns, and what each format leaves out; [touchbeam in
Python](../python.md) has the same tables. A study's own questions and factors have columns of their
own names; the file beside each table describes them, too.
"""


_TRIAL = tuple(column for column in COLUMNS if not column.per_touch)
_SECTIONS: tuple[tuple[str, str, Iterable[Column]], ...] = (
    ("Trials", "Beside these the columns of [touches](#touches), with a value a touch.", _TRIAL),
    ("Trials of tracks, or of groups", "Where a study has them.", (*TRACK_COLUMNS, GROUP)),
    (
        "Touches",
        "First those that tell which trial it is.",
        [column for column in TOUCH_COLUMNS if column not in _TRIAL],
    ),
    (
        "Participants",
        "First the name; at the end a column for each answer that was given once.",
        PARTICIPANT_COLUMNS[1:],
    ),
    (
        "Samples of a finger, in Python",
        "First those that tell which touch it is.",
        TRACE_COLUMNS[-3:],
    ),
)


def columns_page() -> str:
    """Return the page as Markdown; the columns of touches stand once, with the touches."""
    sections = (f"## {title}\n\n{said}\n\n{_rows(columns)}\n" for title, said, columns in _SECTIONS)
    return "\n".join([_INTRODUCTION, *sections])


def _rows(columns: Iterable[Column]) -> str:
    return "\n".join(map(_row, columns))


def _row(column: Column) -> str:
    unit = f" ({column.unit})" if column.unit else ""
    said = column.description.replace("{scale}", "the scale's lowest to its highest")
    private = " Only in `csv`." * column.private
    return f"- `{column.name}`{unit}: {said}{_levels(column)}{private}"


def _levels(column: Column) -> str:
    if column.levels in ({}, YES_NO):
        return " `true` or `false`." * bool(column.levels)
    return f" {', '.join(f'`{name}` ({told})' for name, told in column.levels.items())}."
