r"""From cells to the text of a table: comma- or tab-separated, a line feed after each record.

A text never becomes a formula in a spreadsheet, never breaks a record of a TSV file, and never
reads as a missing value.
"""

import csv
import io
import json
import re
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache

Scalar = str | int | float | bool | None


Cell = Scalar | tuple[Scalar, ...]
"""A value, None if there is none; a tuple holds one value per touch."""

# Not a comma, which separates the cells of CSV already.
BETWEEN_TOUCHES = ";"
# BIDS prescribes this word for a missing value.
NOT_AVAILABLE = "n/a"

# A spreadsheet may split a file at other marks than the file's own, even within quotation marks.
_BEGINS = r"(?=[\s\"]*[=+\-@＝＋－＠])"
_CSV_FORMULA = re.compile(rf"(^|[;\t\n]){_BEGINS}")
_TSV_FORMULA = re.compile(rf"(^|[;,]){_BEGINS}")
_GUARD = re.compile(rf"(^|[;\t\n])'{_BEGINS}")
# Tab and line feed are left out, because each format has a way of its own to hold them. The others
# may break a line (U+2028), hide (U+FEFF), or cannot be encoded in UTF-8 (surrogates).
_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\ufeff\ud800-\udfff]")
_QUOTED = re.compile('[,"\n]')
_KEPT_TEXTS = 4096
_SURROGATE = re.compile("[\ud800-\udfff]")
"""Half of a character, which no file in UTF-8 can hold."""


def csv_text(header: Sequence[str], rows: Iterable[Sequence[Cell]]) -> str:
    r"""Return a table as RFC 4180 has it, but with a line feed alone at the end of a record.

    A missing value is an empty cell. A text that a spreadsheet would take for a formula gets an
    apostrophe before it; a line feed within a text stays, quoted.

    >>> csv_text(["condition", "note"], [["=1+1", None], ["a", "b, c"]])
    'condition,note\n\'=1+1,\na,"b, c"\n'
    """
    out = io.StringIO()
    # The writer's default is CR LF; all files that are exported end their lines alike.
    writer = csv.writer(out, lineterminator="\n")
    # A study names its factors and questions, so that a heading may be a formula, too.
    writer.writerow(map(csv_cell, header))
    writer.writerows(map(csv_scalar, row) for row in rows)
    return out.getvalue()


def csv_scalar(cell: Cell) -> str:
    """Return the text of a cell of `csv_text` before it is quoted."""
    return _cell_text(cell, csv_cell, missing="")


def csv_item(cell: Scalar) -> str:
    """Return the text of one value of a list, before it is quoted."""
    return _item(_scalar_text(cell, csv_cell, NOT_AVAILABLE))


def csv_quoted(text: str) -> str:
    """Return a cell of CSV in quotation marks if it needs them."""
    if not _QUOTED.search(text):
        return text
    doubled = text.replace('"', '""')
    return f'"{doubled}"'


def csv_fault(error: csv.Error) -> str:
    """Return in words why a table cannot be read, and what to do."""
    # The csv module tells the causes apart by its text alone.
    if "end of data" in str(error):
        return "a quotation mark is opened and never closed; close it"
    if "field limit" in str(error):
        return (
            f"a cell must have at most {csv.field_size_limit()} characters, got more; "
            "if a quotation mark is opened there and never closed, close it"
        )
    return f"cannot be read as CSV ({error})"


def tsv_text(header: Sequence[str], rows: Iterable[Sequence[Cell]]) -> str:
    r"""Return a table as BIDS has it: a tab between cells, `n/a` for a missing value.

    Quotes mean nothing there. In a text, `\\`, `\t` and `\n` stand for backslash, tab, line feed.

    >>> tsv_text(["score", "note"], [[7, "a\tb\nc"], [None, None]])
    'score\tnote\n7\ta\\tb\\nc\nn/a\tn/a\n'
    """
    lines = [
        header,
        *([_cell_text(cell, tsv_cell, missing=NOT_AVAILABLE) for cell in row] for row in rows),
    ]
    return "".join("\t".join(line) + "\n" for line in lines)


# Most texts of a table are names that come again in row after row.
@lru_cache(maxsize=_KEPT_TEXTS)
def csv_cell(text: str) -> str:
    """Return `text` as a cell of a CSV file holds it, before it is quoted."""
    return _CONTROL.sub(_escape, _CSV_FORMULA.sub(r"\1'", _line_feeds(text)))


@lru_cache(maxsize=_KEPT_TEXTS)
def tsv_cell(text: str) -> str:
    """Return `text` as a cell of a TSV file holds it."""
    # The backslash goes first, so that it leaves alone those that the others add.
    escaped = _line_feeds(text).replace("\\", "\\\\").replace("\t", "\\t").replace("\n", "\\n")
    shown = _CONTROL.sub(_escape, _TSV_FORMULA.sub(r"\1'", escaped))
    # A text that happens to be "n/a" must not read as a missing value.
    return f"'{shown}" if shown.strip() == NOT_AVAILABLE else shown


def _cell_text(cell: Cell, written: Callable[[str], str], missing: str) -> str:
    """Return a value as text; of a list, one value per touch, its texts with semicolons between.

    A list without any value is missing as a whole.
    """
    if not isinstance(cell, tuple):
        return _scalar_text(cell, written, missing)
    if cell.count(None) == len(cell):
        return missing
    return BETWEEN_TOUCHES.join([_item(_scalar_text(it, written, NOT_AVAILABLE)) for it in cell])


def _item(text: str) -> str:
    # A semicolon within a value would otherwise begin the next touch.
    return text.replace(BETWEEN_TOUCHES, "\\;")


def _scalar_text(value: Scalar, written: Callable[[str], str], missing: str) -> str:
    if value is None:
        return missing
    if isinstance(value, str):
        return written(value) if value and not value.isspace() else missing
    if value is True or value is False:
        return "true" if value else "false"
    # The fewest digits that give the same number back: nothing is rounded.
    return repr(value)


def _line_feeds(text: str) -> str:
    return text.replace("\r\n", "\n").replace("\r", "\n")


def unguarded(text: str) -> str:
    """Return `text` without the apostrophes that `csv_cell` puts before what looks like a formula.

    >>> unguarded("'=1+1;'-1"), unguarded("'s")
    ('=1+1;-1', "'s")
    """
    return _GUARD.sub(r"\1", text)


def _escape(match: re.Match[str]) -> str:
    return ascii(match[0])[1:-1]


def json_text(document: object) -> str:
    """Return `document` as JSON for people and programs."""
    out = io.StringIO()  # takes a fifth of the memory of the list of parts that json.dumps joins
    # NaN is not JSON, so that a missing number must have become `null` before.
    json.dump(document, out, indent=2, ensure_ascii=False, allow_nan=False)
    return _SURROGATE.sub(_escape, out.getvalue()) + "\n"
