"""Simulated participants who first notice a change and then rate it."""

from dataclasses import dataclass

import numpy as np

from analysis.estimates import FloatArray, IntArray, NotEstimable
from analysis.sensitivity.lines import Ratings
from analysis.sensitivity.two_stage_model import (
    AnsweredTrials,
    TwoStageSensitivity,
    first_stage,
    two_stage_posterior,
)

CONTRASTS = np.array([0.10, 0.15, 0.25, 0.35, 0.05])


def two_stage_sensitivity(trials: AnsweredTrials) -> TwoStageSensitivity | NotEstimable:
    first = first_stage(trials)
    if isinstance(first, NotEstimable):
        return first
    return two_stage_posterior(trials, first.told).summary


@dataclass(frozen=True, kw_only=True)
class NoticingPeople:
    """People with noise and criterion (contrast), then bias and gain (rating points).

    A change is noticed if contrast + noise exceeds the criterion in either direction. Its score is
    bias + gain · size + noise, rounded and clipped to 0 to 10.
    """

    subjects: int = 9
    noise: float = 0.08
    noise_spread: float = 0.25
    criterion: float = 0.10
    criterion_spread: float = 0.25
    bias: float = 4.5
    bias_sd: float = 1.0
    gain: float = 8.0
    gain_sd: float = 2.5
    rating_noise: float = 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class NoticingStudy:
    """Trials and the true parameters of each subject; d′ is at the mean expected contrast."""

    trials: AnsweredTrials
    d_prime: FloatArray
    criterion: FloatArray
    gain: FloatArray


def noticing_study(
    people: NoticingPeople, rng: np.random.Generator, *, repeats: int = 4, catches: int = 2
) -> NoticingStudy:
    """Return a study of five conditions, one repeat of each in the opposite order."""
    count = people.subjects
    noise = people.noise * np.exp(rng.normal(0, people.noise_spread, count))
    criterion = people.criterion * np.exp(rng.normal(0, people.criterion_spread, count))
    bias = rng.normal(people.bias, people.bias_sd, count)
    gain = rng.normal(people.gain, people.gain_sd, count)
    parts = [CONTRASTS] * (repeats - 1) + [-CONTRASTS] + [0 * CONTRASTS] * catches
    contrast = np.tile(np.concatenate(parts), count)
    condition = np.tile(np.arange(5), len(contrast) // 5)
    subject = np.repeat(np.arange(count), len(contrast) // count)
    felt = contrast + rng.normal(0, noise[subject])
    answer: IntArray = np.where(np.abs(felt) < criterion[subject], 0, np.sign(felt)).astype(int)
    line = bias[subject] + gain[subject] * np.abs(contrast)
    score = np.clip(np.round(line + rng.normal(0, people.rating_noise, len(line))), 0, 10)
    ratings = Ratings(
        subjects=tuple(f"s{number}" for number in range(count)),
        conditions=tuple(f"c{number}" for number in range(5)),
        subject=subject,
        condition=condition,
        contrast=contrast + 0.0,
        rating=np.where((answer == np.sign(contrast)) & (answer != 0), score, np.nan),
    )
    two_sided = np.ones(len(contrast), dtype=np.bool_)
    return NoticingStudy(
        trials=AnsweredTrials(ratings=ratings, answer=answer, two_sided=two_sided),
        d_prime=CONTRASTS.mean() / noise,
        criterion=criterion / noise,
        gain=gain,
    )
