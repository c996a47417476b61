"""Simulated studies of people as M2 assumes them, and of people of other kinds."""

from dataclasses import replace

import numpy as np

from analysis.estimates import FloatArray
from analysis.sensitivity.lines import Ratings
from analysis.sensitivity.two_stage_model import AnsweredTrials
from tests.analysis.sensitivity.noticing_people import CONTRASTS
from tests.analysis.sensitivity.simulated_raters import VirtualPopulation, virtual_study


def own_people(rng: np.random.Generator, repeats: int = 4) -> Ratings:
    """Nine people with a line each, who rate five conditions."""
    people = VirtualPopulation(bias=5, gain=8, gain_sd=2.5, discrepancy_sd=0.5, noise_sd=1.2)
    condition = np.repeat(np.arange(5), repeats)
    return virtual_study(
        people, subjects=9, condition=condition, contrast=CONTRASTS[condition], rng=rng
    ).ratings


def users_of_few_numbers(rng: np.random.Generator) -> Ratings:
    """The same, but a third rates 0, 5 or 10 only, and a third 2 or 8."""
    ratings = own_people(rng)
    rating = _nearest(ratings.rating, ratings.subject % 3 == 0, np.array([0.0, 5.0, 10.0]))
    rating = _nearest(rating, ratings.subject % 3 == 1, np.array([2.0, 8.0]))
    return replace(ratings, rating=rating)


def ceiling_mixture(rng: np.random.Generator) -> Ratings:
    """Twice as many ratings; some people rate 10 in 60 or 30% of them, whatever they feel."""
    ratings = own_people(rng, repeats=8)
    share = np.array([0.0, 0.6, 0.3])[ratings.subject % 3]
    tens = rng.random(len(share)) < share
    return replace(ratings, rating=np.where(tens, 10.0, ratings.rating))


def one_scale_of_few_numbers(rng: np.random.Generator) -> AnsweredTrials:
    """Nine people whose answer and score are steps of one scale; every other scores 4 or 8."""
    once = np.concatenate([np.tile(CONTRASTS, 3), -CONTRASTS, np.zeros(10)])
    subject, contrast = np.repeat(np.arange(9), len(once)), np.tile(once, 9)
    bias, gain = rng.normal(2, 1, 9), rng.normal(16, 4, 9)
    latent = bias[subject] + gain[subject] * contrast + rng.normal(0, 1.5, len(subject))
    answer = np.select([latent > 3, latent < 0.5], [1, -1], 0)
    score = np.clip(np.round(latent), 0, 10)
    score = _nearest(score, subject % 2 == 1, np.array([4.0, 8.0]))
    agrees = (answer == np.sign(contrast)) & (answer != 0)
    ratings = Ratings(
        subjects=tuple(f"s{number}" for number in range(9)),
        conditions=tuple(f"c{number}" for number in range(5)),
        subject=subject,
        condition=np.tile(np.arange(5), len(contrast) // 5),
        contrast=contrast,
        rating=np.where(agrees, score, np.nan),
    )
    two_sided = np.ones(len(answer), dtype=np.bool_)
    return AnsweredTrials(ratings=ratings, answer=answer, two_sided=two_sided)


def _nearest(rating: FloatArray, chosen: np.ndarray, numbers: FloatArray) -> FloatArray:
    nearest = numbers[np.abs(rating[:, None] - numbers).argmin(axis=1)]
    return np.asarray(np.where(chosen, nearest, rating))
