"""Table 4 as text: its lines, a CSV file, and LaTeX with the rules of the booktabs package."""

import math
from collections.abc import Mapping
from types import MappingProxyType

from analysis.cells import csv_cell, csv_text
from analysis.statistics.table4 import Table4
from protocol.study.fields import printable

_LATEX_MISSING = "--"
_ESCAPED = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "$": r"\$",
    "&": r"\&",
    "#": r"\#",
    "%": r"\%",
    "_": r"\_",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"\textquotedbl{}",
    "[": "{[}",  # after a line's end it would begin an option
    "]": "{]}",
    "\n": " ",
    "\r": " ",
}


def table4_lines(
    result: Table4,
    missing: str = "",
    marks: Mapping[tuple[int, int], str] = MappingProxyType({}),
) -> list[list[str]]:
    """Return header, a row per subject and the row of averages, to two decimals.

    Whole scores are written as such; `missing` stands where no score was given, unless
    `marks` has something else for that row and column.
    """
    table = result.table
    rows = [
        [
            subject,
            *(
                _score(score, marks.get((row, column), missing))
                for column, score in enumerate(scores)
            ),
            _mean(mean, missing),
        ]
        for row, (subject, scores, mean) in enumerate(
            zip(table.subjects, table.scores, result.row_means, strict=True)
        )
    ]
    means = (_mean(mean, missing) for mean in result.column_means)
    return [
        ["subject", *table.conditions, "comprehensive"],
        *rows,
        ["average", *means, _mean(result.grand_mean, missing)],
    ]


def _score(score: float, missing: str) -> str:
    if math.isnan(score):
        return missing
    return f"{score:.0f}" if score == round(score) else f"{score:.2f}"


def _mean(mean: float, missing: str) -> str:
    return missing if math.isnan(mean) else f"{mean:.2f}"


def table4_csv(result: Table4) -> str:
    """Return the table as CSV, a missing score as an empty cell."""
    header, *rows = table4_lines(result)
    return csv_text([csv_cell(name) for name in header], rows)


def table4_tex(result: Table4) -> str:
    """Return the table as LaTeX to be read in; it needs the packages booktabs and fontenc (T1)."""
    header, *rows, averages = table4_lines(result, _LATEX_MISSING)
    lines = [
        r"\begin{tabular}{l" + "r" * (len(header) - 1) + "}",
        r"\toprule",
        _line(header),
        r"\midrule",
        *map(_line, rows),
        r"\midrule",
        _line(averages),
        r"\bottomrule",
        r"\end{tabular}",
    ]
    return "\n".join(lines) + "\n"


def _line(cells: list[str]) -> str:
    return " & ".join(map(escaped, cells)) + r" \\"


def escaped(text: str) -> str:
    r"""Return `text` so that LaTeX prints it letter by letter; U+FFFD is what cannot be printed.

    >>> escaped("50 % of P_1")
    '50 \\% of P\\_1'
    """
    return "".join(_ESCAPED.get(letter, letter) for letter in printable(text))
