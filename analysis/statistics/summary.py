"""Statistics of the score table, under each reading of its withheld scores."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analysis.estimates import FloatArray, NotEstimable, ScoreTable
from analysis.statistics import additive as effects
from analysis.statistics.omnibus import Friedman, SkillingsMack, friedman, skillings_mack
from analysis.statistics.signed_rank import PairwiseTest, pairwise_signed_ranks
from analysis.statistics.two_way import IntraclassCorrelation, intraclass_correlation

# Table 4 of the paper: scores by subject and condition, with the means of both.


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


@dataclass(frozen=True, kw_only=True)
class Reading:
    """Table 4 under one reading of its withheld scores, with the tests of its conditions.

    `skillings_mack` is None if no score is missing, when it equals Friedman's test.
    """

    name: str
    table4: Table4
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


@dataclass(frozen=True, kw_only=True, eq=False)
class TableStatistics:
    """The statistics of one table, by reading of its withheld scores; computed when asked for.

    All but `readings` are of the first reading, which leaves missing scores missing.
    """

    tables: Mapping[str, ScoreTable]

    @cached_property
    def main(self) -> Reading:
        """The first reading."""
        return reading(*next(iter(self.tables.items())))

    @cached_property
    def readings(self) -> tuple[Reading, ...]:
        others = list(self.tables.items())[1:]
        return (self.main, *(reading(*named) for named in others))

    @property
    def _table(self) -> ScoreTable:
        return next(iter(self.tables.values()))

    @cached_property
    def icc_subjects(self) -> IntraclassCorrelation | NotEstimable:
        """How reliably scores measure a subject."""
        return intraclass_correlation(self._table, target="subjects")

    @cached_property
    def icc_conditions(self) -> IntraclassCorrelation | NotEstimable:
        """How reliably scores measure a condition."""
        return intraclass_correlation(self._table, target="conditions")

    @cached_property
    def additive(self) -> effects.AdditiveEffects | NotEstimable:
        """Effects of conditions and subjects."""
        return effects.additive_effects(self._table)

    @cached_property
    def heterogeneity(self) -> effects.GainHeterogeneity | NotEstimable:
        """Differences between subjects in the size of the conditions' effects."""
        return effects.gain_heterogeneity(self._table)


def reading(name: str, table: ScoreTable) -> Reading:
    """Return the tests of the conditions of one table, a reading of that name."""
    return Reading(
        name=name,
        table4=table4(table),
        friedman=friedman(table),
        skillings_mack=None if table.is_complete else skillings_mack(table),
        pairwise=pairwise_signed_ranks(table),
    )
