"""Trials as the arrays that the sensitivity models and checks take."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from analysis.estimates import FloatArray, IntArray
from analysis.loading.sessions import is_scored
from analysis.loading.study_data import StudyData
from analysis.sensitivity.noticing import EXPECTED, OPPOSITE, SAME
from analysis.sensitivity.ratings import Ratings
from analysis.sensitivity.two_stage_model import AnsweredTrials
from analysis.trials.contrasts import TrialContrasts
from device.friction.contrasts import LAW
from protocol.study.study import Study
from protocol.study.study_question import ANSWERS, CONTRARIES, no_change


@dataclass(frozen=True, kw_only=True, eq=False)
class ScoredTrials:
    """The trials that count for Table 4, in the order of `trials`; see `Ratings` for the arrays.

    `ratings` has the contrasts of the law `consistent` and, of all laws, only trials with a
    prediction; `contrasts` has the same trials by law. `every` are all trials, predicted or not,
    with contrast 0. `place` and `previous` go with `every`; 0 and -1 where not known.
    """

    ratings: Ratings
    contrasts: dict[str, FloatArray]
    every: Ratings
    place: IntArray
    previous: IntArray


def scored_trials(data: StudyData, contrasts: TrialContrasts) -> ScoredTrials:
    """Return the trials with a score, or with one that was not given."""
    scored = is_scored(data.trials)
    trials = data.trials[scored]
    by_law = {law: values[scored] for law, values in contrasts.by_law.items()}
    predicted = np.asarray(np.isfinite(list(by_law.values())).all(axis=0))
    every = ratings_of(data, trials, np.zeros(len(trials)))
    named = ratings_of(data, trials, np.where(predicted, by_law[LAW], 0.0)).where(predicted)
    return ScoredTrials(
        ratings=named,
        contrasts={law: values[predicted] for law, values in by_law.items()},
        every=every,
        place=trials["place"].to_numpy(np.int64, na_value=0),
        previous=_positions(trials["previous"], data.table.conditions),
    )


def ratings_of(data: StudyData, trials: pd.DataFrame, contrast: FloatArray) -> Ratings:
    """Return trials as arrays; their conditions must be among those of the table."""
    return Ratings(
        subjects=data.table.subjects,
        conditions=data.table.conditions,
        subject=_positions(trials["participant"], data.table.subjects),
        condition=_positions(trials["condition"], data.table.conditions),
        contrast=contrast,
        rating=trials["score"].to_numpy(),
    )


def _positions(names: "pd.Series[str]", known: Sequence[str]) -> IntArray:
    """Return the position of each name among `known`, -1 for any other."""
    return pd.Index(known).get_indexer(pd.Index(names))


def detection_trials(data: StudyData, contrasts: TrialContrasts, study: Study) -> AnsweredTrials:
    """Return scored and catch trials with what was answered, for change detection.

    Contrasts and answers are told relative to what the condition expects, so that a trial in the
    opposite order has a negative contrast, and its right answer is the opposite one.
    """
    expected = data.trials["condition"].map(
        {entry.name: entry.expected for entry in study.condition}
    )
    chosen = (
        data.trials["trial_kind"].isin(["trial", "catch"])
        & data.trials["change"].notna()
        & expected.notna()
        & np.isfinite(contrasts.by_law[LAW])
    )
    trials = data.trials[chosen]
    same = trials["change"].eq(
        trials["question"].map({asked: no_change(asked) for asked in ANSWERS})
    )
    answers = np.select([trials["change"].eq(expected[chosen]), same], [EXPECTED, SAME], OPPOSITE)
    # -0.0 and 0.0 are one contrast.
    signed = contrasts.by_law[LAW][chosen] * np.where(trials["opposite"], -1.0, 1.0) + 0.0
    return AnsweredTrials(
        ratings=ratings_of(data, trials, signed),
        answer=answers,
        two_sided=expected[chosen].isin([*CONTRARIES, *CONTRARIES.values()]).to_numpy(),
    )
