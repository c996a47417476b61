"""Everything that is computed from the table of scores alone."""

from dataclasses import dataclass

import numpy as np

from analysis.estimates import NotEstimable
from analysis.loading.score_table import BoolArray, ScoreTable
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
class MissingScores:
    """The same table with withheld scores left missing, as 0, and as the lowest score observed."""

    missing: ScoreTable
    zero: ScoreTable
    lowest: ScoreTable


def missing_scores(table: ScoreTable, withheld: BoolArray) -> MissingScores | NotEstimable:
    """Return the table under each reading of its withheld scores, or why there is none.

    A score is not given when the answer disagrees with the expectation (paper, section 5.2). It
    may say nothing, no effect (0), or an effect no stronger than the weakest reported. A cell
    that is empty because nobody was asked, or because its trials do not count, says nothing.

    Parameters:
        table: the scores.
        withheld: shape (subjects, conditions), which cells without a score have an answer that
            disagreed; the others stay missing in every reading.

    Raises:
        ValueError: another shape than the table's, or a cell that has a score.
    """
    if withheld.shape != table.scores.shape:
        raise ValueError(f"withheld must have shape {table.scores.shape}, got {withheld.shape}")
    if (withheld & table.given).any():
        scored = int((withheld & table.given).sum())
        raise ValueError(f"a withheld cell must have no score, got {scored} with one")
    if not table.given.any():
        return NotEstimable(reason="no score was given, so that there is no lowest one")
    return MissingScores(
        missing=table,
        zero=_filled(table, withheld, 0.0),
        lowest=_filled(table, withheld, float(table.scores[table.given].min())),
    )


def _filled(table: ScoreTable, cells: BoolArray, score: float) -> ScoreTable:
    return ScoreTable(
        subjects=table.subjects,
        conditions=table.conditions,
        scores=np.where(cells, score, table.scores),
    )


@dataclass(frozen=True, kw_only=True)
class Reading:
    """Table 4 with its withheld scores read in one way, and what follows for the conditions.

    `skillings_mack` is None where no score is missing: it is Friedman's test then.
    """

    name: str
    table4: Table4
    friedman: Friedman | NotEstimable
    skillings_mack: SkillingsMack | NotEstimable | None
    pairwise: tuple[PairwiseTest, ...]


@dataclass(frozen=True, kw_only=True)
class TableStatistics:
    """The statistics of one table.

    `readings` has the table as it is and, if scores are missing, with the withheld ones as 0 and
    as the lowest score observed; the first one is what everything else is computed from.
    """

    readings: tuple[Reading, ...]
    icc_subjects: IntraclassCorrelation | NotEstimable
    icc_conditions: IntraclassCorrelation | NotEstimable
    additive: AdditiveEffects | NotEstimable
    heterogeneity: GainHeterogeneity | NotEstimable

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
    if table.is_complete or isinstance(read, NotEstimable):
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
