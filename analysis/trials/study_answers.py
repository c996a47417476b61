"""What people answered and scored in a study, as the model of the answers takes it."""

from typing import Any

import numpy as np
import pandas as pd

from analysis.estimates import BoolArray, FloatArray, IntArray
from analysis.loading.response import NO_CHANGE
from analysis.loading.sessions import is_scored
from analysis.loading.study_data import StudyData
from analysis.sensitivity.answers_model import StudyAnswers
from analysis.sensitivity.noticing_stage import Answered
from analysis.trials.contrasts import ratings_of
from protocol.study.rules import Rating
from protocol.study.study import Study
from protocol.study.study_question import IMPORTED_QUESTION, QUESTIONS


def study_answers(
    study: Study, data: StudyData, contrast: FloatArray, scale: Rating
) -> StudyAnswers:
    """Return the scored trials with a contrast and, where people were asked, the catch trials.

    A trial that expects no change tells neither noticing nor rating. Where people were asked, a
    trial without an answer counts for nothing.

    Args:
        study: the present one, for the expected answers of catch trials.
        data: its trials.
        contrast: predicted or measured, shape (trials,), in the direction that the trial itself
            expects; NaN where there is none.
        scale: of the scores.
    """
    trials = data.trials
    scored, catch = is_scored(trials).to_numpy(), trials["trial_kind"].eq("catch").to_numpy()
    expected, asked = _expected(study, trials), trials["change"].notna().to_numpy()
    were_asked = bool((scored & asked).any())
    chosen = scored & np.isfinite(contrast)
    if were_asked:
        is_change = expected.notna() & ~expected.isin(NO_CHANGE.values())
        chosen = (chosen | catch) & asked & is_change.to_numpy()
    used, expected, still = trials[chosen], expected[chosen], catch[chosen]
    ratings = ratings_of(data, used, np.where(still, 0.0, contrast[chosen]))
    answered = None
    if were_asked:
        first = expected.isin([question.more for question in QUESTIONS.values()])
        answered = Answered(
            ratings=ratings,
            answer=_answers(used, expected),
            two_sided=used["question"].isin(_TWO_SIDED).to_numpy(),
            first=first.to_numpy(),
            catch=still,
        )
    return StudyAnswers(
        ratings=ratings,
        scale=(float(scale.minimum), float(scale.maximum)),
        answered=answered,
        selects=study.rating.score_when != "always",
        **_groups(study, data),
        session=_sessions(used),
    )


_TWO_SIDED = [*(name for name, question in QUESTIONS.items() if question.less), IMPORTED_QUESTION]


def _expected(study: Study, trials: pd.DataFrame) -> "pd.Series[str]":
    """Return the answer that each trial expects; that of a catch trial's condition."""
    of_condition = {entry.name: entry.expected for entry in study.condition}
    is_catch = trials["trial_kind"].eq("catch")
    return trials["expected"].where(~is_catch, trials["condition"].map(of_condition))


def _answers(trials: pd.DataFrame, expected: "pd.Series[str]") -> IntArray:
    same = trials["change"].eq(trials["question"].map(NO_CHANGE))
    return np.select([trials["change"].eq(expected), same], [1, 0], -1)


def _groups(study: Study, data: StudyData) -> dict[str, Any]:
    names = tuple(dict.fromkeys((*study.groups, *data.groups.values())))
    people = [data.groups.get(name) for name in data.table.subjects]
    present = tuple(name for name in names if name in people)
    if len(present) < 2:
        return {}
    group = [present.index(name) if name else -1 for name in people]
    return {"groups": present, "group": np.array(group)}


def _sessions(trials: pd.DataFrame) -> IntArray | None:
    numbers, of_trials = np.unique(trials["session"].to_numpy(), return_inverse=True)
    return of_trials if len(numbers) > 1 else None


def predictor(
    predicted: FloatArray, measured: FloatArray | None, scored: BoolArray
) -> tuple[FloatArray, bool]:
    """Return the contrasts that the model takes, and whether they are measured ones.

    They are where friction was recorded in most of the trials that count; those without are then
    left out.
    """
    if measured is None or 2 * np.isfinite(measured[scored]).sum() < max(scored.sum(), 1):
        return predicted, False
    return measured, True
