"""The published table: its numbers, and what is said about tables that cannot be used."""

from pathlib import Path

import numpy as np
import pytest

from analysis.loading.published import (
    MOST_CONDITIONS,
    MOST_SUBJECTS,
    TableError,
    mean_column,
    published_table,
)
from analysis.report.table4_text import table4_csv, table4_lines
from analysis.statistics.omnibus import Friedman, friedman
from analysis.statistics.summary import table4

PUBLISHED = (Path(__file__).parents[2] / "data" / "published_scores.csv").read_text()


def test_the_averages_are_those_of_the_paper() -> None:
    result = table4(published_table(PUBLISHED))
    assert table4_lines(result)[-1] == ["average", "8.44", "8.89", "9.67", "8.33", "6.22", "8.31"]


def test_the_comprehensive_scores_are_those_of_the_paper() -> None:
    result = table4(published_table(PUBLISHED))
    assert result.row_means == pytest.approx([8.6, 9, 7, 9.6, 7.8, 9, 8.2, 8, 7.6])


def test_friedmans_test_of_the_published_table() -> None:
    test = friedman(published_table(PUBLISHED))
    assert isinstance(test, Friedman)
    assert (round(test.chi2, 4), test.df) == (21.4521, 4)


def test_a_blank_cell_is_a_missing_score_and_no_zero() -> None:
    table = published_table(PUBLISHED.replace("1,10,8", "1,,8"))
    assert np.isnan(table.scores[0, 0])
    result = table4(table)
    assert result.row_means[0] == pytest.approx((8 + 10 + 10 + 5) / 4)
    assert table4_csv(result).splitlines()[1] == "1,,8,10,10,5,8.25"


def test_a_byte_order_mark_and_other_line_ends_do_no_harm() -> None:
    text = "\ufeff" + PUBLISHED.replace("\n", "\r\n")
    assert np.array_equal(
        published_table(PUBLISHED.replace("\n", "\r")).scores, published_table(PUBLISHED).scores
    )
    assert np.array_equal(published_table(text).scores, published_table(PUBLISHED).scores)


def with_means(column: str | None, row: str | None) -> str:
    """The published table with its means as printed, under these names."""
    lines = table4_lines(table4(published_table(PUBLISHED)))
    named = [[*lines[0][:-1], column or ""], *lines[1:-1], [row or "", *lines[-1][1:]]]
    wanted = named if row else named[:-1]
    return "".join(",".join(line if column else line[:-1]) + "\n" for line in wanted)


@pytest.mark.parametrize(
    ("column", "row", "message"),
    [
        ("Comprehensive", None, "line 1, column Comprehensive: holds no scores; remove the column"),
        (
            None,
            "AVERAGE",
            "line 11: the row 'AVERAGE' holds no scores .*; remove the row",
        ),
        ("total", "mean", "line 1, column total"),
        (
            "overall",
            None,
            "column overall: is the mean of all other columns; remove the column, or add --keep",
        ),
        (
            None,
            "all-9",
            "line 11: the row 'all-9' is the mean of all others; remove the row, or add --keep",
        ),
        ("overall", "all-9", "column overall: is the mean of all other columns"),
    ],
)
def test_printed_means_are_not_taken_for_scores(
    column: str | None, row: str | None, message: str
) -> None:
    with pytest.raises(TableError, match=message):
        published_table(with_means(column, row))


def test_scores_that_are_the_mean_of_all_others_can_be_kept() -> None:
    assert published_table(with_means("overall", None), keep_means=True).conditions[-1] == "overall"
    assert published_table(with_means(None, "all-9"), keep_means=True).subjects[-1] == "all-9"
    with pytest.raises(TableError, match="column total: holds no scores"):
        published_table(with_means("total", None), keep_means=True)


def test_our_own_table_4_is_refused_and_read_without_its_means() -> None:
    written = table4_csv(table4(published_table(PUBLISHED)))
    with pytest.raises(TableError, match="column mean"):
        published_table(written)
    rows = [line.rpartition(",")[0] for line in written.splitlines()[:-1]]
    assert np.array_equal(
        published_table("\n".join(rows)).scores, published_table(PUBLISHED).scores
    )


@pytest.mark.parametrize(
    "scores",
    [
        [[6, 6, 6, 6, 6]] * 5,
        [[3, 3, 3, 3], [4, 4, 4, 4], [5, 5, 5, 5]],
        [[4, 7, 7, 6], [1, 4, 4, 3]],
        [[5, 7, 6], [2, 4, 3], [1, 3, 2]],
        [[np.nan] * 4] * 4,
        [[4, 7, 7, 6], [1, 4, 4, 3], [3, 3, 0, np.nan]],
    ],
    ids=["all alike", "rows alike", "two rows", "two others", "none given", "one missing"],
)
def test_scores_that_meet_their_mean_by_chance_are_scores(scores: list[list[float]]) -> None:
    assert mean_column(np.array(scores)) is None


@pytest.mark.parametrize(
    "scores",
    [
        [[4, 7, 7, 6], [1, 4, 4, 3], [3, 3, 0, 2]],
        [[5, 7, 7, 6.33]],
        [[5, 7, np.nan, 6], [2, 5, 3, 3.33], [np.nan] * 4],
    ],
    ids=["three rows", "a fraction", "missing scores"],
)
def test_a_column_of_means_is_found(scores: list[list[float]]) -> None:
    assert mean_column(np.array(scores)) == 3


