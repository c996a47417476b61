"""The response of a trial: one number for noticing a change and for rating it.

    response = score - lowest score + 1   if the change was answered as expected
             = 0                          if it was answered otherwise
             = score                      of a trial without a question on a change

Nothing that was answered is missing, whichever answers are scored (`rating.score_when`): a score
that a study also asks for after another answer stands in the table of scores and is no response. A
trial that runs backwards expects the opposite answer, so that its response is told likewise.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.special import bdtrc

from analysis.estimates import LEVEL, FloatArray, ScoreTable
from analysis.loading.sessions import is_scored
from protocol.study.study_question import IMPORTED_QUESTION, QUESTIONS

IN_WORDS = (
    "The response of a trial is its score, counted from 1 at the lowest, if the change was "
    "answered as expected, and 0 if it was answered otherwise"
)
"""As readers of a report are told it, without the full stop."""


def responses(trials: pd.DataFrame, lowest: float) -> FloatArray:
    """Return the response of each of `trials`, shape (trials,), on a scale from 0.

    NaN of trials that count for no condition (baseline, practice, catch and tracks), of those that
    were not answered, of blank cells of a published table, and of a score that is missing although
    the answer was the expected one.

    Args:
        trials: rows of `StudyData.trials`, of which `trial_kind`, `question`, `agrees`, `score` and
            `lowest_score` are taken.
        lowest: the lowest score of the present scale, where that of a trial is not known.
    """
    least = trials["lowest_score"].fillna(lowest).to_numpy(np.float64)
    score = trials["score"].to_numpy(np.float64, na_value=np.nan)
    is_asked = trials["question"].notna().to_numpy()
    # In a table of answers a score without one is not known to be of the expected answer.
    is_imported = trials["trial_kind"].eq("published").to_numpy()
    is_asked = is_asked | (is_imported & (is_asked & is_imported).any())
    agrees = trials["agrees"].astype("boolean")
    expected, otherwise = (agrees.eq(way).fillna(False).to_numpy(bool) for way in (True, False))
    of_change = np.select([expected, otherwise], [score - least + 1, 0.0], np.nan)
    response = np.where(is_asked, of_change, score)
    return np.where(is_scored(trials), response, np.nan)


def mean_responses(
    trials: pd.DataFrame, response: FloatArray, subjects: Sequence[str], conditions: Sequence[str]
) -> ScoreTable:
    """Return each subject's mean response to each condition, NaN where nothing was answered.

    `response` has shape (trials,), as `responses` returns it.
    """
    answered = trials.assign(response=response).dropna(subset=["response"])
    means = answered.groupby(["participant", "condition"])["response"].mean()
    # Cell by cell, because a table of nothing at all has no columns to turn.
    cells = means.reindex(pd.MultiIndex.from_product([subjects, conditions]))
    scores = cells.to_numpy(np.float64).reshape(len(subjects), len(conditions))
    return ScoreTable(subjects=tuple(subjects), conditions=tuple(conditions), scores=scores)


class Directions(NamedTuple):
    """How often changes were answered as expected, the other way, and as no change."""

    expected: int
    contrary: int
    same: int

    @property
    def answers(self) -> int:
        """The number of answers."""
        return sum(self)

    @property
    def is_contrary(self) -> bool:
        """Whether more changes were felt the other way than chance explains, of those felt.

        Where people guess, either way is as likely (sign test, one-sided, p < .05).
        """
        felt = self.expected + self.contrary
        return self.contrary > 0 and float(bdtrc(self.contrary - 1, felt, 0.5)) < LEVEL

    def __str__(self) -> str:
        counts = zip(self, ("as expected", "the other way", "no change"), strict=True)
        return ", ".join(f"{count} {way}" for count, way in counts if count)


def directions(trials: pd.DataFrame, *names: str) -> dict[tuple[str, ...], Directions]:
    """Return the directions of the answers by the columns `names`, in the order of appearance.

    Of trials that count for the table of scores, expect a change, and were answered.
    """
    # Where no change is expected there are no ways.
    is_change = ~trials["expected"].isin(NO_CHANGE.values())
    asked = trials[is_scored(trials) & is_change & trials["question"].notna()]
    asked = asked[asked["agrees"].notna()]
    same = asked["change"].eq(asked["question"].map(NO_CHANGE))
    agrees = asked["agrees"].astype(bool)
    ways = {"expected": agrees, "contrary": ~agrees & ~same, "same": ~agrees & same}
    counts = pd.DataFrame(ways).groupby([asked[name] for name in names], sort=False).sum()
    keys = counts.index if len(names) > 1 else ((name,) for name in counts.index)
    return {
        key: Directions(*row) for key, row in zip(keys, counts.to_numpy().tolist(), strict=True)
    }


NO_CHANGE: Mapping[str, str] = {
    **{name: question.same for name, question in QUESTIONS.items()},
    IMPORTED_QUESTION: "same",
}
"""The answer to each question that means that nothing changed."""
