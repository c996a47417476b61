"""The exported table: a row per trial that was begun, with a column per `Column`."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd

from analysis.cells import Cell
from analysis.export.columns import COLUMNS, question_columns
from analysis.loading.records import values
from analysis.loading.sessions import Sessions
from protocol.study.study_question import StudyQuestion

_NOTED = {
    "skin_state": "skin state",
    "room_temperature": "room temperature",
    "humidity": "humidity",
    "cleaning": "cleaning",
}
"""The operator's question behind each column."""
_SESSION_NAMES = {"exclusion": "session_exclusion", "inclusion": "session_inclusion"}
"""The columns of sessions that have the names of columns of trials."""


def trial_table(
    found: Sessions, sessions: pd.DataFrame, questions: Sequence[StudyQuestion]
) -> pd.DataFrame:
    """Return the trials of `sessions`, some of those `found`, as they are exported.

    Values of a plan or an attempt are missing for a published score. The answers to `questions`
    stand in the last columns.
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
        **_answers(found.answers, trials, questions),
    )
    for column, question in _NOTED.items():
        table[column] = [noted.get(question) for noted in trials["operator_noted"]]
    table["touches"] = table["touches"].astype("Int64").where(planned)
    return table[[column.name for column in (*COLUMNS, *question_columns(questions))]]


def _answers(
    answers: pd.DataFrame, trials: pd.DataFrame, questions: Sequence[StudyQuestion]
) -> "dict[str, pd.Series[Any]]":
    """Return answer and reaction time to each question for each of `trials`.

    An answer about a trial belongs to its last attempt, one about a block to all of its trials,
    any other to all trials of the session.
    """
    names, *keys = (values(answers[name]) for name in ("name", "session_id", "attempt_id", "block"))
    told = zip(values(answers["answer"]), values(answers["reaction_time_s"]), strict=True)
    given = dict(zip(zip(names, *keys, strict=True), told, strict=True))
    places = list(
        zip(values(trials["session_id"]), trials.index, values(trials["block"]), strict=True)
    )
    table: dict[str, pd.Series[Any]] = {}
    for question in questions:
        name = question.name
        found = []
        for session, attempt, block in places:
            about = ((attempt, None), (None, block), (None, None))
            known = (given[key] for each in about if (key := (name, session, *each)) in given)
            found.append(next(known, (None, None)))
        for number, column in enumerate(question_columns([question])):
            told_there = [pair[number] for pair in found]
            table[column.name] = pd.Series(told_there, trials.index, object)
    return table


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
    return zip(*(values(table[name]) for name in table.columns), strict=True)
