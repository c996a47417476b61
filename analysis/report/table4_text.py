"""The table of scores as text: rows of cells, CSV, and LaTeX for the booktabs package."""

import math
import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from analysis.cells import csv_cell, csv_quoted
from analysis.statistics.summary import Table4
from protocol.study.fields import printable

CATCH = "catch trials"
"""Of scored touches at 0 V, beside the means, which do not include them."""
FEW_CONDITIONS = 8
"""As many columns have room in a page's width."""
# Only a table that is too wide shrinks; a narrow one keeps its size.
_SHRUNK = r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{%"
_MINUS = re.compile(r"^-(?=\d)")
# LaTeX sets two hyphens as a dash.
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
    "[": "{[}",  # after the end of a line it would start an option
    "]": "{]}",
    "\n": " ",
    "\r": " ",
    # Marks of cells, which no font of pdfLaTeX has.
    "⇄": r"$\rightleftharpoons$",
    "×": r"$\times$",
    "○": r"$\circ$",
}


def table4_lines(
    result: Table4,
    missing: str = "",
    marks: Mapping[tuple[int, int], str] = MappingProxyType({}),
    mean: str = "mean",
) -> list[list[str]]:
    """Return the header, a row per subject, and the row of averages, to two decimals.

    Whole scores have no decimals. A missing score is written as `missing`, or as the mark that
    `marks` has for its row and column; a given one is followed by its mark. `mean` is the header
    of the last column, which has the means of the rows.
    """
    table = result.table
    rows, catch = [], result.catch
    for row, (subject, of_row) in enumerate(zip(table.subjects, result.row_means, strict=True)):
        # Whole scores as in the paper's Table 4; means of several trials need their decimals.
        scores = [
            _cell(score, marks.get((row, at), ""), missing)
            for at, score in enumerate(table.scores[row])
        ]
        beside = [] if catch is None else [_mean(catch[row], missing)]
        rows.append([subject, *scores, _mean(of_row, missing), *beside])
    means = (_mean(each, missing) for each in result.column_means)
    return [
        ["subject", *table.conditions, mean, *[CATCH] * (catch is not None)],
        *rows,
        [
            *("average", *means, _mean(result.grand_mean, missing)),
            *[_mean(result.catch_mean, missing)] * (catch is not None),
        ],
    ]


def _cell(score: float, mark: str, missing: str) -> str:
    if math.isnan(score):
        return mark or missing
    text = f"{score:.0f}" if score.is_integer() else _mean(score, missing)
    return f"{text} {mark}".rstrip()


def _mean(mean: float, missing: str) -> str:
    return missing if math.isnan(mean) else f"{mean:.2f}"


def table4_csv(result: Table4, mean: str = "mean") -> str:
    """Return the table as CSV; a missing score is an empty cell."""
    header, *rows = table4_lines(result, mean=mean)
    # Only names can look like formulas: a score below 0 is a number.
    named = [[*map(csv_cell, header)], *([csv_cell(name), *scores] for name, *scores in rows)]
    return "".join(f"{','.join(map(csv_quoted, line))}\n" for line in named)


def table4_tex(
    result: Table4,
    scale: str = "",
    notes: Sequence[str] = (),
    marks: Mapping[tuple[int, int], str] = MappingProxyType({}),
    mean: str = "mean",
) -> str:
    """Return a LaTeX table to include; it requires the packages booktabs and fontenc (T1).

    One of more than `FEW_CONDITIONS` also requires graphicx: its header is turned, and it shrinks
    to the width of the text.

    Args:
        result: the table.
        scale: the scale in words, for the caption.
        notes: sentences below the table, which explain the `marks`.
        marks: as in `table4_lines`.
        mean: as in `table4_lines`.
    """
    header, *rows, averages = table4_lines(result, _LATEX_MISSING, marks, mean)
    many = len(header) > FEW_CONDITIONS + 2
    of_scale = f", {scale}" if scale else ""
    last = "The last column and row are means."
    if result.catch is not None:
        last = f"{mean.capitalize()} and average are of the conditions, without {CATCH} (0 V)."
    caption = f"Scores by subject and condition{of_scale}. {last}"
    below = r"\\[0.5ex] {\footnotesize \textit{Note.} " + escaped(" ".join(notes)) + "}"
    lines = [
        r"\begin{table}",
        r"\centering",
        rf"\caption{{{escaped(caption)}}}",
        r"\label{tab:scores}",
        *([_SHRUNK] if many else []),
        r"\begin{tabular}{l" + "r" * (len(header) - 1) + "}",
        r"\toprule",
        _turned(header) if many else _line(header),
        r"\midrule",
        *map(_line, rows),
        r"\midrule",
        _line(averages),
        r"\bottomrule",
        # The percent sign keeps the line's end from becoming a space in the shrunk box.
        r"\end{tabular}" + "%\n}" * many,
        *([below] if notes else []),
        r"\end{table}",
    ]
    return "\n".join(lines) + "\n"


def _line(cells: list[str]) -> str:
    first, *others = map(escaped, cells)
    # A hyphen is no minus.
    signed = (_MINUS.sub("$-$", cell) for cell in others)
    return " & ".join([first, *signed]) + r" \\"


def _turned(header: list[str]) -> str:
    first, *names = map(escaped, header)
    return " & ".join([first, *(rf"\rotatebox{{90}}{{{name}}}" for name in names)]) + r" \\"


def escaped(text: str) -> str:
    r"""Return `text` escaped for LaTeX; U+FFFD replaces characters that cannot be printed.

    >>> escaped("50% of P_1")
    '50\\% of P\\_1'
    """
    return "".join(_ESCAPED.get(letter, letter) for letter in printable(text))
