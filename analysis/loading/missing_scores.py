"""Why a cell of Table 4 has no score: not every such cell may be read as an answer."""

from collections import Counter
from collections.abc import Iterable, Mapping
from enum import StrEnum

import numpy as np
import pandas as pd

from analysis.estimates import BoolArray
from analysis.loading.score_table import ScoreTable
from analysis.loading.sessions import is_scored


class Why(StrEnum):
    """Why no trial of a subject under a condition has a score that counts."""

    WITHHELD = "withheld"
    BLANK = "blank"
    EXCLUDED = "excluded"
    NOT_REACHED = "not reached"


EmptyCells = Mapping[tuple[int, int], Why]
"""By row and column of the table, every cell without a score and nothing else."""

MARKS = {Why.WITHHELD: "–", Why.BLANK: "–", Why.EXCLUDED: "×", Why.NOT_REACHED: "○"}
"""What stands in such a cell where people read the table."""

LABELS = {
    Why.WITHHELD: "not given",
    Why.BLANK: "blank",
    Why.EXCLUDED: "excluded",
    Why.NOT_REACHED: "not reached",
}

_READ = frozenset({Why.WITHHELD, Why.BLANK})
_TOLD = {
    Why.WITHHELD: "not given, as the answer disagreed with the expectation",
    Why.BLANK: "blank in the published table",
    Why.EXCLUDED: "without a score, as the trials are excluded",
    Why.NOT_REACHED: "without a trial, as the session did not get there",
}


def empty_cells(table: ScoreTable, counted: pd.DataFrame, excluded: pd.DataFrame) -> EmptyCells:
    """Return why each cell without a score has none.

    An answered trial that counts and has no score explains its cell before an excluded one does.

    Args:
        table: the scores.
        counted: the trials that count.
        excluded: the trials taken out by the operator or by a rule.
    """
    published = counted["trial_kind"].eq("published")
    known = dict.fromkeys(_scored_cells(excluded), Why.EXCLUDED)
    known |= dict.fromkeys(_scored_cells(counted[published]), Why.BLANK)
    known |= dict.fromkeys(_scored_cells(counted[~published]), Why.WITHHELD)
    return {
        (int(row), int(column)): known.get(
            (table.subjects[row], table.conditions[column]), Why.NOT_REACHED
        )
        for row, column in np.argwhere(~table.given)
    }


def _scored_cells(trials: pd.DataFrame) -> Iterable[tuple[str, str]]:
    scored = trials[is_scored(trials)]
    return zip(scored["participant"], scored["condition"], strict=True)


def withheld(table: ScoreTable, empty: EmptyCells) -> BoolArray:
    """Return which cells may be read as no effect or as the lowest score: see `missing_scores`."""
    found = np.zeros(table.scores.shape, dtype=np.bool_)
    for cell, why in empty.items():
        found[cell] = why in _READ
    return found


def marks(empty: EmptyCells) -> dict[tuple[int, int], str]:
    """Return what stands in each cell without a score."""
    return {cell: MARKS[why] for cell, why in empty.items()}


def unscored(table: ScoreTable) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the subjects and the conditions without any score."""
    given = table.given
    return (
        tuple(who for row, who in enumerate(table.subjects) if not given[row].any()),
        tuple(name for column, name in enumerate(table.conditions) if not given[:, column].any()),
    )


def withheld_beside_scores(trials: pd.DataFrame) -> list[str]:
    """Return in a line how many trials lack a score in cells that have one, if there are any."""
    counted = trials[is_scored(trials)]
    given = counted["score"].notna()
    cell = [counted["participant"], counted["condition"]]
    partly = counted["condition"][given.groupby(cell).transform("any") & ~given]
    if partly.empty:
        return []
    by_condition = ", ".join(f"{name} {n}" for name, n in Counter(partly).items())
    return [
        f"Not given in cells with other scores: {len(partly)} of {len(counted)} scores "
        f"({by_condition}). The mean of the others stands in such a cell under every reading; it "
        "is too high if weaker changes were not noticed."
    ]


def notes(table: ScoreTable, empty: EmptyCells) -> list[str]:
    """Return what stands under Table 4: each mark, how often, and who or what has no score."""
    causes = Counter(empty.values())
    readable = _READ if table.given.any() else frozenset()
    said = [
        f"{MARKS[why]} {_TOLD[why]}: {'1 cell' if causes[why] == 1 else f'{causes[why]} cells'}, "
        + ("also read as 0 and as the lowest score." if why in readable else "missing throughout.")
        for why in Why
        if causes[why]
    ]
    subjects, conditions = unscored(table)
    if subjects:
        said.append(f"No score at all, and not among the subjects analysed: {', '.join(subjects)}.")
    if conditions:
        said.append(
            f"Scored by nobody, and not among the conditions analysed: {', '.join(conditions)}."
        )
    return said
