"""Statistics of a table with a row per subject and a column per condition."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analysis.estimates import FloatArray, NotEstimable, ScoreTable
from analysis.statistics.omnibus import Friedman, SkillingsMack, friedman, skillings_mack
from analysis.statistics.signed_rank import PairwiseTest, pairwise_signed_ranks

# Table 4 of the paper: scores by subject and condition, with the means of both.


@dataclass(frozen=True, kw_only=True)
class Table4:
    """The table and its means over the scores given; NaN where there are none.

    `catch`, shape (subjects,), has the mean scores of touches at 0 V, which no mean includes; None
    where none was scored.
    """

    table: ScoreTable
    row_means: FloatArray
    column_means: FloatArray
    grand_mean: float
    catch: FloatArray | None = None

    @property
    def catch_mean(self) -> float:
        """The mean of `catch` over the subjects."""
        return math.nan if self.catch is None else _mean_given(self.catch)


def table4(table: ScoreTable, catch: FloatArray | None = None) -> Table4:
    """Return the means of `table`, with the scores of catch trials beside them."""
    return Table4(
        table=table,
        row_means=np.array([_mean_given(row) for row in table.scores]),
        column_means=np.array([_mean_given(column) for column in table.scores.T]),
        grand_mean=_mean_given(table.scores),
        catch=catch,
    )


def _mean_given(scores: FloatArray) -> float:
    given = scores[~np.isnan(scores)]
    return float(given.mean()) if given.size else math.nan


@dataclass(frozen=True, kw_only=True, eq=False)
class ConditionTests:
    """The tests of the conditions of one table, of mean responses or of scores.

    `skillings_mack` is None if no cell is empty, when it equals Friedman's test.
    """

    table: ScoreTable
    friedman: Friedman | NotEstimable
    skillings_mack: SkillingsMack | NotEstimable | None
    pairwise: tuple[PairwiseTest, ...]

    @property
    def omnibus(self) -> Friedman | SkillingsMack | NotEstimable:
        """The test of all conditions."""
        return self.friedman if self.skillings_mack is None else self.skillings_mack

    @property
    def omnibus_p(self) -> float | NotEstimable:
        """Its p, exact or by shuffling."""
        return self.omnibus if isinstance(self.omnibus, NotEstimable) else self.omnibus.best_p

    @cached_property
    def means(self) -> FloatArray:
        """The mean of each condition; NaN where there is none."""
        return table4(self.table).column_means


def condition_tests(table: ScoreTable) -> ConditionTests:
    """Return the tests of the conditions of `table`."""
    return ConditionTests(
        table=table,
        friedman=friedman(table),
        skillings_mack=None if table.is_complete else skillings_mack(table),
        pairwise=pairwise_signed_ranks(table),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class TableStatistics:
    """The statistics of a table of scores, each computed when it is asked for; see `Table4`."""

    table: ScoreTable
    catch: FloatArray | None = None

    @cached_property
    def table4(self) -> Table4:
        """The table with its means."""
        return table4(self.table, self.catch)

    @cached_property
    def score_tests(self) -> ConditionTests:
        """The tests of its conditions, which compare only what was scored."""
        return condition_tests(self.table)