def test_the_models_conditions_are_known_in_any_case() -> None:
    table = published_table("Subject, FREQUENCY ,Voltage,Colour\n1,3,4,5\n")
    assert table.conditions == ("frequency", "voltage", "Colour")
    with pytest.raises(TableError, match="each condition must be named once, got 'voltage' 2"):
        published_table("subject,voltage,Voltage\n1,3,4\n")


def test_subjects_are_pseudonyms_as_in_sessions() -> None:
    names = ("1", "S1", "a-b_3", "NUL1", "COM10")
    table = published_table("subject,a\n" + "".join(f"{name},3\n" for name in names))
    assert table.subjects == names


@pytest.mark.parametrize(
    "name", ["../../x1", "=cmd1", "Р01", "受试者1", "７", "a b 3", "com1", "LPT9", "1" * 33]
)
def test_other_subjects_are_refused_with_the_rule(name: str) -> None:
    with pytest.raises(TableError, match=r"line 2: .* a digit in it, such as P01, .*; number"):
        published_table(f"subject,a\n{name},3\n")


def test_the_guard_of_an_exported_name_is_taken_off_again() -> None:
    table = published_table("subject,'=a,'s,'-b\n1,3,4,5\n2,6,7,8\n")
    assert (table.conditions, table.subjects) == (("=a", "'s", "-b"), ("1", "2"))
    lines = table4_csv(table4(table)).splitlines()
    again = published_table("\n".join(line.rpartition(",")[0] for line in lines[:-1]))
    assert (again.conditions, again.subjects) == (table.conditions, table.subjects)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (PUBLISHED.replace("3,8", "3,11", 1), r"line 4, column frequency: .* \[0, 10\], got 11"),
        (PUBLISHED.replace("3,8", "3,x", 1), "line 4, column frequency: .* blank, got 'x'"),
        (PUBLISHED.replace("3,8", "3,nan", 1), "line 4, column frequency: .* got 'nan'"),
        (PUBLISHED.replace("\n2,", "\n1,"), "each subject must be named once, got '1' 2 times"),
        (PUBLISHED.replace("voltage", "frequency"), "each condition must be named once"),
        (PUBLISHED.replace("1,10,8,10,10,5", "1,10,8"), "line 2: must have 6 cells .* got 3"),
        (PUBLISHED.replace("subject,", "who,"), "first column must be 'subject', got 'who'"),
        (PUBLISHED.replace("3,8", "3,1_0", 1), "line 4, column frequency: .* got '1_0'"),
        (PUBLISHED.replace("3,8", "3,-1", 1), r"line 4, column frequency: .* \[0, 10\], got -1"),
        (PUBLISHED.replace("\n3,", "\n ,"), "line 4: a subject must have a name, got ' '"),
        (PUBLISHED.replace("pressure", ""), "every condition must have a name"),
        (
            "subject,a\n1," + "9" * 200_000,
            "line 2: a cell must have at most 131072 characters, got more; if a quotation mark",
        ),
        ("subject," + "x" * 65 + "\n1,3\n", "line 1: .* at most 64 characters, got 65, 'x"),
        ("subject,a\n" + "1" * 5000 + ",3\n", "line 2: .* at most 64 .* got 5000, '1{20}'...$"),
        ("subject,vol\x1btage\n1,3\n", r"line 1: .* no control .* got 'vol\\x1btage'"),
        ("subject,a\nP\u202e1,3\n", r"line 2: .* direction of writing, got 'P\\u202e1'"),
        (
            "subject,a\n1,3\nAnna Schmidt,4\n",
            "line 3: .* digit in it, .* got 'Anna Schmidt'; number",
        ),
        ("\n\nsubject,a\n\n1,3\n2,x\n", "scores.csv, line 6, column a: .* got 'x'"),
        ('subject,"a\nb"\n1,x\n', "line 3, column a\nb: .* got 'x'"),
        ("\nwho,a\n1,3\n", "line 2: the first column must be 'subject', got 'who'"),
        (PUBLISHED.replace(",", ";"), "line 1: the cells are separated by semicolons; .* commas"),
        (PUBLISHED.replace(",", "\t"), "line 1: the cells are separated by tabs; .* commas"),
        ('subject,"a,b\n1,3,4\n', "line 1: a quotation mark is opened and never closed"),
        ('subject,a\n\n1,"3\n2,4\n', "line 3: a quotation mark is opened and never closed"),
        ('subject,a\n1,"3"4\n', "line 2: cannot be read as CSV"),
        ("", "must have a header and at least one row"),
        ("subject,voltage\n", "must have a header and at least one row"),
    ],
)
def test_a_table_that_cannot_be_used_is_refused(text: str, message: str) -> None:
    with pytest.raises(TableError, match=message):
        published_table(text)


def test_a_table_beyond_the_limits_is_refused() -> None:
    wide = [",".join(["subject", *(f"c{number}" for number in range(MOST_CONDITIONS + 1))])]
    with pytest.raises(TableError, match="line 1: must have at most 100 conditions, got 101; imp"):
        published_table("\n".join([*wide, "P1" + MOST_CONDITIONS * ",1" + ",2"]))
    rows = (f"P{number},1,2" for number in range(MOST_SUBJECTS + 1))
    with pytest.raises(TableError, match="must have at most 100000 subjects, got more; import"):
        published_table("\n".join(["subject,a,b", *rows]))
