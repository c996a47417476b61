"""Posterior predictive checks: does a model produce answers like those that were given?"""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Generic, TypeAlias, TypeVar

import numpy as np
from scipy.special import ndtr

from analysis.estimates import (
    LEVEL,
    BoolArray,
    FloatArray,
    IntArray,
    Interval,
    NotEstimable,
    central,
)
from analysis.sensitivity import ordinal_model
from analysis.sensitivity.laplace import LARGE
from analysis.sensitivity.latent_posterior import LatentDraws
from analysis.sensitivity.lines import Ratings
from analysis.sensitivity.noticing import LEAN, Noticing
from analysis.sensitivity.two_stage_model import (
    AnsweredTrials,
    TwoStageSensitivity,
    first_stage,
    two_stage_posterior,
)
from analysis.statistics.corrections import holm

Fit = TypeVar("Fit")

SEED = 1
MOST_DRAWS, LARGE_DRAWS = 1000, 150
"""Number of replicated studies: the second from LARGE trials on."""
CELLS = 200_000
"""Number of trials times draws that are compared at once."""


@dataclass(frozen=True, kw_only=True)
class PredictiveStatistic:
    """Distance of the study from the model, and median and 95% interval of that of replicates.

    The distance of tables of counts is Σ (n - e)² / (e + ½), e being the count expected at a draw
    of the parameters; of shares it is |share - expected share|. `observed` is its median over
    draws, because at a few draws that expect almost none of an answer that was given it is huge.
    `p` is the share of draws at which the replicate departs at least as far as the study (Gelman,
    Meng and Stern, Statistica Sinica 6, 1996). It is conservative.
    """

    name: str
    observed: float
    predicted: float
    predicted_interval: Interval
    p: float
    p_holm: float


@dataclass(frozen=True, kw_only=True)
class PredictiveCheck:
    """The check of one model by its statistics."""

    statistics: tuple[PredictiveStatistic, ...]
    draws: int

    @property
    def refusal(self) -> NotEstimable | None:
        """Why the model is withheld, or None if the check does not reject it."""
        failed = [each for each in self.statistics if each.p_holm < LEVEL]
        if not failed:
            return None
        names = ", ".join(f"{each.name} (p = {each.p_holm:.3f})" for each in failed)
        return NotEstimable(f"its posterior predictive check rejects it: {names}")


@dataclass(frozen=True, kw_only=True)
class Checked(Generic[Fit]):
    """A model, or why there is none, and its check, also if that rejects the model."""

    fit: Fit | NotEstimable
    check: PredictiveCheck | NotEstimable


# M3 asks for that of M2 again, where every change that was scored was noticed.
fitted = lru_cache(maxsize=1)(ordinal_model.posterior_of)


def checked_ordinal(ratings: Ratings) -> Checked[ordinal_model.OrdinalSensitivity]:
    """Return M2 with its check of scores by condition and by subject."""
    ready = ordinal_model.prepared_ratings(ratings)
    if isinstance(ready, NotEstimable):
        return Checked(fit=ready, check=ready)
    posterior = fitted(ready)
    fit = posterior.fit
    if isinstance(fit, NotEstimable):
        return Checked(fit=fit, check=fit)
    check = _check(_compared_scores(posterior, ratings, np.random.default_rng(SEED)))
    return Checked(fit=check.refusal or fit, check=check)


def checked_two_stage(trials: AnsweredTrials) -> Checked[TwoStageSensitivity]:
    """Return M3 with its check: answers by condition and by subject, scores as for M2.

    The scores are those of the changes that were noticed in the study.
    """
    first = first_stage(trials)
    if isinstance(first, NotEstimable):
        return Checked(fit=first, check=first)
    rng = np.random.default_rng(SEED)
    answers, noticed = _compared_answers(first, trials, rng), first.told
    del first  # its posterior takes much memory
    found = two_stage_posterior(trials, noticed, fitted)
    summary = found.summary
    if isinstance(summary, NotEstimable):
        return Checked(fit=summary, check=summary)
    scores = _compared_scores(found.rating.posterior, found.rating.ratings, rng)
    check = _check(answers | scores)
    return Checked(fit=check.refusal or summary, check=check)


