"""How well a law explains who felt what, by the largest likelihood of M1."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.optimize import minimize

from analysis.estimates import FloatArray, Interval, NotEstimable
from analysis.sensitivity.linear_model import LineSums, line_posterior, line_sums, without_noise
from analysis.sensitivity.lines import axes_of, covariance_matrices
from analysis.sensitivity.ratings import Ratings
from analysis.statistics.signed_rank import DECIMALS
from analysis.trials.law_assignments import PredictionError, assignment_p, prediction_error

# The best is sought between these standard deviations, in those of the ratings, and artanh ρ.
NOISE, SPREAD, CORRELATION = (float(np.exp(-8)), 3e3), (1e-6, 3e3), (-8.0, 8.0)


def shared_contrasts(ratings: Ratings, contrast: FloatArray) -> bool:
    """Whether all subjects have the same contrasts under the same conditions.

    A subject who broke off may lack some of them.
    """
    if not len(contrast):
        return False
    trials = np.stack([ratings.subject, ratings.condition, np.round(contrast, DECIMALS)])
    own = np.unique(trials, axis=1)
    return len(np.unique(own[1:], axis=1).T) == int(np.unique(own[0], return_counts=True)[1].max())


@dataclass(frozen=True, kw_only=True)
class LawLikelihood:
    """How well a law explains who felt what, all laws given the same freedom.

    `log_likelihood` is the largest of M1 with the law's contrasts; `gain_over_none` is by how
    much it exceeds that of subjects who differ in level alone, not penalised for the law's three
    parameters more. `gain_p` is the share of all assignments of the contrasts to the conditions
    that gain as much, see `assignment_p`. Trials of the same condition are not independent, so the
    log-likelihoods are no evidence for a law; `gain_p` and `prediction_error` count conditions.
    """

    log_likelihood: float
    gain_over_none: float
    gain_p: float | NotEstimable
    prediction_error: PredictionError | NotEstimable


def law_likelihoods(
    ratings: Ratings, contrasts: Mapping[str, FloatArray], scale: Interval
) -> dict[str, LawLikelihood | NotEstimable]:
    """Return for each law how well its contrasts explain the ratings, by name.

    Parameters:
        ratings: the trials; their own contrasts are not used.
        contrasts: by law, shape (trials,), the contrast it predicts under each participant's own
            settings.
        scale: lowest and highest possible rating.

    Raises:
        ValueError: another number of contrasts than of trials.
    """
    scored = ~np.isnan(ratings.rating)
    results: dict[str, LawLikelihood | NotEstimable] = {}
    for law, contrast in contrasts.items():
        if contrast.shape != ratings.rating.shape:
            raise ValueError(f"{law} needs {ratings.rating.size} contrasts, got {contrast.size}")
        results[law] = _law_likelihood(ratings.where(scored), contrast[scored], scale)
    return results


def _law_likelihood(
    trials: Ratings, contrast: FloatArray, scale: Interval
) -> LawLikelihood | NotEstimable:
    axes = axes_of(replace(trials, contrast=contrast))
    if isinstance(axes, NotEstimable):
        return axes
    x = (contrast - axes.x_mean) / axes.x_sd
    y = (trials.rating - axes.y_mean) / axes.y_sd
    sums = line_sums(trials.subject, len(trials.subjects), x, y)
    if refusal := without_noise(sums):
        return refusal
    unit = len(y) * np.log(axes.y_sd)
    with_law = _largest(sums) - unit
    without = _largest_level(trials, y) - unit
    return LawLikelihood(
        log_likelihood=float(with_law),
        gain_over_none=float(with_law - without),
        gain_p=assignment_p(trials, contrast),
        prediction_error=prediction_error(trials, contrast, scale),
    )


def _largest(sums: LineSums) -> float:
    """Return the largest log-likelihood of partially pooled lines, population line included."""

    def cost(point: FloatArray) -> float:
        spread = np.append(np.log(point[1:3]), point[3])
        known = line_posterior(sums, point[:1], covariance_matrices(spread[None]))
        return -float(known.profile[0])

    return -_smallest(cost, [NOISE, SPREAD, SPREAD, CORRELATION], [0.6, 0.5, 0.5, 0.0])


def _largest_level(trials: Ratings, y: FloatArray) -> float:
    """Return the largest log-likelihood of subjects who differ in level alone."""
    counts = np.bincount(trials.subject, minlength=len(trials.subjects)).astype(np.float64)
    sums = np.bincount(trials.subject, weights=y, minlength=len(counts))
    squares = float((y**2).sum())

    def cost(point: FloatArray) -> float:
        noise, level = point**2
        weight = counts / (noise + counts * level)
        mean = (sums / (noise + counts * level)).sum() / weight.sum()
        within = squares - 2 * mean * sums.sum() + mean**2 * counts.sum()
        shrunk = level / (noise + counts * level) * (sums - counts * mean) ** 2
        log_det = counts.sum() * np.log(noise) + np.log1p(counts * level / noise).sum()
        quadratic = (within - shrunk.sum()) / noise
        return float(log_det + quadratic + counts.sum() * np.log(2 * np.pi)) / 2

    return -_smallest(cost, [NOISE, SPREAD], [0.6, 0.5])


def _smallest(
    cost: Callable[[FloatArray], float], bounds: Sequence[Interval], start: Sequence[float]
) -> float:
    """Return the smallest cost of standard deviations, and of a correlation that may follow them.

    Those that are best at 0 end at their bound, which a search of their logarithms only nears; and
    slopes by one-sided differences would let it stop elsewhere on every processor.
    """
    search = partial(
        minimize,
        cost,
        jac="3-point",
        method="L-BFGS-B",
        bounds=bounds,
        options={"ftol": 1e-15, "gtol": 1e-9},
    )
    small = [min(value, 0.05) for value in start]
    return min(float(search(np.array(begin)).fun) for begin in (start, small))
