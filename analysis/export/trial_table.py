"""The exported tables of trials, participants, touches and contrasts, a column per `Column`."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd

from analysis.cells import Cell
from analysis.export.columns import COLUMNS, CONTRAST_COLUMNS, TOUCH_COLUMNS, question_columns
from analysis.loading.records import TEXT, values
from analysis.loading.sessions import Sessions
from analysis.trials.contrasts import trial_contrasts
from device.friction.calibration import Calibration
from device.friction.contrasts import RUNG
from protocol.study.study import Study
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
    trials = trials_with_answers(found, session_table(sessions), questions)
    table = trials.assign(
        score=_scores(trials["score"], whole=trials["attempts"].notna()),
        started_utc=_utc(trials["started_utc"]),
        answered_utc=_utc(trials["answered_utc"]),
        **_touches(found.touches, trials.index),
    )
    return table[[column.name for column in (*COLUMNS, *question_columns(questions))]]


def session_table(sessions: pd.DataFrame) -> pd.DataFrame:
    """Return `sessions` with what the operator noted and the version in columns of their own."""
    told = {
        **{column: ("operator_noted", question) for column, question in _NOTED.items()},
        "touchbeam_version": ("versions", "touchbeam"),
    }
    texts = {
        column: pd.Series([answers.get(key) for answers in sessions[of]], sessions.index, TEXT)
        for column, (of, key) in told.items()
    }
    return sessions.rename(columns=_SESSION_NAMES).assign(**texts)


def trials_with_answers(
    found: Sessions, of_session: pd.DataFrame, questions: Sequence[StudyQuestion]
) -> pd.DataFrame:
    """Return the trials of the sessions in a `session_table`, with all but the columns per touch.

    The index is that of the trial's last attempt.
    """
    trials = found.trials.join(of_session.drop(columns="study_sha256"), "session_id", "inner")
    planned = trials["attempts"].notna()
    excluded = [trials["session_exclusion"].notna(), trials["exclusion"].notna()]
    touches = found.touches["attempt_id"].value_counts().reindex(trials.index, fill_value=0)
    answers = _answers(found.answers, trials, questions)
    assigned = trials.assign(
        trial_index=trials["trial_index"].astype("Int64").where(planned),
        level=trials["level"].where(planned),
        opposite=trials["opposite"].astype("boolean").where(planned),
        excluded=np.select(excluded, ["session", "trial"], "no"),
        exclusion_reason=trials["session_exclusion"].fillna(trials["exclusion"]),
        inclusion_reason=trials["session_inclusion"].fillna(trials["inclusion"]),
        touches=touches.astype("Int64").where(planned),
    )
    # All at once: pandas warns of a hundred columns that come one by one.
    return assigned.join(pd.DataFrame(answers, trials.index))


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


def touch_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Return a row per touch of the exported `trials`; of published scores nothing is known."""
    listed = [column.name for column in COLUMNS if column.per_touch]
    touched = trials[trials["touches"].fillna(0).gt(0)].reset_index(drop=True)
    rows = touched.explode(listed)
    numbered = rows.assign(touch=rows.groupby(level=0).cumcount())
    return numbered[[column.name for column in TOUCH_COLUMNS]].reset_index(drop=True)


def participant_table(
    sessions: pd.DataFrame, trials: pd.DataFrame, questions: Sequence[StudyQuestion]
) -> pd.DataFrame:
    """Return a row per participant of `sessions`, of which `trials` are the trials.

    A question that was asked before or after sessions has a column, unless somebody gave it
    different answers. A rehearsal that has a participant's name is a participant of its own.
    """
    keys = ["participant", "session", "session_kind"]
    kinds = sessions.groupby("subject", sort=False)["session_kind"]
    several = {who: tuple(dict.fromkeys(each)) for who, each in kinds}
    table = pd.DataFrame({"sessions": kinds.size(), "session_kinds": pd.Series(several)})
    said = trials.merge(sessions[[*keys, "subject"]], on=keys)
    for name in (each.name for each in questions if each.when in {"before", "after"}):
        given = said[["subject", name]].dropna().drop_duplicates().set_index("subject")[name]
        if given.index.is_unique:
            table[name] = given.reindex(table.index)
    return table.rename_axis("participant").reset_index()


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
    """Return by column one value per touch of each attempt."""
    # The touches of an attempt follow one another, and attempts are numbered as they began.
    told_of = touches["attempt_id"].to_numpy()
    ends = (np.searchsorted(told_of, attempts, side).tolist() for side in ("left", "right"))
    spans = [slice(*span) for span in zip(*ends, strict=True)]
    table: dict[str, list[Any]] = {}
    for column in COLUMNS:
        if column.per_touch:
            told = values(touches[column.name])
            table[column.name] = [tuple(told[span]) for span in spans]
    return table


def cells(table: pd.DataFrame) -> Iterable[tuple[Cell, ...]]:
    """Return the cells of each row of a table of trials."""
    return zip(*(values(table[name]) for name in table.columns), strict=True)


def contrast_table(
    study: Study, found: Sessions, trials: pd.DataFrame, rig: Calibration
) -> pd.DataFrame:
    """Return what each law predicts for each of the exported `trials`, as in the report.

    Args:
        study: the present study.
        found: what `trials` were made from, with measures.
        trials: a `trial_table`.
        rig: of the trials for which no calibration was in force.
    """
    begun = found.trials.loc[trials.index]
    touches = found.touches[found.touches["attempt_id"].isin(begun.index)]
    contrasts = trial_contrasts(study, begun, touches.assign(place_m=found.places_m), rig)
    laws = [
        trials.assign(
            law=law, rung=RUNG, predicted_contrast=predicted, touch_measured=contrasts.measured
        )
        for law, predicted in contrasts.by_law.items()
    ]
    rows = pd.concat(laws).loc[trials.index]
    return rows[[column.name for column in CONTRAST_COLUMNS]].reset_index(drop=True)