Distances: TypeAlias = dict[str, FloatArray]
"""How far the study and its replicate depart from what each draw expects, by statistic, (2, draws).

They are those of (30), mathematics/sensitivity.
"""


def _compared_scores(
    posterior: ordinal_model.OrdinalPosterior, ratings: Ratings, rng: np.random.Generator
) -> Distances:
    trials, known, axes = ratings.given, posterior.ready.trials, posterior.ready.axes
    count = _draws(len(trials.rating))
    draws = posterior.latent.draws(count, rng)
    streams = _streams(rng, 3, count * len(trials.rating))
    x = (trials.contrast - axes.x_mean) / axes.x_sd
    given = np.unique(trials.rating, return_inverse=True)[1]

    def compared(part: LatentDraws) -> Distances:
        lines = part.own + part.shared[:, None, known.line_columns]
        place = lines[:, trials.subject, 0] + lines[:, trials.subject, 1] * x
        if known.conditions:
            place += part.shared[:, known.line_columns.stop :][:, trials.condition]
        # The normal approximation allows thresholds out of order.
        edges = np.sort(known.edges(part.shared)[:, 1:-1], axis=1)
        below = [ndtr((edge[:, None] - place) / part.residual_sd[:, None]) for edge in edges.T]
        return _tables("scores", trials, given, below, streams[0]) | {
            "spread of scores by subject": _spread(trials, given, below, streams[1]),
            "share of the highest score": _share(given == given.max(), 1 - below[-1], streams[2]),
        }

    return _in_parts(compared, draws, len(given))


def _compared_answers(
    noticed: Noticing, trials: AnsweredTrials, rng: np.random.Generator
) -> Distances:
    known, ratings = noticed.trials, trials.ratings
    sign = np.sign(ratings.contrast)
    # Trials with the change, without it and with its opposite count as different conditions.
    kinds = replace(
        ratings,
        condition=3 * ratings.condition + sign.astype(np.int64) + 1,
        conditions=tuple(f"{name} {kind}" for name in ratings.conditions for kind in "-0+"),
    )

    def compared(part: LatentDraws) -> Distances:
        lines = part.own + part.shared[:, None, known.line_columns]
        criterion, slope = np.moveaxis(lines[:, ratings.subject], -1, 0)
        criterion = np.maximum(criterion, 0.0)
        felt = LEAN * part.shared[:, [0]] + slope * (ratings.contrast / noticed.reference)
        if known.conditions:
            felt += sign * part.shared[:, known.line_columns.stop :][:, ratings.condition]
        lower = np.where(trials.two_sided, ndtr(-criterion - felt), 0.0)
        return _tables("answers", kinds, trials.answer + 1, [lower, ndtr(criterion - felt)], rng)

    draws = noticed.posterior.draws(_draws(len(trials.answer)), rng)
    return _in_parts(compared, draws, len(trials.answer))


def _streams(rng: np.random.Generator, count: int, size: int) -> list[np.random.Generator]:
    """Return generators that yield the next numbers of `rng`, `size` each, and skip them in it."""
    bits = rng.bit_generator
    assert isinstance(bits, np.random.PCG64)
    found = []
    for _ in range(count):
        found.append(np.random.Generator(deepcopy(bits)))
        bits.advance(size)
    return found


