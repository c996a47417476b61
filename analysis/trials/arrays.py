"""Trials as the arrays that the sensitivity models and checks take."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.estimates import FloatArray, IntArray
from analysis.loading.sessions import TrialRow
from analysis.loading.study_data import StudyData
from analysis.sensitivity.joint_model import EXPECTED, OPPOSITE, SAME
from analysis.sensitivity.ratings import Ratings
from analysis.trials.contrasts import TrialContrasts
from protocol.study.questions import no_change
from protocol.study.study import Study


@dataclass(frozen=True, kw_only=True, eq=False)
class ScoredTrials:
    """The trials that count for Table 4, in the order of `rows`; see `Ratings` for the arrays.

    `ratings` has the contrasts of the law `consistent` and, of all laws, only trials with a
    prediction; `contrasts` has the same trials by law. `every` are all trials, predicted or not,
    with contrast 0. `place` and `previous` go with `every`; 0 and -1 where not known.
    """

    ratings: Ratings
    contrasts: dict[str, FloatArray]
    every: Ratings
    place: IntArray
    previous: IntArray


LAW = "consistent"
"""The law under which sensitivities are estimated: the only one with the right limits."""


def scored_trials(loaded: StudyData, contrasts: TrialContrasts) -> ScoredTrials:
    """Return the trials with a score, or with one that was not given."""
    scored = np.array([row.is_scored for row in loaded.rows], dtype=np.bool_)
    rows = [row for row in loaded.rows if row.is_scored]
    by_law = {law: values[scored] for law, values in contrasts.by_law.items()}
    predicted = np.asarray(np.isfinite(list(by_law.values())).all(axis=0))
    every = ratings_of(loaded, rows, np.zeros(len(rows)))
    named = ratings_of(loaded, rows, np.where(predicted, by_law[LAW], 0.0)).where(predicted)
    names = {name: column for column, name in enumerate(loaded.table.conditions)}
    return ScoredTrials(
        ratings=named,
        contrasts={law: values[predicted] for law, values in by_law.items()},
        every=every,
        place=np.array([row.place or 0 for row in rows], dtype=np.int64),
        previous=np.array([names.get(row.previous or "", -1) for row in rows], dtype=np.int64),
    )


def ratings_of(loaded: StudyData, rows: Sequence[TrialRow], contrast: FloatArray) -> Ratings:
    """Return trials as arrays; their conditions must be among those of the table."""
    subjects = {name: row for row, name in enumerate(loaded.table.subjects)}
    conditions = {name: column for column, name in enumerate(loaded.table.conditions)}
    return Ratings(
        subjects=loaded.table.subjects,
        conditions=loaded.table.conditions,
        subject=np.array([subjects[row.participant] for row in rows], dtype=np.int64),
        condition=np.array([conditions[row.condition or ""] for row in rows], dtype=np.int64),
        contrast=contrast,
        rating=np.array([row.score for row in rows], dtype=np.float64),
    )


def detection_trials(
    loaded: StudyData, contrasts: TrialContrasts, study: Study
) -> tuple[Ratings, IntArray]:
    """Return scored and catch trials with what was answered, for change detection.

    Contrasts and answers are told relative to what the condition expects, so that a trial in the
    opposite order has a negative contrast, and its right answer is the opposite one.
    """
    expected = {condition.name: condition.expected for condition in study.condition}
    chosen = [
        number
        for number, row in enumerate(loaded.rows)
        if row.kind in {"trial", "catch"}
        and row.change is not None
        and row.condition in expected
        and np.isfinite(contrasts.by_law[LAW][number])
    ]
    rows = [loaded.rows[number] for number in chosen]
    turned = np.array([-1.0 if row.opposite else 1.0 for row in rows])
    answers = [_answer(row, expected[row.condition or ""]) for row in rows]
    signed = contrasts.by_law[LAW][chosen] * turned
    # -0.0 and 0.0 are one contrast.
    return ratings_of(loaded, rows, signed + 0.0), np.array(answers, dtype=np.int64)


def _answer(row: TrialRow, expected: str) -> int:
    assert row.question is not None
    if row.change == expected:
        return EXPECTED
    return SAME if row.change == no_change(row.question) else OPPOSITE
