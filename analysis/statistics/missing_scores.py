"""Three ways to read a score that was not given."""

from dataclasses import dataclass

import numpy as np

from analysis.no_answer import NoAnswer
from analysis.scores import ScoreTable


@dataclass(frozen=True, kw_only=True)
class MissingScores:
    """The same table with missing scores left missing, as 0, and as the lowest score observed."""

    missing: ScoreTable
    zero: ScoreTable
    lowest: ScoreTable


def missing_scores(table: ScoreTable) -> MissingScores | NoAnswer:
    """Return the table under each reading of its missing scores, or why there is none.

    A score is not given when the answer disagrees with the expectation (paper, section 5.2). It
    may say nothing, no effect (0), or an effect no stronger than the weakest reported.
    """
    if not table.given.any():
        return NoAnswer(reason="no score was given, so that there is no lowest one")
    return MissingScores(
        missing=table,
        zero=_filled(table, 0.0),
        lowest=_filled(table, float(table.scores[table.given].min())),
    )


def _filled(table: ScoreTable, score: float) -> ScoreTable:
    return ScoreTable(
        subjects=table.subjects,
        conditions=table.conditions,
        scores=np.where(table.given, table.scores, score),
    )
