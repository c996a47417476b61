"""Other readings of a track's answers: on the friction that was measured, and by other choices."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import exp, hypot, log
from typing import Any, Final, NamedTuple

import numpy as np
import pandas as pd

from analysis.estimates import FloatArray, Interval, NotEstimable
from analysis.statistics.intervals import mean_interval
from analysis.thresholds.psychometric import Threshold, fitted
from protocol.study.track import Track, decibels

FEWEST: Final = 5
"""Trials whose friction was measured, for a ratio with an error."""
_Z: Final = 1.959964
_LEAST_LEFT: Final = 0.05
"""Of a trial's residual, where it alone draws the line."""
LAPSES: Final = {"free": None, "known": 0.02}


@dataclass(frozen=True, kw_only=True)
class Felt:
    """The friction measured under one person's finger: contrast per predicted contrast, its error.

    Skin makes it another one for each person (mathematics/thresholds, (12)).
    """

    ratio: float
    error: float
    trials: int

    def contrast(self, predicted: float, ends: Interval) -> tuple[float, Interval]:
        """Return a threshold and its interval on the measured axis; the errors add in squares."""
        low, high = (
            hypot(log(end / predicted), _Z * self.error / self.ratio) if end > 0 else np.inf
            for end in ends
        )
        value = self.ratio * predicted
        return value, (value * exp(-low), value * exp(high))


def felt_of(predicted: FloatArray, measured: FloatArray) -> Felt | None:
    """Return the line through the origin of measured on predicted contrasts, shape (trials,).

    Its error does not ask all trials to scatter alike (MacKinnon and White 1985, HC3). None where
    the measured friction does not follow, or is of too few trials.
    """
    square = float(predicted @ predicted)
    if len(predicted) < FEWEST or square == 0:
        return None
    ratio = float(predicted @ measured) / square
    left = 1 - predicted**2 / square
    apart = predicted * (measured - ratio * predicted) / np.maximum(left, _LEAST_LEFT)
    error = float(np.sqrt(apart @ apart)) / square
    return Felt(ratio=ratio, error=error, trials=len(predicted)) if ratio > _Z * error else None


def felt_in(
    track: Track,
    trials: pd.DataFrame,
    touches: pd.DataFrame,
    friction: Mapping[int, float],
    predicted: Callable[[int], float | None],
) -> Felt | None:
    """Return what was measured in a person's trials of a track, of several touches each.

    Args:
        track: of the study; in yes or no nothing is compared within a trial.
        trials: those of the person that count.
        touches: of these trials.
        friction: the measured friction of touches, by their index.
        predicted: the signed contrast of a level.
    """
    if track.intervals == 1 or not friction:
        return None
    by_trial = {attempt: own.index for attempt, own in touches.groupby("attempt_id")}
    made = trials[trials["level"].notna() & trials["interval"].notna()]
    pairs = []
    for attempt, level, interval in made[["level", "interval"]].itertuples():
        logs = [log(friction[touch]) for touch in by_trial.get(attempt, ()) if touch in friction]
        if len(logs) == track.intervals:
            compared = logs.pop(int(interval) - 1)
            pairs.append((predicted(int(level)) or 0.0, sum(logs) / len(logs) - compared))
    return felt_of(*np.array(pairs).reshape(-1, 2).T)


class Choice(NamedTuple):
    """How a threshold is read from the same answers."""

    estimate: str
    shape: str
    lapses: str


def readings(
    track: Track,
    points: Sequence[tuple[float, int, int]],
    fit: Threshold,
    options: Mapping[str, Any],
    reversals: float | None,
) -> Iterator[tuple[Choice, float]]:
    """Yield the threshold of each choice of curve and lapse rate, and the mean of reversals.

    `points` and `options` are those of `fit`, which is the choice of the track. In yes or no a
    lapse rate that is known would be the share of false alarms, too.
    """
    for shape in ("weibull", "normal"):
        for lapses, rate in LAPSES.items():
            if rate is not None and track.task == "yes or no":
                continue
            made = fit
            if (shape, rate) != (track.shape, None):
                made = fitted(*zip(*points, strict=True), **options, shape=shape, lapse=rate)
            yield Choice("posterior", shape, lapses), track.on_axis(made.threshold)
    if reversals is not None:
        yield Choice("mean of reversals", "", ""), reversals


@dataclass(frozen=True, kw_only=True)
class CohortReading:
    """The cohort's threshold by one choice: geometric mean, its interval, and people's SD in dB.

    `axis` is that of the track, `predicted` or `measured` for the contrast of friction.
    """

    track: str
    axis: str
    choice: Choice
    people: int
    threshold: float
    threshold_interval: Interval | NotEstimable
    sd_db: float | None


def cohort_readings(
    track: Track,
    people: Iterable[tuple[Mapping[Choice, float], Callable[[float], float | None], Felt | None]],
) -> Iterator[CohortReading]:
    """Yield the cohort's threshold by each choice, on each axis that is known of all people.

    `people` have thresholds by choice, the predicted contrast of a level, and what was felt.
    """
    found: dict[tuple[str, Choice], list[float | None]] = {}
    for own, contrast, felt in people:
        for choice, threshold in own.items():
            predicted = None if track.axis == "contrast" else contrast(threshold)
            value = contrast(threshold) if felt else None
            for axis, told in (
                (track.axis, threshold),
                ("predicted contrast", predicted),
                ("measured contrast", felt.ratio * value if felt and value else None),
            ):
                found.setdefault((axis, choice), []).append(told)
    for (axis, choice), values in sorted(found.items(), key=lambda each: each[0][0] != track.axis):
        logs = logarithms(values)
        if len(logs) < len(values):
            continue
        threshold, ends = geometric_mean(logs)
        yield CohortReading(
            track=track.name,
            axis=axis,
            choice=choice,
            people=len(logs),
            threshold=threshold,
            threshold_interval=ends,
            sd_db=decibels(exp(logs.std(ddof=1))) if len(logs) > 1 else None,
        )


def logarithms(values: Iterable[float | None]) -> FloatArray:
    """Return the logarithms of the values that are known and above 0."""
    return np.log([value for value in values if value is not None and value > 0])


def geometric_mean(logs: FloatArray) -> tuple[float, Interval | NotEstimable]:
    """Return the geometric mean of values, given their logarithms, with its t interval."""
    ends = mean_interval(logs)
    if not isinstance(ends, NotEstimable):
        ends = float(np.exp(ends[0])), float(np.exp(ends[1]))
    return float(np.exp(logs.mean())), ends
