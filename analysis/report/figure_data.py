"""Data of the report's figures, thinned where a figure would be too dense to read."""

from collections.abc import Mapping
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
from device.friction.contrasts import LAW

MOST_LINES = 100
MOST_POINTS = 2_000
MOST_INTERVALS = 40
MOST_PEOPLE = 60
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


@dataclass(frozen=True, kw_only=True, eq=False)
class ByLevel:
    """Scores of one condition by level, thinned if there are very many.

    `mean`, `error` and M2's `expected` go with levels `at`.
    """

    condition: str
    level: FloatArray
    score: FloatArray
    at: FloatArray
    mean: FloatArray
    error: FloatArray
    counts: IntArray
    expected: FloatArray | None


@dataclass(frozen=True, kw_only=True)
class Levels:
    """The conditions that have several levels."""

    conditions: tuple[ByLevel, ...]
    scale: Scale


@dataclass(frozen=True, kw_only=True)
class People:
    """Scores of each trial of the subjects shown, by condition, and the means of all subjects."""

    conditions: tuple[str, ...]
    scores: Mapping[str, tuple[FloatArray, ...]]
    means: FloatArray
    scale: Scale
    of: int


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
        bias, gain = m1.lines.middle
        curves[SIMPLE] = bias + gain * at
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
    # A place with a single score has no standard error.
    errors = np.sqrt(squares / np.where(counts > 1, counts - 1, np.nan) / counts)
    return Course(places=places, scale=found.scale, means=means, errors=errors, counts=counts)


def levels(found: Findings) -> Levels | None:
    """Return the scores by level, or None if no condition was scored at several levels."""
    scored = found.loaded.scored.assign(contrast=_contrasts(found)).dropna(subset=["score"])
    several = scored.groupby("condition")["level"].nunique().gt(1)
    names = [name for name in found.loaded.table.conditions if several.get(name, False)]
    if not names:
        return None
    m2 = found.trials.m2
    made = []
    for name in names:
        own = scored[scored["condition"] == name]
        by_level = own.groupby("level")
        at = by_level["contrast"].mean().to_numpy()
        drawn = own.iloc[thinned(len(own), MOST_POINTS // len(names))]
        known = None if isinstance(m2, NotEstimable) or not np.isfinite(at).all() else m2
        made.append(
            ByLevel(
                condition=name,
                level=drawn["level"].to_numpy(float),
                score=drawn["score"].to_numpy(float),
                at=np.array(by_level["score"].mean().index, float),
                mean=by_level["score"].mean().to_numpy(),
                error=np.asarray(by_level["score"].sem(), np.float64),
                counts=np.asarray(by_level["score"].count(), np.int64),
                expected=None if known is None else known.expected_ratings(at),
            )
        )
    return Levels(conditions=tuple(made), scale=found.scale)


def _contrasts(found: Findings) -> FloatArray:
    """Return the predicted contrast of each scored trial."""
    return found.trials.contrasts.by_law[LAW][
        found.loaded.trials.index.isin(found.loaded.scored.index)
    ]


def people(found: Findings) -> People:
    """Return all subjects, or of more than `MOST_PEOPLE` the most extreme ones.

    Extreme are the two with the lowest and with the highest means, and those with the smallest
    and with the largest spread of their scores.
    """
    table = found.loaded.table
    scored = found.loaded.scored.dropna(subset=["score"])
    cells = {
        key: own.to_numpy(float)
        for key, own in scored.groupby(["participant", "condition"])["score"]
    }
    empty = np.array([])
    return People(
        conditions=table.conditions,
        scores={
            table.subjects[row]: tuple(
                cells.get((table.subjects[row], name), empty) for name in table.conditions
            )
            for row in _shown_people(table)
        },
        means=found.table.main.table4.column_means,
        scale=found.scale,
        of=len(table.subjects),
    )


def _shown_people(table: ScoreTable) -> list[int]:
    if len(table.subjects) <= MOST_PEOPLE:
        return list(range(len(table.subjects)))
    rated = np.flatnonzero(table.given.any(axis=1))
    by_mean = rated[np.argsort(np.nanmean(table.scores[rated], axis=1), kind="stable")]
    by_spread = rated[np.argsort(np.nanstd(table.scores[rated], axis=1), kind="stable")]
    ends = [*by_mean[:2], *by_mean[-2:], *by_spread[:2], *by_spread[-2:]]
    return list(dict.fromkeys(int(row) for row in ends))
