"""Simulated ratings of known truth, and how often the 95% intervals of their stage hold it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.estimates import Estimate, FloatArray, NotEstimable
from analysis.sensitivity.answers_model import UNEQUAL
from analysis.sensitivity.rating_stage import Beside, rating_stage
from tests.analysis.sensitivity.simulated_raters import (
    VirtualPopulation,
    VirtualStudy,
    virtual_study,
)

# Contrasts of the paper's five conditions; subjects, and ratings of each condition by each.
CONTRASTS = np.array([0.187, 0.109, 0.406, 0.447, 0.043])
DESIGNS = {"9x5x1": (9, 1), "9x5x4": (9, 4), "3x5x4": (3, 4), "20x5x8": (20, 8)}

EVEN = tuple(level + 0.5 for level in range(10))
# The ratings 5 and 8 are used more often than their neighbours.
UNEVEN = (0.5, 1.4, 2.3, 3.2, 4.0, 5.9, 6.6, 7.2, 8.8, 9.5)
MIDDLE = VirtualPopulation(bias=4.0, gain=6.0, gain_sd=2.0, noise_sd=1.0, thresholds=EVEN)
POPULATIONS = {
    "middle": MIDDLE,
    "ceiling": replace(MIDDLE, bias=7.4),
    "two thirds tens": replace(MIDDLE, bias=9.0),
    "lapses": replace(MIDDLE, lapse_rate=0.05),
    "equal gains": replace(MIDDLE, gain_sd=0.0),
    "off the line": replace(MIDDLE, discrepancy_sd=0.8),
    "uneven use": replace(MIDDLE, thresholds=UNEVEN),
    "no differences": replace(MIDDLE, bias_sd=0.0, gain_sd=0.0),
    "no gain": replace(MIDDLE, bias=5.5, gain=0.0, gain_sd=0.0, discrepancy_sd=1.0),
}


@dataclass(frozen=True, kw_only=True)
class Measures:
    """What one fit gives: shares of intervals that hold the truth, and their mean widths.

    `differ` is 1 if equal gains have a probability below `UNEQUAL`, `sd_below` whether the SD of
    gains is below its limit; `gain_error` is in the study's own points.
    """

    bias: float
    gain: float
    relative_gain: float
    group_gain: float
    group_excludes_0: float
    sd_below: float
    differ: float
    gain_error: float
    gain_width: float
    relative_width: float
    tens: float


def drawn(name: str, design: str, seed: int) -> VirtualStudy:
    """Return a study of the population `name`."""
    subjects, repeats = DESIGNS[design]
    return virtual_study(
        POPULATIONS[name],
        subjects=subjects,
        condition=np.repeat(np.arange(5), repeats),
        contrast=np.repeat(CONTRASTS, repeats),
        rng=np.random.default_rng([31, seed]),
    )


def to_model_scale(study: VirtualStudy, thresholds: tuple[float, ...]) -> tuple[float, float]:
    """Return (zero, unit): the latent value y of the study is zero + unit y on the model's.

    It fixes its outer thresholds midway between the two lowest and the two highest ratings given.
    """
    edges = np.array(thresholds)
    given = np.unique(study.ratings.rating).astype(np.int64)
    pairs = ((given[0], given[1]), (given[-2], given[-1]))
    low, high = ((edges[one] + edges[other - 1]) / 2 for one, other in pairs)
    lowest, highest = (sum(pair) / 2 for pair in pairs)
    unit = (highest - lowest) / (high - low)
    return lowest - unit * low, unit


def measured(name: str, design: str, seed: int) -> Measures | NotEstimable:
    """Return what the stage of ratings makes of one study."""
    study, population = drawn(name, design, seed), POPULATIONS[name]
    stage = rating_stage(study.ratings, Beside())
    if isinstance(stage, NotEstimable):
        return stage
    zero, unit = to_model_scale(study, population.thresholds)
    bias, gain = zero + unit * (study.bias + study.discrepancy.mean()), unit * study.gain
    gains, relative = stage.of_subjects("gain"), stage.of_subjects("relative gain")
    group = [stage.of_group("gain")]
    return Measures(
        bias=held(stage.of_subjects("bias"), bias),
        gain=held(gains, gain),
        relative_gain=held(relative, gain - gain.mean()),
        group_gain=held(group, unit * population.gain),
        group_excludes_0=1 - held(group, 0.0),
        sd_below=float(unit * population.gain_sd < stage.gain_sd_upper),
        differ=float(stage.equal_gains < UNEQUAL),
        gain_error=float(np.mean([estimate.value for estimate in gains] - gain) / unit),
        gain_width=width(gains),
        relative_width=width(relative),
        tens=float((study.ratings.rating == 10).mean()),
    )


def held(estimates: Sequence[Estimate], truth: FloatArray | float) -> float:
    """Return the share of intervals that hold the truth."""
    low, high = np.array([estimate.interval for estimate in estimates]).T
    return float(((low <= truth) & (truth <= high)).mean())


def width(estimates: Sequence[Estimate]) -> float:
    """Return the mean width of the intervals."""
    return float(np.diff([estimate.interval for estimate in estimates]).mean())
