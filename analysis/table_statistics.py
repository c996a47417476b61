"""Everything that is computed from the table of scores alone."""

from dataclasses import dataclass

from analysis.no_answer import NoAnswer
from analysis.scores import BoolArray, ScoreTable
from analysis.statistics.additive import (
    AdditiveEffects,
    GainHeterogeneity,
    additive_effects,
    gain_heterogeneity,
)
from analysis.statistics.friedman import Friedman, friedman
from analysis.statistics.icc import IntraclassCorrelation, intraclass_correlation
from analysis.statistics.missing_scores import missing_scores
from analysis.statistics.signed_rank import PairwiseTest, pairwise_signed_ranks
from analysis.statistics.skillings_mack import SkillingsMack, skillings_mack
from analysis.table4 import Table4, table4


@dataclass(frozen=True, kw_only=True)
class Reading:
    """Table 4 with its withheld scores read in one way, and what follows for the conditions.

    `skillings_mack` is None where no score is missing: it is Friedman's test then.
    """

    name: str
    table4: Table4
    friedman: Friedman | NoAnswer
    skillings_mack: SkillingsMack | NoAnswer | None
    pairwise: tuple[PairwiseTest, ...]


@dataclass(frozen=True, kw_only=True)
class TableStatistics:
    """The statistics of one table.

    `readings` has the table as it is and, if scores are missing, with the withheld ones as 0 and
    as the lowest score observed; the first one is what everything else is computed from.
    """

    readings: tuple[Reading, ...]
    icc_subjects: IntraclassCorrelation | NoAnswer
    icc_conditions: IntraclassCorrelation | NoAnswer
    additive: AdditiveEffects | NoAnswer
    heterogeneity: GainHeterogeneity | NoAnswer

    @property
    def main(self) -> Reading:
        """The reading that leaves missing scores missing."""
        return self.readings[0]


def table_statistics(table: ScoreTable, withheld: BoolArray) -> TableStatistics:
    """Return the statistics of the table; missing scores stay missing but for the readings.

    Parameters:
        table: the scores.
        withheld: shape (subjects, conditions), the empty cells that the readings fill in.
    """
    return TableStatistics(
        readings=tuple(_reading(name, read) for name, read in _read(table, withheld)),
        icc_subjects=intraclass_correlation(table, target="subjects"),
        icc_conditions=intraclass_correlation(table, target="conditions"),
        additive=additive_effects(table),
        heterogeneity=gain_heterogeneity(table),
    )


def _read(table: ScoreTable, withheld: BoolArray) -> list[tuple[str, ScoreTable]]:
    read = missing_scores(table, withheld)
    if table.is_complete or isinstance(read, NoAnswer):
        return [("missing", table)]
    return [("missing", read.missing), ("zero", read.zero), ("lowest", read.lowest)]


def _reading(name: str, table: ScoreTable) -> Reading:
    return Reading(
        name=name,
        table4=table4(table),
        friedman=friedman(table),
        skillings_mack=None if table.is_complete else skillings_mack(table),
        pairwise=pairwise_signed_ranks(table),
    )
