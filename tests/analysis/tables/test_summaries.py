"""Rows and columns of a table that sum up the others, and those that only seem to."""

from pathlib import Path

import numpy as np
import pytest

from analysis.report.table4_text import table4_csv, table4_lines
from analysis.statistics.summary import table4
from analysis.tables.summaries import mean_column
from analysis.tables.table_cells import TableError
from tests.analysis.imported import imported, score_table

PUBLISHED = (Path(__file__).parents[2] / "data" / "published_scores.csv").read_text()


def with_means(column: str | None, row: str | None) -> str:
    """The published table with its means as printed, under these names."""
    lines = table4_lines(table4(score_table(PUBLISHED)))
    named = [[*lines[0][:-1], column or ""], *lines[1:-1], [row or "", *lines[-1][1:]]]
    wanted = named if row else named[:-1]
    return "".join(",".join(line if column else line[:-1]) + "\n" for line in wanted)


@pytest.mark.parametrize(
    ("column", "row", "left_out"),
    [
        ("Comprehensive", None, "column Comprehensive"),
        (None, "AVERAGE", "1 row named AVERAGE"),
        ("total", "mean", "column total; 1 row named mean"),
    ],
)
def test_printed_means_that_are_called_so_are_left_out(
    column: str | None, row: str | None, left_out: str
) -> None:
    scores = imported(with_means(column, row))
    assert scores.lines[-1] == f"Left out: {left_out}."
    assert len(scores.ratings) == 9 * 5


KEEPS = "the mean of all others; --keep-means keeps it)"
COLUMN, ROW = f"column overall ({KEEPS}", f"1 row named all-9 (line 11, {KEEPS}"


@pytest.mark.parametrize(
    ("column", "row", "left_out"),
    [
        ("overall", None, COLUMN),
        (None, "all-9", ROW),
        ("overall", "all-9", f"{COLUMN}; {ROW}"),
    ],
)
def test_means_under_other_names_are_left_out_and_named(
    column: str | None, row: str | None, left_out: str
) -> None:
    scores = imported(with_means(column, row))
    assert scores.lines[-1] == f"Left out: {left_out}."
    assert len(scores.ratings) == 9 * 5


REPEATS = "vp,rau_1,rau_2,glatt_1,glatt_2{}\nA,3,4,5,6{}\nB,2,4,6,7{}\nC,3,5,4,6{}\n"


@pytest.mark.parametrize(
    "beside",
    [
        (",rau_MW,glatt_MW", ",3.5,5.5", ",3,6.5", ",4,5"),
        (",mean_rau,meanGlatt", ",3.5,5.5", ",3,6.5", ",,5"),
        (",x,y", ",3.5,5.5", ",3,6.5", ",4,5"),
    ],
)
def test_means_of_repeats_are_left_out_by_their_names_and_values(beside: tuple[str, ...]) -> None:
    text = REPEATS.format(*beside)
    with pytest.raises(TableError, match=r"repeat=ending\) or conditions of their own"):
        imported(text)
    scores = imported(text, "repeat=ending")
    assert (scores.conditions, len(scores.ratings)) == (("rau", "glatt"), 12)
    assert scores.lines[-1].startswith("Left out: columns ")
    assert imported(text, "condition=heading", keep_means=True).conditions[4:] == tuple(
        beside[0][1:].split(",")
    )


def test_a_further_column_does_not_hide_that_the_others_may_be_repeats() -> None:
    text = REPEATS.format(",confidence", ",3", ",1", ",2")
    said = r"rau_1, rau_2 may be 2 repeats of a condition \(add --columns repeat=ending,ignore=conf"
    with pytest.raises(TableError, match=said):
        imported(text)
    with pytest.raises(TableError, match="leave others out with ignore=confidence"):
        imported(text, "repeat=ending")
    assert imported(text, "repeat=ending,ignore=confidence").conditions == ("rau", "glatt")
    assert len(imported(text, "condition=heading").conditions) == 5


def test_columns_that_tell_of_others_by_their_names_are_no_conditions() -> None:
    text = "subject,rau_mean,rau_sd,fein_mean,fein_se,SC0,touch_complete,is_complete\n" + "".join(
        f"P{who},{who},.5,{who + 1},.{who},{2 * who + 1},2,{who}\n" for who in (1, 2, 3)
    )
    scores = imported(text)
    assert scores.conditions == ("rau_mean", "fein_mean", "is_complete")
    assert scores.lines[-1] == "Left out: columns rau_sd, fein_se, SC0, touch_complete."
    assert imported("subject,left_sd,right_sd\nP1,1,2\nP2,2,4\n").conditions[0] == "left_sd"


