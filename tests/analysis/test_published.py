"""The published table: its numbers, and what is said about tables that cannot be used."""

from pathlib import Path

import numpy as np
import pytest

from analysis.published import TableError, published_table
from analysis.statistics.friedman import Friedman, friedman
from analysis.table4 import table4, table4_csv

PUBLISHED = (Path(__file__).parents[1] / "data" / "published_scores.csv").read_text()


def test_the_averages_are_those_of_the_paper() -> None:
    result = table4(published_table(PUBLISHED))
    assert result.lines()[-1] == ["average", "8.44", "8.89", "9.67", "8.33", "6.22", "8.31"]


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


def test_a_byte_order_mark_and_windows_line_ends_do_no_harm() -> None:
    text = "\ufeff" + PUBLISHED.replace("\n", "\r\n")
    assert np.array_equal(published_table(text).scores, published_table(PUBLISHED).scores)


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
        ("subject,a\n1," + "9" * 200_000, "cannot be read as CSV"),
        ("", "must have a header and at least one row"),
        ("subject,voltage\n", "must have a header and at least one row"),
    ],
)
def test_a_table_that_cannot_be_used_is_refused(text: str, message: str) -> None:
    with pytest.raises(TableError, match=message):
        published_table(text)
