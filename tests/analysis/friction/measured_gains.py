"""Gains on measured and on predicted contrasts, of people whose true gains are known."""

from dataclasses import dataclass, replace

import numpy as np

from analysis.estimates import FloatArray, NotEstimable
from analysis.sensitivity.linear_model import linear_sensitivity
from analysis.sensitivity.lines import Lines, Ratings
from analysis.sensitivity.ordinal_model import ordinal_sensitivity
from analysis.trials.contrasts import ratings_of
from analysis.trials.trial_checks import gain_differences
from tests.analysis.friction.recorded_sessions import MeasuredStudy
from tests.analysis.sensitivity.calibration import EVEN, held

BIAS, BIAS_SD, GAIN, NOISE_SD = 4.0, 1.0, 8.0, 1.0
CLAIMED = 0.05
"""Differences in gain are claimed at a smaller p."""
MODELS = {"M1": linear_sensitivity, "M2": ordinal_sensitivity}


@dataclass(frozen=True, kw_only=True)
class GainMeasures:
    """One fit: the share of gains in their intervals, of relative ones, and the spread.

    `claimed` is whether the report's test finds differences in gain.
    """

    gain: float
    relative_gain: float
    group_gain: float
    claimed: float
    spread: float
    width: float


def rated(
    study: MeasuredStudy, gain_sd: float, rng: np.random.Generator
) -> tuple[Ratings, FloatArray]:
    """Return ratings of what people truly felt, with true contrasts, and their true gains."""
    trials = study.data.trials[study.scored]
    ratings = ratings_of(study.data, trials, study.true[study.scored])
    people = len(ratings.subjects)
    bias, gain = rng.normal(BIAS, BIAS_SD, people), rng.normal(GAIN, gain_sd, people)
    latent = bias[ratings.subject] + gain[ratings.subject] * ratings.contrast
    latent += rng.normal(0, NOISE_SD, len(latent))
    return replace(ratings, rating=np.searchsorted(EVEN, latent).astype(np.float64)), gain


def gain_measures(
    ratings: Ratings, contrast: FloatArray, gain: FloatArray, model: str
) -> GainMeasures | None:
    """Return what a model makes of the ratings with these contrasts; None without a fit."""
    taken = replace(ratings, contrast=contrast)
    fit, differences = MODELS[model](taken), gain_differences(taken)
    if isinstance(fit, NotEstimable) or isinstance(differences, NotEstimable):
        return None
    lines: Lines = fit.lines
    intervals = [line.gain_interval for line in lines.subjects]
    relative = [line.relative_gain_interval for line in lines.subjects]
    return GainMeasures(
        gain=held(intervals, gain),
        relative_gain=held(relative, gain - gain.mean()),
        group_gain=held([lines.gain_interval], GAIN),
        claimed=float(differences.p < CLAIMED),
        spread=lines.gain_sd / lines.gain,
        width=float(np.diff(intervals).mean()),
    )