def test_scores_that_are_the_mean_of_all_others_can_be_kept() -> None:
    for name in ("overall", "total"):
        assert imported(with_means(name, None), keep_means=True).conditions[-1] == name
    assert imported(with_means(None, "all-9"), keep_means=True).visits[-1].participant == "all-9"


PRINTED = """VP;m;n;o;Ø
MW;23;28;77;42,7
SD;26;40;90;52,0
SE;42;26;81;49,7
N;11;31;-;21,0
"""


def test_initials_and_letters_are_people_and_conditions_though_means_are_called_so() -> None:
    people = "".join(line.rpartition(";")[0] + "\n" for line in PRINTED.splitlines())
    for text in (people, people.replace("VP;m;n;o", "VP;m;n;sum")):
        scores = imported(text)
        assert len(scores.visits) == 4
        assert len(scores.conditions) == 3
        assert not scores.lines[-1].startswith("Left out")
    scores = imported("subject,item,score\nSD,a,1\nSD,b,2\nM,a,3\nM,b,5\n")
    assert len(scores.visits) == 2


def test_means_with_a_short_name_are_known_by_their_numbers() -> None:
    sums = "M;25,5;31,25;82,67;41,33\nSD;12,77;6,18;6,66;14,1\nN;4;4;3;4\n"
    printed = PRINTED
    for name in ("MW", "SD", "SE", "N"):
        printed = printed.replace(f"\n{name};", f"\nA{name};")
    scores = imported(printed + sums)
    assert len(scores.visits) == 4
    assert scores.conditions == ("m", "n", "o")
    assert scores.lines[-1] == ("Left out: column Ø; 1 row named M; 1 row named SD; 1 row named N.")
    assert len(imported(printed + sums.replace("25,5", "25,6")).visits) == 7
    assert len(imported(printed + sums.replace("N;", "X;")).visits) == 7
    assert imported(printed.replace("52,0", "52,3")).conditions == ("m", "n", "o", "Ø")


def test_our_own_table_4_is_read_without_its_means() -> None:
    written = table4_csv(table4(score_table(PUBLISHED)))
    assert np.array_equal(score_table(written).scores, score_table(PUBLISHED).scores)


@pytest.mark.parametrize(
    "scores",
    [
        [[6, 6, 6, 6, 6]] * 5,
        [[3, 3, 3, 3], [4, 4, 4, 4], [5, 5, 5, 5]],
        [[4, 7, 7, 6], [1, 4, 4, 3]],
        [[5, 7, 6], [2, 4, 3], [1, 3, 2]],
        [[np.nan] * 4] * 4,
        [[4, 7, 7, 6], [1, 4, 4, 3], [3, 3, 0, np.nan]],
        [[23, 28.5, 77, 42.9], [26, 40, 90, 52], [42, 26, 81.5, 49.8]],
    ],
    ids=[
        *("all alike", "rows alike", "two rows", "two others", "none given", "one missing"),
        "off by .06",
    ],
)
def test_scores_that_meet_their_mean_by_chance_are_scores(scores: list[list[float]]) -> None:
    assert mean_column(np.array(scores)) is None


@pytest.mark.parametrize(
    "scores",
    [
        [[4, 7, 7, 6], [1, 4, 4, 3], [3, 3, 0, 2]],
        [[5, 7, 7, 6.33]],
        [[5, 7, np.nan, 6], [2, 5, 3, 3.33], [np.nan] * 4],
        [[23, 28.5, 77, 42.8], [26, 40, 90, 52], [42, 26, 81.5, 49.8]],
    ],
    ids=["three rows", "a fraction", "missing scores", "to one decimal"],
)
def test_a_column_of_means_is_found(scores: list[list[float]]) -> None:
    assert mean_column(np.array(scores)) == 3


@pytest.mark.parametrize(
    "name",
    [
        *("SEM", "SE", "Std. Dev.", "StdDev", "SD (n-1)", "Min", "Max", "n", "N", "Anzahl", "Sum"),
        *("标准差", "平均", "合计", "总分", "Écart-type", "Mean ± SD", "All", "Grand Total", "M."),
    ],
)
def test_rows_that_sum_up_beside_codes_of_subjects_are_known_by_their_names(name: str) -> None:
    scores = imported(f"id,a,b\nP1,3,6\nP2,2,5\nP3,3,7\n{name},0.6,1.0\n")
    assert len(scores.visits) == 3
    assert scores.lines[-1] == f"Left out: 1 row named {name}."
    long = f"id,item,score\nP1,a,3\nP1,b,4\nP2,a,3\nP2,b,1\n{name},a,0.6\n{name},b,1\n"
    assert len(imported(long).visits) == 2


