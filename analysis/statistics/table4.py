"""Table 4 of the paper: scores by subject and condition, with the means of both."""

import math
from dataclasses import dataclass

import numpy as np

from analysis.estimates import FloatArray
from analysis.loading.score_table import ScoreTable


@dataclass(frozen=True, kw_only=True)
class Table4:
    """The table and its means over the scores given; NaN where there are none."""

    table: ScoreTable
    row_means: FloatArray
    column_means: FloatArray
    grand_mean: float


def table4(table: ScoreTable) -> Table4:
    """Return Table 4 of `table`."""
    return Table4(
        table=table,
        row_means=np.array([_mean_given(row) for row in table.scores]),
        column_means=np.array([_mean_given(column) for column in table.scores.T]),
        grand_mean=_mean_given(table.scores),
    )


def _mean_given(scores: FloatArray) -> float:
    given = scores[~np.isnan(scores)]
    return float(given.mean()) if given.size else math.nan
