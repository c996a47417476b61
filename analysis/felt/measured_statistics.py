"""Sensitivities on measured contrasts: M1, M2 and M3, contrasts by condition, and predictors."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from analysis.estimates import FloatArray, NotEstimable
from analysis.felt.measured_trials import MeasuredTrials, measured_trials
from analysis.felt.predictors import predictor_scores
from analysis.loading.sessions import is_scored
from analysis.loading.study_data import StudyData
from analysis.sensitivity.linear_model import LinearSensitivity, linear_sensitivity
from analysis.sensitivity.ordinal_model import OrdinalSensitivity
from analysis.sensitivity.predictive_checks import checked_ordinal, checked_two_stage
from analysis.sensitivity.two_stage_model import TwoStageSensitivity
from analysis.trials.arrays import detection_trials, scored_trials
from analysis.trials.contrasts import TrialContrasts
from analysis.trials.trial_checks import FTest, gain_differences
from analysis.trials.trial_statistics import LawScore
from device.friction.contrasts import LAW
from protocol.study.study import Study


@dataclass(frozen=True, kw_only=True)
class ConditionContrast:
    """The measured contrasts of a condition's scored trials: their mean and its standard error.

    `trial_error` is the root mean square of the standard errors of single trials, and `best_error`
    of those that borrow from others; `spread` the SD of the best contrasts between trials.
    """

    condition: str
    trials: int
    mean: float
    mean_error: float
    predicted: float
    spread: float
    trial_error: float
    best_error: float


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredStatistics:
    """What the recordings of a study say; the models are those of `TrialStatistics`.

    `left_out` counts scored trials without a measured contrast, by reason. `noise_share` is the
    part of the variance of M1's residuals that the errors of the contrasts explain, `differences`
    the test of differences in gain between subjects.
    """

    trials: MeasuredTrials
    conditions: tuple[ConditionContrast, ...]
    left_out: Mapping[str, int]
    m1: LinearSensitivity | NotEstimable
    m2: OrdinalSensitivity | NotEstimable
    m3: TwoStageSensitivity | NotEstimable
    noise_share: float | NotEstimable
    differences: FTest | NotEstimable
    predictors: tuple[LawScore, ...]


def measured_statistics(
    study: Study, data: StudyData, predicted: FloatArray
) -> MeasuredStatistics | None:
    """Return the statistics of the trials with recorded touches; None if nothing was recorded.

    The models take each trial's best contrast in place of the predicted one (regression
    calibration). The variance of its error, times the square of the gain, is part of the variance
    of a rating, which they estimate.

    Parameters:
        study: the present study.
        data: its data.
        predicted: shape (trials,), contrasts that the model predicts.
    """
    if not data.forces:
        return None
    found = measured_trials(study, data.trials, data.touches, data.forces)
    contrasts = TrialContrasts(by_law={LAW: found.best}, measured=found.known)
    ratings = scored_trials(data, contrasts).ratings
    m1 = linear_sensitivity(ratings)
    rating = study.rating
    return MeasuredStatistics(
        trials=found,
        conditions=_conditions(data, found, predicted),
        left_out=dict(
            Counter(
                reason
                for reason, counts in zip(found.why, is_scored(data.trials), strict=True)
                if counts and reason is not None
            )
        ),
        m1=m1,
        m2=checked_ordinal(ratings).fit,
        m3=checked_two_stage(detection_trials(data, contrasts, study)).fit,
        noise_share=_noise_share(data, found, m1),
        differences=gain_differences(ratings),
        predictors=predictor_scores(data, found, (float(rating.minimum), float(rating.maximum))),
    )


def _conditions(
    data: StudyData, found: MeasuredTrials, predicted: FloatArray
) -> tuple[ConditionContrast, ...]:
    scored = is_scored(data.trials).to_numpy() & found.known
    names = data.trials["condition"].to_numpy()
    entries = []
    for name in data.table.conditions:
        own = scored & (names == name)
        if own.any():
            errors, best = found.error[own], found.best[own]
            entries.append(
                ConditionContrast(
                    condition=name,
                    trials=int(own.sum()),
                    mean=float(found.value[own].mean()),
                    mean_error=float(np.sqrt((errors**2).sum()) / own.sum()),
                    predicted=float(predicted[own].mean()),
                    spread=float(best.std()),
                    trial_error=float(np.sqrt((errors**2).mean())),
                    best_error=float(np.sqrt((found.best_error[own] ** 2).mean())),
                )
            )
    return tuple(entries)


def _noise_share(
    data: StudyData, found: MeasuredTrials, m1: LinearSensitivity | NotEstimable
) -> float | NotEstimable:
    if isinstance(m1, NotEstimable):
        return m1
    scored = is_scored(data.trials).to_numpy() & found.known
    by_errors = m1.lines.middle[1] ** 2 * float((found.best_error[scored] ** 2).mean())
    return min(by_errors / m1.residual_sd**2, 1.0)
