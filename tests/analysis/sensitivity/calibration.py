"""Simulated studies of known truth, and how often the models' 95% intervals hold it."""

import math
from dataclasses import dataclass, replace

import numpy as np

from analysis.estimates import FloatArray, Interval, NotEstimable
from analysis.sensitivity.linear_model import LinearSensitivity, linear_sensitivity
from analysis.sensitivity.lines import UNEQUAL
from analysis.sensitivity.ordinal_model import OrdinalSensitivity, ordinal_sensitivity
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

    `differ` is 1 if it says that gains differ; `gain_error` is in the study's own points.
    """

    bias: float
    gain: float
    relative_gain: float
    group_gain: float
    group_excludes_0: float
    gain_sd: float
    differ: float
    gain_error: float
    gain_width: float
    relative_width: float
    own_share: float
    tens: float
    m1_gain: float
    m1_group_gain: float
    m1_group_excludes_0: float


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
    """Return (zero, unit): the latent value y of the study is zero + unit y on M2's scale.

    M2 fixes its outer thresholds midway between the two lowest and the two highest ratings given.
    """
    edges = np.array(thresholds)
    given = np.unique(study.ratings.rating).astype(np.int64)
    pairs = ((given[0], given[1]), (given[-2], given[-1]))
    low, high = ((edges[one] + edges[other - 1]) / 2 for one, other in pairs)
    lowest, highest = (sum(pair) / 2 for pair in pairs)
    unit = (highest - lowest) / (high - low)
    return lowest - unit * low, unit


def measured(name: str, design: str, seed: int) -> Measures | NotEstimable:
    """Return what M2, and M1 beside it, make of one study."""
    study, population = drawn(name, design, seed), POPULATIONS[name]
    m2, m1 = ordinal_sensitivity(study.ratings), linear_sensitivity(study.ratings)
    if isinstance(m2, NotEstimable):
        return m2
    zero, unit = to_model_scale(study, population.thresholds)
    return _measures(study, m2, m1, (zero, unit, unit * population.gain, population.gain_sd))


def _measures(
    study: VirtualStudy,
    m2: OrdinalSensitivity,
    m1: LinearSensitivity | NotEstimable,
    truth: tuple[float, float, float, float],
) -> Measures:
    zero, unit, group, spread = truth
    bias, gain = zero + unit * study.bias, unit * study.gain
    lines = m2.lines
    gains = [line.gain_interval for line in lines.subjects]
    relative = [line.relative_gain_interval for line in lines.subjects]
    return Measures(
        bias=held([line.bias_interval for line in lines.subjects], bias),
        gain=held(gains, gain),
        relative_gain=held(relative, gain - gain.mean()),
        group_gain=held([lines.gain_interval], group),
        group_excludes_0=1 - held([lines.gain_interval], 0.0),
        gain_sd=held([lines.gain_sd_interval], unit * spread),
        differ=float(lines.equal_gains < UNEQUAL),
        gain_error=float(np.mean([line.gain for line in lines.subjects] - gain) / unit),
        gain_width=float(np.diff(gains).mean()),
        relative_width=float(np.diff(relative).mean()),
        own_share=float(np.mean([line.own_share for line in lines.subjects])),
        tens=float((study.ratings.rating == 10).mean()),
        **_of_m1(study, m1, group / unit),
    )


def _of_m1(
    study: VirtualStudy, m1: LinearSensitivity | NotEstimable, group: float
) -> dict[str, float]:
    if isinstance(m1, NotEstimable):  # what M2 makes of the study counts nevertheless
        return dict.fromkeys(("m1_gain", "m1_group_gain", "m1_group_excludes_0"), math.nan)
    lines = m1.lines
    return {
        "m1_gain": held([line.gain_interval for line in lines.subjects], study.gain),
        "m1_group_gain": held([lines.gain_interval], group),
        "m1_group_excludes_0": 1 - held([lines.gain_interval], 0.0),
    }


def held(intervals: list[Interval], truth: FloatArray | float) -> float:
    """Return the share of intervals that hold the truth."""
    low, high = np.array(intervals).T
    return float(((low <= truth) & (truth <= high)).mean())
