"""What answers say of a threshold: a posterior on a grid of thresholds, slopes and lapse rates.

The chance of a correct answer (or of yes) at a distance x from the standard is

    psi(x) = g + (1 - g - d) F(x),

with the guess rate g, the lapse rate d, and F Weibull's 1 - exp(-(x / a)^b) or the normal one's
Phi(b (x - m)). The threshold is where F has the share that defines it, whatever a lapse rate.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from math import log

import numpy as np

from device.arrays import FloatArray
from protocol.study.track import GUESS_RATE, Track, decibels
from protocol.tracks.procedure import Answer

_SLOPES, _LAPSES, _FALSE_ALARMS, _FINE = 5, 4, 4, 161
_THRESHOLDS, _WIDTHS, _RATES = 81, 9, 5
_USUAL_WIDTH, _WIDEST = 0.4, 2.4
"""Of a report's prior: the width of a curve in the range of the levels, and the logarithm of how
many times as wide or narrow it may be."""
_RARE = 1e-12
"""Least chance of an answer: none is impossible, so that none can leave nothing."""
_DIGITS = 10
"""Of expected entropies: sums in another order agree in these, and so choose the same level."""


@dataclass(frozen=True, eq=False)
class Lattice:
    """Sets of parameters, and what they say of each level.

    Attributes:
        threshold: of each set, shape (sets,), as a distance from the standard.
        right: chance of a correct answer, shape (levels, sets).
        information: minus the entropy of an answer, shape (levels, sets).
        logs: logarithms of the chance of an error and of a correct answer, (2, levels, sets).
        before: logarithms of how likely each set is before, (sets,); None if all are alike.
    """

    threshold: FloatArray
    right: FloatArray
    information: FloatArray
    logs: FloatArray
    before: FloatArray | None = None

    def weights(self, answers: Iterable[Answer]) -> FloatArray:
        """Return the posterior probability of each set."""
        counted = np.zeros(self.logs.shape[:2])
        for answer in answers:
            counted[int(answer.correct), answer.level] += 1
        return np.asarray(self.posterior(counted[np.newaxis])[0])

    def posterior(self, counted: FloatArray) -> FloatArray:
        """Return the posterior of each observer, (observers, sets), from counts of answers.

        `counted` has the shape (observers, 2, levels): errors and correct answers.
        """
        many = self.logs.reshape(-1, self.threshold.size)
        log_weights = counted.reshape(len(counted), -1) @ many
        if self.before is not None:
            log_weights += self.before
        found = np.exp(log_weights - log_weights.max(axis=1, keepdims=True))
        found /= found.sum(axis=1, keepdims=True)
        return np.asarray(found, dtype=np.float64)

    def expected_entropy(self, weights: FloatArray) -> FloatArray:
        """Return the expected entropy of the posterior after a trial at each level, up to a sum.

        With the chance p of a correct answer under all sets together, it is the present entropy
        less the expected entropy of the answer that the sets do not explain:
        p ln p + (1 - p) ln(1 - p) - sum(w (psi ln psi + (1 - psi) ln(1 - psi))) (Watson,
        J. Vision 17, 2017, 3:10, QUEST+). `weights` may be those of several observers, a row each.
        """
        right: FloatArray = weights @ self.right.T
        told: FloatArray = weights @ self.information.T
        return _negative_entropy(right) - told

    def interval(self, weights: FloatArray) -> FloatArray:
        """Return the median of the threshold and the ends of its 95% interval, (3, observers)."""
        by = self.threshold.argsort(kind="stable")
        cumulated = np.cumsum(weights[:, by], axis=1) - weights[:, by] / 2
        logs = np.log(self.threshold[by])
        ends = (0.5, 0.025, 0.975)
        found = [[np.interp(end, row, logs) for row in cumulated] for end in ends]
        return np.exp(np.array(found))


def _negative_entropy(right: FloatArray) -> FloatArray:
    wrong = 1 - right
    return np.asarray(right * np.log(right) + wrong * np.log(wrong))


def correct_share(
    track: Track,
    distance: FloatArray,
    threshold: FloatArray,
    slope: FloatArray,
    lapse: FloatArray,
    false_alarms: FloatArray,
) -> FloatArray:
    """Return the chance of a correct answer, by the formula above; arrays are broadcast.

    The guess rate is that of the task, in yes or no the share of `false_alarms`.
    """
    by_chance = GUESS_RATE[track.task]
    at = (track.share - by_chance) / (1 - by_chance)
    if track.shape == "weibull":
        # Far above the threshold of a steep curve the power is infinite, and the curve is 1.
        with np.errstate(over="ignore"):
            curve = 1 - np.exp(log(1 - at) * (distance / threshold) ** slope)
    else:
        from scipy.special import ndtr, ndtri  # loaded for this shape alone

        curve = ndtr(slope * (distance - threshold) + ndtri(at))
    guess = by_chance or false_alarms
    return np.asarray(guess + (1 - guess - lapse) * curve)


def slopes(track: Track) -> tuple[float, float]:
    """Return the least and the largest slope that a track assumes."""
    if track.slope is not None:
        return track.slope
    spread = max(track.distances) - min(track.distances)
    return (1.0, 5.0) if track.shape == "weibull" else (4 / spread, 20 / spread)


@lru_cache(maxsize=32)
def lattice(track: Track, *, fine: bool = False) -> Lattice:
    """Return the parameter sets of a track: a threshold at each level, or a `fine` grid of them."""
    levels = np.array(track.distances)
    thresholds = np.geomspace(levels[0], levels[-1], _FINE) if fine else levels
    lapses = np.linspace(*track.lapse, _LAPSES if track.lapse[0] < track.lapse[1] else 1)
    low, high = slopes(track)
    steep = np.linspace(low, high, _SLOPES if low < high else 1)
    few, many = track.false_alarms if track.task == "yes or no" else (0.0, 0.0)
    alarms = np.linspace(few, many, _FALSE_ALARMS if few < many else 1)
    return _of_sets(track, thresholds, steep, lapses, alarms)


def _of_sets(track: Track, *axes: FloatArray) -> Lattice:
    threshold, *others = (each.ravel() for each in np.meshgrid(*axes, indexing="ij"))
    levels = np.array(track.distances)
    right = correct_share(track, levels[:, np.newaxis], threshold, *others)
    right = right.clip(_RARE, 1 - _RARE)
    logs = np.log(np.stack([1 - right, right]))
    return Lattice(threshold, right, _negative_entropy(right), logs)


@lru_cache(maxsize=8)
def report_lattice(track: Track) -> Lattice:
    """Return parameter sets of the prior of a report, whatever the track assumes of people.

    It is that of mathematics/thresholds, (4), on a grid that is the same for all answers,
    but for the scatter, which answers of one time at each level hardly show.
    """
    first, *_, last = (each for each in track.distances if each > 0)
    beyond = np.sqrt(last / first)
    thresholds = np.geomspace(first / beyond, last * beyond, _THRESHOLDS)
    of_width = np.linspace(-_WIDEST, _WIDEST, _WIDTHS)
    if track.shape == "weibull":
        length, ends = log(last / first), log(log(0.05) / log(0.95))
    else:
        length, ends = last - first, 3.2897073
    steep = ends / (length * _USUAL_WIDTH * np.exp(-of_width))
    rates = 1 - (1 - (np.arange(_RATES) + 0.5) / _RATES) ** 0.1  # of Beta(1, 10)
    alarms = rates if track.task == "yes or no" else np.zeros(1)
    sets = _of_sets(track, thresholds, steep, rates, alarms)
    by_slope = np.broadcast_to(of_width[:, None, None], (_WIDTHS, _RATES, alarms.size))
    before = np.tile(-2 * np.log(np.cosh(by_slope)).ravel(), _THRESHOLDS)
    slope = np.tile(np.broadcast_to(steep[:, None, None], by_slope.shape).ravel(), _THRESHOLDS)
    middle = _midpoint(track, sets.threshold, slope)
    outside = np.maximum(np.maximum(-middle, middle - 1), 0.0).clip(max=0.5)
    before += np.log((1 + np.cos(2 * np.pi * outside)) / 2 + _RARE)
    if track.shape == "normal":
        before += np.log(sets.threshold)  # equally likely in steps, of which there are ratios here
    return replace(sets, before=before)


def _midpoint(track: Track, threshold: FloatArray, slope: FloatArray) -> FloatArray:
    """Return where the curve is half-way, from 0 at the first level to 1 at the last."""
    first, *_, last = (each for each in track.distances if each > 0)
    by_chance = GUESS_RATE[track.task]
    at = (track.share - by_chance) / (1 - by_chance)
    if track.shape == "weibull":
        above = (log(-log(1 - at)) - log(log(2))) / slope
        return np.asarray((np.log(threshold / first) - above) / log(last / first))
    from scipy.special import ndtri

    return np.asarray((threshold - ndtri(at) / slope - first) / (last - first))


def choices(track: Track, weights: FloatArray, hardest: FloatArray | int = 0) -> FloatArray:
    """Return the level of QUEST+ for each observer: the lowest of those that tell most.

    None is harder than `hardest`.
    """
    told = lattice(track).expected_entropy(weights).round(_DIGITS)
    below = np.arange(told.shape[1]) < np.reshape(hardest, (-1, 1))
    return np.asarray(np.where(below, np.inf, told).argmin(axis=1))


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A threshold, its 95% interval, both on the axis of the track, and its width in dB."""

    threshold: float
    threshold_ci: tuple[float, float]
    interval_db: float


def estimate(track: Track, answers: Iterable[Answer]) -> Estimate:
    """Return the posterior's threshold: its median and 95% interval, from all answers that count.

    The threshold lies within the levels, all of which are equally likely before, in ratios.
    """
    grid = lattice(track, fine=True)
    middle, low, high = grid.interval(grid.weights(answers)[np.newaxis])[:, 0].tolist()
    side = 1 if track.values[-1] > track.reference else -1
    first, last = sorted(track.reference + side * end for end in (low, high))
    return Estimate(
        threshold=track.reference + side * middle,
        threshold_ci=(first, last),
        interval_db=decibels(high / low),
    )
