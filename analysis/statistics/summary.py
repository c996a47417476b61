"""Statistics of the score table, under each reading of its withheld scores."""

from dataclasses import dataclass, replace

import numpy as np

from analysis.estimates import BoolArray, NotEstimable
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


def withheld_readings(table: ScoreTable, withheld: BoolArray) -> dict[str, ScoreTable]:
    """Return the table with withheld scores left "missing", as "zero" and as the "lowest" score.

    A score is withheld when the answer disagrees with the expectation (paper, section 5.2). This
    can mean nothing, no effect (0), or an effect no stronger than the weakest reported. A cell
    that is empty for another reason stays missing. A complete table, and one without any score,
    has the first reading only.

    Parameters:
        table: the scores.
        withheld: shape (subjects, conditions), the empty cells whose answer disagreed.

    Raises:
        ValueError: a shape that differs from the table's, or a cell that has a score.
    """
    if withheld.shape != table.scores.shape:
        raise ValueError(f"withheld must have shape {table.scores.shape}, got {withheld.shape}")
    if (withheld & table.given).any():
        scored = int((withheld & table.given).sum())
        raise ValueError(f"a withheld cell must have no score, got {scored} with one")
    if table.is_complete or not table.given.any():
        return {"missing": table}
    fills = {"missing": np.nan, "zero": 0.0, "lowest": table.scores[table.given].min()}
    return {
        name: replace(table, scores=np.where(withheld, score, table.scores))
        for name, score in fills.items()
    }


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


def table_statistics(table: ScoreTable, withheld: BoolArray) -> TableStatistics:
    """Return the statistics of the table; for `withheld` see `withheld_readings`."""
    readings = withheld_readings(table, withheld)
    return TableStatistics(
        readings=tuple(_reading(name, filled) for name, filled in readings.items()),
        icc_subjects=intraclass_correlation(table, target="subjects"),
        icc_conditions=intraclass_correlation(table, target="conditions"),
        additive=additive_effects(table),
        heterogeneity=gain_heterogeneity(table),
    )


def _reading(name: str, table: ScoreTable) -> Reading:
    return Reading(
        name=name,
        table4=table4(table),
        friedman=friedman(table),
        skillings_mack=None if table.is_complete else skillings_mack(table),
        pairwise=pairwise_signed_ranks(table),
    )
