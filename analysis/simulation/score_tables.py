"""Tables of scores of many cohorts at once, after the study's rules on who is left out."""

import numpy as np

from analysis.estimates import BoolArray, FloatArray
from analysis.simulation.cohort import Cohort
from analysis.simulation.planned_trials import PlannedTrials
from device.people.answering import SAME


def score_tables(planned: PlannedTrials, made: Cohort) -> FloatArray:
    """Return each person's mean score by condition, shape (people, conditions).

    The rules are those of `analysis.loading.exclusions`: trials are judged first, by the time to
    the first answer, then people, by the trials that are left to them.
    """
    conditions = planned.study.conditions
    of = planned.kinds
    condition = np.array([_position(conditions, kind.trial.condition) for kind in of])[made.kinds]
    counted, out = counted_trials(planned, made)
    given = counted & ~np.isnan(made.score)
    table = np.full((made.people.size, len(conditions)), np.nan)
    for column in range(len(conditions)):
        counts = given & (condition == column)
        number = counts.sum(axis=1)
        total = np.where(counts, made.score, 0.0).sum(axis=1)
        np.divide(total, number, out=table[:, column], where=number > 0)
    table[out] = np.nan
    return table


def counted_trials(planned: PlannedTrials, made: Cohort) -> tuple[BoolArray, BoolArray]:
    """Return which trials with a score or without it count, and whom the rules leave out.

    Shapes (people, trials) and (people,); the trials of those who are left out may be among them.
    """
    of = planned.kinds
    scored = np.array([kind.trial.kind == "trial" for kind in of])[made.kinds]
    catch = np.array([kind.trial.kind == "catch" for kind in of])[made.kinds]
    kept = made.answered & ~_too_soon_or_late(planned, made, scored | catch)
    given = kept & scored & ~np.isnan(made.score)
    alarms = kept & catch & (made.change != SAME)
    return kept & scored, _left_out(planned, kept & scored, given, kept & catch, alarms)


def _position(conditions: tuple[str, ...], name: str | None) -> int:
    return conditions.index(name) if name in conditions else -1


def _too_soon_or_late(planned: PlannedTrials, made: Cohort, judged: BoolArray) -> BoolArray:
    rules = planned.study.exclusions
    wrong = np.zeros(judged.shape, dtype=np.bool_)
    if rules.min_reaction_s is not None:
        wrong |= made.reaction_s < rules.min_reaction_s
    if rules.max_reaction_s is not None:
        wrong |= made.reaction_s > rules.max_reaction_s
    return judged & wrong


def _left_out(
    planned: PlannedTrials,
    scored: BoolArray,
    given: BoolArray,
    catch: BoolArray,
    alarms: BoolArray,
) -> BoolArray:
    """Return whom the rules leave out, shape (people,)."""
    rules = planned.study.exclusions
    trials, catches = scored.sum(axis=1), catch.sum(axis=1)
    out = np.zeros(trials.shape, dtype=np.bool_)
    if rules.max_false_alarms is not None:
        out |= (catches > 0) & (
            alarms.sum(axis=1) / np.maximum(catches, 1) > rules.max_false_alarms
        )
    if rules.max_missing_scores is not None:
        missing = (trials - given.sum(axis=1)) / np.maximum(trials, 1)
        out |= (trials > 0) & (missing > rules.max_missing_scores)
    if rules.min_trials is not None:
        out |= trials < rules.min_trials
    return out