def _in_parts(
    compared: Callable[[LatentDraws], Distances], draws: LatentDraws, trials: int
) -> Distances:
    """Compare few draws at a time, so that memory does not grow with the number of draws."""
    at_once = max(CELLS // trials, 1)
    parts = [
        compared(draws.part(slice(first, first + at_once)))
        for first in range(0, len(draws.residual_sd), at_once)
    ]
    return {name: np.hstack([part[name] for part in parts]) for name in parts[0]}


def _tables(
    name: str, trials: Ratings, given: IntArray, below: list[FloatArray], rng: np.random.Generator
) -> Distances:
    """Return the distances of counts by condition and by subject from those expected.

    `below` has the probability of each category or a lower one, (draws, trials), but for the last.
    """
    drawn, categories = _drawn(below, rng), len(below) + 1
    found = {}
    for of, group in (("condition", trials.condition), ("subject", trials.subject)):
        present, place = np.unique(group, return_inverse=True)
        sizes = np.bincount(place)
        sums = [_sums(each, place, len(present)) for each in below]
        ends = np.stack([0.0 * sums[0], *sums, 0.0 * sums[0] + sizes], axis=-1)
        expected = np.diff(ends, axis=-1).reshape(len(drawn), -1)
        found[f"{name} by {of}"] = np.stack(
            [
                _distance(_counts(scores, place * categories, expected.shape[1]), expected)
                for scores in (given[None], drawn)
            ]
        )
    return found


def _distance(found: FloatArray | IntArray, expected: FloatArray) -> FloatArray:
    return np.asarray((((found - expected) ** 2) / (expected + 0.5)).sum(axis=1))


def _sums(values: FloatArray, group: IntArray, groups: int) -> FloatArray:
    """Return the sums of values (draws, trials) over each group of trials, (draws, groups)."""
    cells = np.arange(len(values))[:, None] * groups + group
    sums = np.bincount(cells.ravel(), values.ravel(), minlength=len(values) * groups)
    return np.asarray(sums.reshape(len(values), groups))


def _counts(scores: IntArray, first: IntArray, cells: int) -> IntArray:
    """Return how often each category occurs in each group; `first` is the group's first cell."""
    places = np.arange(len(scores))[:, None] * cells + first + scores
    return np.bincount(places.ravel(), minlength=len(scores) * cells).reshape(len(scores), cells)


def _spread(
    trials: Ratings, given: IntArray, below: list[FloatArray], rng: np.random.Generator
) -> FloatArray:
    """Return the distance of each subject's squared residuals, in categories, from expected."""
    present, place = np.unique(trials.subject, return_inverse=True)
    mean, square = np.zeros(below[0].shape), np.zeros(below[0].shape)
    for k, each in enumerate(below):  # (31), mathematics/sensitivity
        mean += 1 - each
        square += (2 * k + 1) * (1 - each)
    expected = _sums(square - mean**2, place, len(present))
    return np.stack(
        [
            _distance(_sums((scores - mean) ** 2, place, len(present)), expected)
            for scores in (given, _drawn(below, rng))
        ]
    )


def _drawn(below: list[FloatArray], rng: np.random.Generator) -> IntArray:
    """Return a category for each draw and trial."""
    chance = rng.random(below[0].shape)
    drawn = np.zeros(chance.shape, dtype=np.int64)
    for each in below:
        drawn += chance > each
    return drawn


def _share(given: BoolArray, probability: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return how far the share of an answer departs from the one expected."""
    expected = probability.mean(axis=1)
    drawn = (rng.random(probability.shape) < probability).mean(axis=1)
    return np.asarray(np.abs(np.stack([given.mean() - expected, drawn - expected])))


def _draws(trials: int) -> int:
    return MOST_DRAWS if trials <= LARGE else LARGE_DRAWS


def _check(compared: Distances) -> PredictiveCheck:
    # (32), mathematics/sensitivity
    p = [
        float(1 + (replicated >= observed).sum()) / (1 + len(observed))
        for observed, replicated in compared.values()
    ]
    return PredictiveCheck(
        draws=min(each.shape[1] for each in compared.values()),
        statistics=tuple(
            PredictiveStatistic(
                name=name,
                observed=float(np.median(observed)),
                predicted=float(np.median(replicated)),
                predicted_interval=central(replicated),
                p=of_draws,
                p_holm=adjusted,
            )
            for (name, (observed, replicated)), of_draws, adjusted in zip(
                compared.items(), p, holm(p), strict=True
            )
        ),
    )
