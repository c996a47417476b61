"""Three ways to read a score that was not given."""

from dataclasses import dataclass

import numpy as np

from analysis.no_answer import NoAnswer
from analysis.scores import BoolArray, ScoreTable


@dataclass(frozen=True, kw_only=True)
class MissingScores:
    """The same table with withheld scores left missing, as 0, and as the lowest score observed."""

    missing: ScoreTable
    zero: ScoreTable
    lowest: ScoreTable


def missing_scores(table: ScoreTable, withheld: BoolArray) -> MissingScores | NoAnswer:
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
        return NoAnswer(reason="no score was given, so that there is no lowest one")
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