def test_short_names_beside_names_are_people_unless_their_numbers_tell() -> None:
    people = "id,a,b,c\nAnn,3,6,2\nBo,2,5,3\nCem,4,7,3\n{}\n"
    for row in ("Max,4,7,3", "Min,2,5,2", "All,3,6,2.67", "Sum,9,18,8", "n,3,3,3"):
        assert len(imported(people.format(row)).visits) == 3, row
    for row in ("Max,4,6,3", "Min,1,5,2", "All,3,6,3", "Sum,9,7,8", "n,3,2,3"):
        assert len(imported(people.format(row)).visits) == 4, row


def test_columns_that_sum_up_are_known_by_their_names_and_numbers() -> None:
    text = "id,a,b,{}\nP1,3,6,{}\nP2,2,5,{}\nP3,4,7,{}\n"
    for sums in (
        ("All", 4.5, 3.5, 5.5),
        ("Sum", 9, 7, 11),
        ("Min", 3, 2, 4),
        ("n", 2, 2, 2),
        ("总分", 9, 7, 11),
    ):
        scores = imported(text.format(*sums))
        assert scores.lines[-1] == f"Left out: column {sums[0]}."
    assert imported(text.format("Min", 3, 2, 5)).conditions == ("a", "b", "Min")


@pytest.mark.parametrize(
    ("row", "what"),
    [
        ("zusammen,17,10", "the sum"),
        ("Streuung,1.26,1.29", "the standard deviation"),
        ("Streuung,1.1,1.1", "the standard deviation"),
    ],
)
def test_a_last_row_of_sums_is_known_by_its_numbers(row: str, what: str) -> None:
    text = "id,a,b\nX,3,1\nY,4,2\nZ,6,4\nV,4,3\n"
    name = row.split(",", maxsplit=1)[0]
    assert imported(f"{text}{row}\n").lines[-1] == (
        f"Left out: 1 row named {name} (line 6, {what} of all others; --keep-means keeps it)."
    )
    assert len(imported(f"{text}{row}\n", keep_means=True).visits) == 5
    assert len(imported(text + row.replace(",1", ",3") + "\n").visits) == 5


def test_a_last_row_without_a_name_that_sums_up_is_left_out() -> None:
    text = "id,a,b\nP1,3,6\nP2,2,5\nP3,4,7\n,{}\n"
    for sums in ("3,6", "9,18"):
        scores = imported(text.format(sums))
        assert scores.lines[-1] == "Left out: 1 row without a name (line 5, a summary)."
    with pytest.raises(TableError, match="line 5: a subject must have a name"):
        imported(text.format("3,5"))


@pytest.mark.parametrize(
    ("name", "numbers", "why"),
    [
        ("Difference", (9, 9, 9, 9), ""),
        ("z_a", (9, 9, 9, 9), ""),
        ("b_norm", (9, 9, 9, 9), ""),
        ("a over b", (-2, 3, -1, 2), " (the difference of a, b; --keep-means keeps it)"),
    ],
)
def test_what_is_made_of_other_columns_is_no_condition(
    name: str, numbers: tuple[int, ...], why: str
) -> None:
    rows = zip((1, 5, 3, 6), (3, 2, 4, 4), numbers, strict=True)
    text = f"id,a,b,{name}\n" + "".join(
        f"P{row},{a},{b},{c}\n" for row, (a, b, c) in enumerate(rows)
    )
    scores = imported(text)
    assert scores.conditions == ("a", "b")
    assert scores.lines[-1] == f"Left out: column {name}{why}."


def test_a_difference_that_may_be_another_column_is_left_out_nowhere() -> None:
    rows = [
        f"P{at},{a},{a - b},{b}\n" for at, (a, b) in enumerate(((1, 3), (5, 2), (3, 4), (6, 4)))
    ]
    assert imported("id,a,effect,b\n" + "".join(rows)).conditions == ("a", "effect", "b")


@pytest.mark.parametrize("name", ["z", "delta", "norm", "z_c", "paper"])
def test_conditions_that_are_made_of_no_other_column_are_kept(name: str) -> None:
    assert imported(f"id,a,b,{name}\nP1,1,3,2\nP2,5,2,4\nP3,3,4,1\n").conditions == ("a", "b", name)
