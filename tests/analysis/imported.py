"""Tables of scores for tests, read as `touchbeam import` reads them."""

import numpy as np

from analysis.estimates import ScoreTable
from analysis.tables.ratings import Imported
from analysis.tables.reading import cells_in
from analysis.tables.roles import roles_in
from analysis.tables.score_table import MOST_ROWS, scores_in
from analysis.tables.shape import shape_of


def imported(
    text: str | bytes,
    columns: str | None = None,
    *,
    source: str = "scores.csv",
    missing: str | None = None,
    keep_means: bool = False,
    **known: object,
) -> Imported:
    content = text.encode() if isinstance(text, str) else text
    cells = cells_in(content, source, most=MOST_ROWS).without(missing)
    shape = shape_of(cells, roles_in(cells, columns), keep_means=keep_means)
    return scores_in(cells, shape, keep_means=keep_means, **known)  # type: ignore[arg-type]


def score_table(text: str, **known: object) -> ScoreTable:
    """Return the scores of a plain table, one for each subject and condition."""
    scores = imported(text, **known)  # type: ignore[arg-type]
    given = {
        (visit.participant, each.condition): each.score
        for visit in scores.visits
        for each in visit.ratings
    }
    subjects = tuple(visit.participant for visit in scores.visits)
    cells = [[given.get((who, name)) for name in scores.conditions] for who in subjects]
    return ScoreTable(
        subjects=subjects, conditions=scores.conditions, scores=np.array(cells, np.float64)
    )
