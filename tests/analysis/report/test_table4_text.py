"""Table 4 as rows, CSV and LaTeX: missing scores, means, and names with special characters."""

import numpy as np

from analysis.estimates import ScoreTable
from analysis.report.table4_text import escaped, table4_csv, table4_lines, table4_tex
from analysis.statistics.summary import table4
from tests.analysis.reports import NAMES, SCORES, imported

HOLED = table4(
    ScoreTable(
        subjects=("P00", "P01"),
        conditions=tuple(NAMES),
        scores=np.array([[5, 7.5, np.nan], [np.nan] * 3]),
    )
)


def test_a_missing_score_is_marked_by_its_cause_and_a_missing_mean_is_not() -> None:
    assert table4_lines(HOLED, "–", {(0, 2): "×"}) == [
        ["subject", "voltage", "structure", "pressure", "mean"],
        ["P00", "5", "7.50", "×", "6.25"],
        ["P01", "–", "–", "–", "–"],
        ["average", "5.00", "7.50", "–", "6.25"],
    ]


def test_a_missing_score_is_an_empty_cell_of_the_csv_file() -> None:
    assert table4_csv(HOLED).splitlines()[1:3] == ["P00,5,7.50,,6.25", "P01,,,,"]


def test_the_latex_table_has_the_rules_of_booktabs_and_escapes_names() -> None:
    scores = table4(imported(SCORES[:1], who="50% of P_").table)
    assert table4_tex(scores, "0 to 10", ["– no score"]).splitlines() == [
        r"\begin{table}",
        r"\centering",
        r"\caption{Scores by subject and condition, 0 to 10. The last column and row are means.}",
        r"\label{tab:scores}",
        r"\begin{tabular}{lrrrr}",
        r"\toprule",
        r"subject & voltage & structure & pressure & mean \\",
        r"\midrule",
        r"50\% of P\_0 & 5 & 7 & 9 & 7.00 \\",
        r"\midrule",
        r"average & 5.00 & 7.00 & 9.00 & 7.00 \\",
        r"\bottomrule",
        r"\end{tabular}",
        r"\\[0.5ex] {\footnotesize \textit{Note.} – no score}",
        r"\end{table}",
    ]


def test_special_characters_of_latex_are_escaped() -> None:
    assert escaped("\\a{b}[c]") == r"\textbackslash{}a\{b\}{[}c{]}"


def test_a_wide_latex_table_turns_its_header_and_shrinks_to_the_page() -> None:
    names = [f"c_{number}" for number in range(9)]
    lines = table4_tex(table4(imported(np.full((2, 9), 5), names=names).table)).splitlines()
    begin = lines.index(r"\begin{tabular}{lrrrrrrrrrr}")
    assert lines[begin - 1].startswith(r"\resizebox{\ifdim\width>\linewidth\linewidth\else")
    assert lines[begin + 2].startswith(r"subject & \rotatebox{90}{c\_0} & \rotatebox{90}{c\_1}")
    assert lines[-3:] == [r"\end{tabular}%", "}", r"\end{table}"]
    few = table4_tex(table4(imported(np.full((2, 8), 5), names=names[:8]).table))
    assert "box" not in few


def test_scores_below_0_are_numbers() -> None:
    below = table4(imported([[-3, 0, 1.5], [-2.5, 1, -1]]).table)
    assert table4_csv(below).splitlines() == [
        "subject,voltage,structure,pressure,mean",
        "P00,-3,0,1.50,-0.50",
        "P01,-2.50,1,-1,-0.83",
        "average,-2.75,0.50,0.25,-0.67",
    ]
    latex = table4_tex(below)
    assert r"P01 & $-$2.50 & 1 & $-$1 & $-$0.83 \\" in latex
