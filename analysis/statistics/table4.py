"""Table 4 of the paper: scores by subject and condition, with the means of both."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from analysis.cells import csv_cell, csv_text
from analysis.estimates import FloatArray
from analysis.loading.score_table import ScoreTable

COMPREHENSIVE = "comprehensive"
AVERAGE = "average"
MISSING = ""


@dataclass(frozen=True, kw_only=True)
class Table4:
    """The table and its means over the scores that were given; NaN where none was."""

    table: ScoreTable
    row_means: FloatArray
    column_means: FloatArray
    grand_mean: float

    def lines(
        self, missing: str = MISSING, marks: Mapping[tuple[int, int], str] = MappingProxyType({})
    ) -> list[list[str]]:
        """Return header, a row per subject and the row of averages, to two decimals.

        Whole scores are written as such; `missing` stands where no score was given, unless
        `marks` has something else for that row and column.
        """
        names = ["subject", *self.table.conditions, COMPREHENSIVE]
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
                zip(self.table.subjects, self.table.scores, self.row_means, strict=True)
            )
        ]
        means = (_mean(mean, missing) for mean in self.column_means)
        return [names, *rows, [AVERAGE, *means, _mean(self.grand_mean, missing)]]


def table4(table: ScoreTable) -> Table4:
    """Return Table 4 of `table`; every mean is of the scores that were given."""
    return Table4(
        table=table,
        row_means=np.array([_mean_given(row) for row in table.scores]),
        column_means=np.array([_mean_given(column) for column in table.scores.T]),
        grand_mean=_mean_given(table.scores),
    )


def table4_csv(result: Table4) -> str:
    """Return the table as CSV, a missing score as an empty cell."""
    header, *rows = result.lines()
    return csv_text([csv_cell(name) for name in header], rows)


def _mean_given(scores: FloatArray) -> float:
    given = scores[~np.isnan(scores)]
    return float(given.mean()) if given.size else math.nan


def _score(score: float, missing: str) -> str:
    if math.isnan(score):
        return missing
    return f"{score:.0f}" if score == round(score) else f"{score:.2f}"


def _mean(mean: float, missing: str) -> str:
    return missing if math.isnan(mean) else f"{mean:.2f}"
