"""Simulated participants with known bias, gain, discrepancies, noise and lapses."""

from dataclasses import dataclass

import numpy as np

from analysis.estimates import FloatArray, IntArray
from analysis.sensitivity.lines import Ratings


@dataclass(frozen=True, kw_only=True)
class VirtualPopulation:
    """The population of virtual participants; biases, gains and noise in rating points.

    A latent value bias + gain · contrast + discrepancy + noise is rounded to `step` and clipped to
    `scale`, unless this is None; with `thresholds` its rating is the number of those below it. In a
    share `lapse_rate` of trials the rating is random.
    """

    bias: float = 3.0
    bias_sd: float = 1.0
    gain: float = 3.0
    gain_sd: float = 1.0
    discrepancy_sd: float = 0.0
    noise_sd: float = 1.2
    scale: tuple[float, float] | None = (0.0, 10.0)
    step: float = 1.0
    lapse_rate: float = 0.0
    thresholds: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not 0 <= self.lapse_rate <= 1:
            raise ValueError(f"lapse rate must lie in [0, 1], got {self.lapse_rate}")
        if self.lapse_rate and self.scale is None:
            raise ValueError(f"lapses at rate {self.lapse_rate} need a rating scale")


@dataclass(frozen=True, kw_only=True, eq=False)
class VirtualStudy:
    """The participants' ratings and true parameters.

    `bias` and `gain` have shape (subjects,), `discrepancy` (conditions,).
    """

    ratings: Ratings
    bias: FloatArray
    gain: FloatArray
    discrepancy: FloatArray


def virtual_study(
    population: VirtualPopulation,
    *,
    subjects: int,
    condition: IntArray,
    contrast: FloatArray,
    rng: np.random.Generator,
) -> VirtualStudy:
    """Return a study in which each of `subjects` participants rates the given trials once.

    Parameters:
        population: distribution of bias, gain and noise.
        subjects: number of participants.
        condition: shape (trials,), positions from 0.
        contrast: shape (trials,), predicted contrasts.
        rng: the only source of randomness.
    """
    conditions = int(condition.max()) + 1
    bias = rng.normal(population.bias, population.bias_sd, subjects)
    gain = rng.normal(population.gain, population.gain_sd, subjects)
    added = rng.normal(0.0, population.discrepancy_sd, conditions)
    noise = rng.normal(0.0, population.noise_sd, (subjects, len(contrast)))
    latent = bias[:, None] + gain[:, None] * contrast + added[condition] + noise
    rating = _lapsed(_on_scale(latent, population), population, rng)
    ratings = Ratings(
        subjects=tuple(f"v{number}" for number in range(1, subjects + 1)),
        conditions=tuple(f"condition {number}" for number in range(1, conditions + 1)),
        subject=np.repeat(np.arange(subjects), len(contrast)),
        condition=np.tile(condition, subjects),
        contrast=np.tile(contrast, subjects),
        rating=rating.ravel(),
    )
    return VirtualStudy(ratings=ratings, bias=bias, gain=gain, discrepancy=added)


def _on_scale(latent: FloatArray, population: VirtualPopulation) -> FloatArray:
    if population.thresholds:
        return np.searchsorted(population.thresholds, latent).astype(np.float64)
    if population.scale is None:
        return latent
    return np.clip(np.round(latent / population.step) * population.step, *population.scale)


def _lapsed(
    rating: FloatArray, population: VirtualPopulation, rng: np.random.Generator
) -> FloatArray:
    if population.scale is None or population.lapse_rate == 0:
        return rating
    low, high = population.scale
    steps = round((high - low) / population.step)
    anything = low + population.step * rng.integers(0, steps + 1, rating.shape)
    return np.where(rng.random(rating.shape) < population.lapse_rate, anything, rating)
