"""What people may feel of friction: the predictors of the literature, scored as laws are."""

from analysis.estimates import Interval
from analysis.felt.measured_trials import MeasuredTrials
from analysis.friction.touch_measures import FRICTION
from analysis.kept import Kept
from analysis.loading.study_data import StudyData
from analysis.trials.contrasts import TrialContrasts, scored_trials
from analysis.trials.trial_statistics import LawScore, law_scores
from device.friction.contrasts import LAW


def predictor_scores(
    data: StudyData, measured: MeasuredTrials, scale: Interval, keep: Kept
) -> tuple[LawScore, ...]:
    """Return how each predictor orders the conditions and fits the ratings, on the same trials.

    All are of single trials: a contrast that borrows from other trials would have less noise.
    """
    contrasts = TrialContrasts(
        by_law={**measured.predictors, LAW: measured.predictors[FRICTION]},
        measured=measured.known,
    )
    scored = scored_trials(data, contrasts)
    by_name = {name: scored.contrasts[name] for name in measured.predictors}
    return law_scores(data, scored.ratings, by_name, scale, keep)
