"""Why a cell of Table 4 has no score: not every such cell may be read as an answer."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace
from enum import StrEnum

import numpy as np
import pandas as pd

from analysis.estimates import FloatArray
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


def withheld(table: ScoreTable, trials: pd.DataFrame) -> FloatArray:
    """Return the share of each cell's scores that was not given, shape (subjects, conditions).

    Blank cells of a published table count. Cells without a trial that counts have a share of 0.
    """
    counted = trials[is_scored(trials)]
    cell = [counted["participant"], counted["condition"]]
    shares = counted["score"].isna().groupby(cell).mean().unstack()
    return shares.reindex(index=table.subjects, columns=table.conditions).fillna(0.0).to_numpy()


def readings(table: ScoreTable, trials: pd.DataFrame, least: float = 0.0) -> dict[str, ScoreTable]:
    """Return the table with withheld scores left "missing", as "zero" and as the "lowest" score.

    "zero" is the `least` score of the scale, which is 0 in the paper.

    A score is withheld when the answer disagrees with the expectation (paper, section 5.2). This
    can mean nothing, none at all, or an effect no stronger than the weakest reported. A cell
    with other scores is the mean of all, those that were withheld among them; one that is empty
    for another reason stays missing. A complete table without withheld scores, and one without any
    score, has the first reading only.
    """
    shares = withheld(table, trials)
    if not table.given.any() or (table.is_complete and not shares.any()):
        return {"missing": table}
    # A cell without any score has nothing but withheld ones, if it is filled at all.
    given = np.nan_to_num(table.scores) * (1 - shares)
    fills = {"zero": least, "lowest": float(trials["score"][is_scored(trials)].min())}
    return {"missing": table} | {
        name: replace(table, scores=np.where(shares > 0, given + shares * score, table.scores))
        for name, score in fills.items()
    }


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


def withheld_beside_scores(trials: pd.DataFrame, least: float = 0.0) -> list[str]:
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
        f"({by_condition}). The table has the mean of the others, which is too high if weaker "
        f"changes were not noticed; the scores are also read as {least:g} and as the lowest score."
    ]


def notes(table: ScoreTable, empty: EmptyCells, least: float = 0.0) -> list[str]:
    """Return what stands under Table 4: each mark, how often, and who or what has no score."""
    causes = Counter(empty.values())
    readable = _READ if table.given.any() else frozenset()
    said = [
        f"{MARKS[why]} {_TOLD[why]}: {'1 cell' if causes[why] == 1 else f'{causes[why]} cells'}, "
        + (
            f"also read as {least:g} and as the lowest score."
            if why in readable
            else "missing throughout."
        )
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
