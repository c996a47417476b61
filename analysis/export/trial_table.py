"""The exported table: a row per trial that was begun, with the columns of `COLUMNS`."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd

from analysis.cells import Cell
from analysis.export.columns import COLUMNS
from analysis.loading.records import values
from analysis.loading.sessions import Sessions

_NOTED = {
    "skin_state": "skin state",
    "room_temperature": "room temperature",
    "humidity": "humidity",
    "cleaning": "cleaning",
}
"""The operator's question behind each column."""
_SESSION_NAMES = {"exclusion": "session_exclusion", "inclusion": "session_inclusion"}
"""The columns of sessions that have the names of columns of trials."""


def trial_table(found: Sessions, sessions: pd.DataFrame) -> pd.DataFrame:
    """Return the trials of `sessions`, some of those `found`, as they are exported.

    Values of a plan or an attempt are missing for a published score.
    """
    of_session = sessions.rename(columns=_SESSION_NAMES)
    trials = found.trials.join(of_session.drop(columns="study_sha256"), "session_id", "inner")
    planned = trials["attempts"].notna()
    excluded = [trials["session_exclusion"].notna(), trials["exclusion"].notna()]
    table = trials.assign(
        trial_index=trials["trial_index"].astype("Int64").where(planned),
        level=trials["level"].where(planned),
        opposite=trials["opposite"].astype("boolean").where(planned),
        score=_scores(trials["score"], whole=planned),
        excluded=np.select(excluded, ["session", "trial"], "no"),
        exclusion_reason=trials["session_exclusion"].fillna(trials["exclusion"]),
        inclusion_reason=trials["session_inclusion"].fillna(trials["inclusion"]),
        started_utc=_utc(trials["started_utc"]),
        answered_utc=_utc(trials["answered_utc"]),
        touchbeam_version=[versions.get("touchbeam") for versions in trials["versions"]],
        **_touches(found.touches, trials.index),
    )
    for column, question in _NOTED.items():
        table[column] = [noted.get(question) for noted in trials["operator_noted"]]
    table["touches"] = table["touches"].astype("Int64").where(planned)
    return table[[column.name for column in COLUMNS]]


def _scores(scores: "pd.Series[float]", whole: "pd.Series[bool]") -> "pd.Series[Any]":
    """Return the scores as given: whole numbers in a session, any in a published table."""
    given = zip(values(scores), whole, strict=True)
    return pd.Series(
        [int(score) if is_whole and score is not None else score for score, is_whole in given],
        scores.index,
        object,
    )


def _utc(moments: "pd.Series[Any]") -> "pd.Series[str]":
    """Return the moments in BIDS' form: ISO 8601 to the microsecond, with Z."""
    texts: pd.Series[str] = moments.dt.strftime("%Y-%m-%dT%H:%M:%S.%fZ")
    return texts


def _touches(touches: pd.DataFrame, attempts: "pd.Index[int]") -> dict[str, list[Any]]:
    """Return the number of touches of each attempt, and by column one value per touch."""
    rows_of = touches.groupby("attempt_id").indices
    rows = [rows_of.get(attempt, ()) for attempt in attempts]
    table: dict[str, list[Any]] = {"touches": [len(own) for own in rows]}
    for column in COLUMNS:
        if column.per_touch:
            told = values(touches[column.name])
            table[column.name] = [tuple(told[row] for row in own) for own in rows]
    return table


def cells(table: pd.DataFrame) -> Iterable[tuple[Cell, ...]]:
    """Return the cells of each row of a table of trials."""
    return zip(*(values(table[column.name]) for column in COLUMNS), strict=True)
