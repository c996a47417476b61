"""Statistics of the score table, under each reading of its withheld scores."""

from collections.abc import Mapping
from dataclasses import dataclass

from analysis.estimates import NotEstimable
from analysis.loading.score_table import ScoreTable
from analysis.statistics.additive import (
    AdditiveEffects,
    GainHeterogeneity,
    additive_effects,
    gain_heterogeneity,
)
from analysis.statistics.omnibus import Friedman, SkillingsMack, friedman, skillings_mack
from analysis.statistics.signed_rank import PairwiseTest, pairwise_signed_ranks
from analysis.statistics.table4 import Table4, table4
from analysis.statistics.two_way import IntraclassCorrelation, intraclass_correlation


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


@dataclass(frozen=True, kw_only=True)
class TableStatistics:
    """The statistics of one table; all but `readings` are computed from the first reading."""

    readings: tuple[Reading, ...]
    icc_subjects: IntraclassCorrelation | NotEstimable
    icc_conditions: IntraclassCorrelation | NotEstimable
    additive: AdditiveEffects | NotEstimable
    heterogeneity: GainHeterogeneity | NotEstimable

    @property
    def main(self) -> Reading:
        """The reading that leaves missing scores missing."""
        return self.readings[0]


def table_statistics(readings: Mapping[str, ScoreTable]) -> TableStatistics:
    """Return the statistics of a table, given by reading of its withheld scores."""
    table = readings["missing"]
    return TableStatistics(
        readings=tuple(reading(name, filled) for name, filled in readings.items()),
        icc_subjects=intraclass_correlation(table, target="subjects"),
        icc_conditions=intraclass_correlation(table, target="conditions"),
        additive=additive_effects(table),
        heterogeneity=gain_heterogeneity(table),
    )


def reading(name: str, table: ScoreTable) -> Reading:
    """Return the tests of the conditions of one table, a reading of that name."""
    return Reading(
        name=name,
        table4=table4(table),
        friedman=friedman(table),
        skillings_mack=None if table.is_complete else skillings_mack(table),
        pairwise=pairwise_signed_ranks(table),
    )
