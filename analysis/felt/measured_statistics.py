"""Sensitivities on measured contrasts: M1, M2 and M3, contrasts by condition, and predictors."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from analysis.estimates import FloatArray, NotEstimable
from analysis.felt.measured_trials import MeasuredTrials, measured_trials
from analysis.felt.predictors import predictor_scores
from analysis.kept import Kept
from analysis.loading.sessions import is_scored
from analysis.loading.study_data import StudyData
from analysis.sensitivity.linear_model import LinearSensitivity, linear_sensitivity
from analysis.sensitivity.ordinal_model import OrdinalSensitivity
from analysis.sensitivity.predictive_checks import checked_ordinal, checked_two_stage
from analysis.sensitivity.ratings import Ratings
from analysis.sensitivity.two_stage_model import TwoStageSensitivity
from analysis.trials.contrasts import TrialContrasts, detection_trials, scored_trials
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

    They take each trial's best contrast in place of the predicted one (regression calibration).
    The variance of its error, times the square of the gain, is part of the variance of a rating,
    which they estimate. Each is computed when it is asked for.

    `predicted`, shape (trials,), has the contrasts that the model predicts.
    """

    study: Study
    data: StudyData
    predicted: FloatArray
    keep: Kept = field(default_factory=Kept)

    @cached_property
    def trials(self) -> MeasuredTrials:
        """The measured contrasts."""
        data = self.data
        return measured_trials(self.study, data.trials, data.touches, data.forces)

    @cached_property
    def conditions(self) -> tuple[ConditionContrast, ...]:
        """The measured contrasts of each condition."""
        return _conditions(self.data, self.trials, self.predicted)

    @cached_property
    def left_out(self) -> Mapping[str, int]:
        """How many scored trials have no measured contrast, by reason."""
        whys = zip(self.trials.why, is_scored(self.data.trials), strict=True)
        return dict(Counter(why for why, counts in whys if counts and why is not None))

    @cached_property
    def _contrasts(self) -> TrialContrasts:
        return TrialContrasts(by_law={LAW: self.trials.best}, measured=self.trials.known)

    @cached_property
    def _ratings(self) -> Ratings:
        return scored_trials(self.data, self._contrasts).ratings

    @property
    def m1(self) -> LinearSensitivity | NotEstimable:
        """The simple comparison."""
        return self.keep(linear_sensitivity, self._ratings)

    @property
    def m2(self) -> OrdinalSensitivity | NotEstimable:
        """The headline."""
        return self.keep(checked_ordinal, self._ratings).fit

    @property
    def m3(self) -> TwoStageSensitivity | NotEstimable:
        """Noticing a change, then rating it."""
        answered = detection_trials(self.data, self._contrasts, self.study)
        return self.keep(checked_two_stage, answered).fit

    @property
    def noise_share(self) -> float | NotEstimable:
        """The part of the variance of M1's residuals that the contrasts' errors explain."""
        return _noise_share(self.data, self.trials, self.m1)

    @property
    def differences(self) -> FTest | NotEstimable:
        """The test of differences in gain between subjects."""
        return self.keep(gain_differences, self._ratings)

    @cached_property
    def predictors(self) -> tuple[LawScore, ...]:
        """What else might be felt, as laws are scored."""
        rating = self.study.rating
        scale = (float(rating.minimum), float(rating.maximum))
        return predictor_scores(self.data, self.trials, scale, self.keep)


def measured_statistics(
    study: Study, data: StudyData, predicted: FloatArray, keep: Kept | None = None
) -> MeasuredStatistics | None:
    """Return the statistics of the trials with recorded touches; None if nothing was recorded."""
    if not data.forces:
        return None
    return MeasuredStatistics(study=study, data=data, predicted=predicted, keep=keep or Kept())


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
