"""Gains on measured and on predicted contrasts, of people whose true gains are known."""

from dataclasses import dataclass, replace

import numpy as np

from analysis.estimates import FloatArray, NotEstimable
from analysis.sensitivity.answers_model import UNEQUAL
from analysis.sensitivity.lines import Ratings
from analysis.sensitivity.rating_stage import Beside, rating_stage
from analysis.trials.contrasts import ratings_of
from tests.analysis.friction.recorded_sessions import MeasuredStudy
from tests.analysis.sensitivity.calibration import EVEN, held, width

BIAS, BIAS_SD, GAIN, NOISE_SD = 4.0, 1.0, 8.0, 1.0


@dataclass(frozen=True, kw_only=True)
class GainMeasures:
    """One fit: the share of gains in their intervals, of relative ones, and how wide these are.

    `claimed` is whether equal gains have a probability below `UNEQUAL`.
    """

    gain: float
    relative_gain: float
    group_gain: float
    claimed: float
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


def gain_measures(ratings: Ratings, contrast: FloatArray, gain: FloatArray) -> GainMeasures | None:
    """Return what is made of the ratings with these contrasts; None without a fit."""
    fit = rating_stage(replace(ratings, contrast=contrast), Beside())
    if isinstance(fit, NotEstimable):
        return None
    gains = fit.of_subjects("gain")
    return GainMeasures(
        gain=held(gains, gain),
        relative_gain=held(fit.of_subjects("relative gain"), gain - gain.mean()),
        group_gain=held([fit.of_group("gain")], GAIN),
        claimed=float(fit.equal_gains < UNEQUAL),
        width=width(gains),
    )
