"""What a track can be expected to tell, by simulated observers that answer by its own curve."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from device.arrays import BoolArray, FloatArray
from device.tracks.posterior import choices, correct_share, lattice, report_lattice, slopes
from protocol.study.track import Track
from protocol.tracks.procedure import TrackPlace, constant_order, moved, start

OBSERVERS, SEED = 200, 1
_INNER = (0.1, 0.9)
"""The part of the levels, in ratios, over which the thresholds of observers are spread evenly."""
STEEPER, LAPSES = 1.6, 0.15
"""Observers are not those whom the track assumes: curves may be steeper, and lapses more."""


@dataclass(frozen=True, kw_only=True)
class Expected:
    """Errors of the threshold in dB, its interval and the trials spent, over all observers.

    `rmse_db` is of the estimate by the posterior; `interval_db` the mean width of its 95%
    interval; `trials` the mean number of trials until the track ends.
    """

    rmse_db: float
    interval_db: float
    trials: float


def expected(track: Track, seed: int = SEED, observers: int = OBSERVERS) -> Expected:
    """Return what a report tells of observers, some of whom are not as the track assumes.

    Thresholds are spread evenly over the levels in ratios, without a tenth at each end; slopes and
    lapse rates evenly over the track's ranges and beyond.
    """
    random = np.random.default_rng(seed)
    ends = np.log([track.distances[0], track.distances[-1]])
    threshold = np.exp(ends[0] + random.uniform(*_INNER, observers) * (ends[1] - ends[0]))
    least, steepest = slopes(track)
    slope = random.uniform(least, STEEPER * steepest, observers)
    lapse = random.uniform(track.lapse[0], max(track.lapse[1], LAPSES), observers)
    levels = np.array(track.distances)[:, np.newaxis]
    alarms = np.zeros(observers)
    if track.task == "yes or no":
        alarms = random.uniform(*track.false_alarms, observers)
    right = correct_share(track, levels, threshold, slope, lapse, alarms)
    counted = counted_answers(track, right, random.random((track.trials, observers)))
    grid = report_lattice(track)
    middle, low, high = grid.interval(grid.posterior(counted))
    # Beyond the levels the last one is all that is known.
    middle = middle.clip(levels[levels > 0].min(), levels.max())
    return Expected(
        rmse_db=float(np.sqrt(np.mean((20 * np.log10(middle / threshold)) ** 2))),
        interval_db=float(np.mean(20 * np.log10(high / low))),
        trials=float(counted.sum() / observers),
    )


def counted_answers(track: Track, right: FloatArray, u: FloatArray, first: int = 0) -> FloatArray:
    """Return how often each observer erred and was right at each level, (observers, 2, levels).

    `right` has the chance of a correct answer (or of yes), (levels, observers); `u` a number from
    0 to 1 for each trial, (trials, observers); `first` is the number of the first observer, by
    which orders of constant stimuli are drawn.
    """
    levels, observers = right.shape
    counted = np.zeros((observers, 2, levels))
    everybody = np.arange(observers)
    places = [start(track)] * observers
    numbers = range(first, first + observers)
    orders = np.array([constant_order(track, SEED, each) for each in numbers])
    misses = np.zeros((observers, track.mercy), dtype=int)
    going = np.ones(observers, dtype=bool)
    for trial in range(track.trials):
        if track.method == "quest+":
            weights = lattice(track).posterior(counted)
            asked = choices(track, weights, misses.max(axis=1, initial=0)).astype(int)
        elif track.method == "constant":
            asked = orders[:, trial]
        else:
            asked = np.array([place.level for place in places])
        correct = u[trial] < right[asked, everybody]
        counted[everybody, correct.astype(int), asked] += going
        if track.mercy:
            misses = np.column_stack([misses[:, 1:], np.where(correct, 0, asked)])
        if track.turns:
            told = zip(places, correct.tolist(), strict=True)
            places = [moved(track, place, was_right) for place, was_right in told]
        going &= ~_ended(track, places, counted)
        if not going.any():
            break
    return counted


def _ended(track: Track, places: Sequence[TrackPlace], counted: FloatArray) -> BoolArray:
    """Return for which observers a stop is reached."""
    ended = np.zeros(len(places), dtype=bool)
    if track.stop is not None and track.stop.reversals is not None:
        ended |= np.array([len(place.turned_at) >= track.stop.reversals for place in places])
    if track.stop is not None and track.stop.interval_db is not None:
        grid = lattice(track)
        _, low, high = grid.interval(grid.posterior(counted))
        ended |= 20 * np.log10(high / low) <= track.stop.interval_db
    return ended
