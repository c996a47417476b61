"""Table 4 in LaTeX, with the rules of the booktabs package."""

from analysis.statistics.table4 import Table4
from protocol.study.fields import printable

MISSING = "--"
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


def escaped(text: str) -> str:
    r"""Return `text` so that LaTeX prints it letter by letter; U+FFFD is what cannot be printed.

    >>> escaped("50 % of P_1")
    '50 \\% of P\\_1'
    """
    return "".join(_ESCAPED.get(letter, letter) for letter in printable(text))


def table4_tex(result: Table4) -> str:
    """Return the table as LaTeX to be read in; it needs the packages booktabs and fontenc (T1)."""
    header, *rows, averages = result.lines(MISSING)
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
