"""Data of the report's figures, thinned where a figure would be too dense to read."""

from dataclasses import dataclass

import numpy as np

from analysis.estimates import FloatArray, IntArray, NotEstimable
from analysis.loading.score_table import ScoreTable
from analysis.report.findings import Findings, Scale
from analysis.sensitivity.linear_model import LinearSensitivity
from analysis.sensitivity.lines import Lines
from analysis.sensitivity.ordinal_model import OrdinalSensitivity
from analysis.sensitivity.ratings import Ratings
from analysis.trials.trial_statistics import TrialStatistics

MOST_LINES = 100
MOST_POINTS = 2_000
MOST_INTERVALS = 40
CURVE_POINTS = 101
HEADLINE, SIMPLE = "M2", "M1 (simple comparison)"
"""Names of the models in figures and tables."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Raincloud:
    """Scores by condition: all scores for the clouds, and lines for some of the subjects."""

    table: ScoreTable
    scale: Scale
    lines: FloatArray
    means: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Scatter:
    """Ratings against predicted contrasts, with the group's expected ratings by model.

    `curves` are at the contrasts `at`.
    """

    ratings: Ratings
    scale: Scale
    of: int
    at: FloatArray
    curves: dict[str, FloatArray]


@dataclass(frozen=True, kw_only=True)
class Gains:
    """Lines of the same subjects under one or two models, by the model's name.

    `shown` are the positions of the subjects to draw, out of `of` subjects.
    """

    models: dict[str, Lines]
    shown: tuple[int, ...]
    of: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Course:
    """Mean score, standard error (NaN for a single score) and count by place in the session."""

    places: IntArray
    scale: Scale
    means: FloatArray
    errors: FloatArray
    counts: IntArray


def thinned(count: int, most: int) -> IntArray:
    """Return at most `most` of `count` positions, evenly spaced.

    >>> thinned(9, 4)
    array([0, 2, 4, 6])
    """
    return np.arange(count) if count <= most else np.arange(most) * count // most


def raincloud(found: Findings) -> Raincloud:
    """Return all scores, and the lines of at most `MOST_LINES` subjects."""
    table, means = found.loaded.table, found.table.main.table4.column_means
    lines = table.scores[thinned(len(table.subjects), MOST_LINES)]
    return Raincloud(table=table, scale=found.scale, lines=lines, means=means)


def scatter(found: Findings) -> Scatter | None:
    """Return ratings and contrasts, or None if no rated trial has a prediction."""
    given = found.trials.scored.ratings.given
    count = len(given.rating)
    if not count:
        return None
    chosen = np.isin(np.arange(count), thinned(count, MOST_POINTS))
    at = np.linspace(given.contrast.min(), given.contrast.max(), CURVE_POINTS)
    curves, m1, m2 = {}, found.trials.m1, found.trials.m2
    if isinstance(m2, OrdinalSensitivity):
        curves[HEADLINE] = m2.expected_ratings(at)
    if isinstance(m1, LinearSensitivity):
        curves[SIMPLE] = m1.lines.bias + m1.lines.gain * at
    ratings = given.where(chosen)
    return Scatter(ratings=ratings, scale=found.scale, of=count, at=at, curves=curves)


def gains(trials: TrialStatistics) -> Gains | None:
    """Return each model's lines, the headline first, or None if neither M1 nor M2 was fitted."""
    fits = {HEADLINE: trials.m2, SIMPLE: trials.m1}
    models = {name: fit.lines for name, fit in fits.items() if not isinstance(fit, NotEstimable)}
    if not models:
        return None
    count = len(next(iter(models.values())).subjects)
    shown = tuple(int(place) for place in thinned(count, MOST_INTERVALS))
    return Gains(models=models, shown=shown, of=count)


def course(found: Findings) -> Course | None:
    """Return the scores by place in the session, or None if the places are unknown."""
    scored = found.trials.scored
    ratings = scored.every
    known = (scored.place > 0) & ~np.isnan(ratings.rating)
    if not known.any():
        return None
    places, which = np.unique(scored.place[known], return_inverse=True)
    counts = np.bincount(which)
    means = np.bincount(which, weights=ratings.rating[known]) / counts
    squares = np.bincount(which, weights=(ratings.rating[known] - means[which]) ** 2)
    # A place with a single score has no standard error: 0 / 0 gives NaN.
    with np.errstate(invalid="ignore", divide="ignore"):
        errors = np.sqrt(squares / (counts - 1) / counts)
    return Course(places=places, scale=found.scale, means=means, errors=errors, counts=counts)
