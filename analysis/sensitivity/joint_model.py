"""M3: joint model of change detection and rating, as ordered answers on one latent scale."""

from dataclasses import dataclass

import numpy as np

from analysis.estimates import FloatArray, IntArray, Interval, NotEstimable
from analysis.sensitivity.lines import axes_about
from analysis.sensitivity.ordinal_model import (
    LatentPosterior,
    OrdinalSensitivity,
    PreparedTrials,
    Scale,
    fitted,
    latent_posterior,
    prepared,
)
from analysis.sensitivity.ratings import Ratings

OPPOSITE, SAME, EXPECTED = -1, 0, 1


@dataclass(frozen=True, kw_only=True)
class ChangeDetection:
    """How well one subject detects the expected change, with 95 % intervals.

    `d_prime` is the distance between the reference contrast and none, in standard deviations of
    the noise; `criterion` is the latent value, in the same unit, above which the subject reports
    the expected change: the probability of a false alarm is Φ(-criterion).
    """

    subject: str
    d_prime: float
    d_prime_interval: Interval
    criterion: float
    criterion_interval: Interval


@dataclass(frozen=True, kw_only=True)
class JointSensitivity:
    """The fit of M3; d′ is at `reference_contrast`, the mean contrast of expected changes."""

    ratings: OrdinalSensitivity
    detection: tuple[ChangeDetection, ...]
    reference_contrast: float


def joint_sensitivity(ratings: Ratings, answer: IntArray) -> JointSensitivity | NotEstimable:
    """Return detection and rating of changes from one model, or why it is not possible.

    The answers are ordered: opposite to the expected change < same < expected change, rated low
    to high. They are the categories of M2's latent scale α_s + g_s x + δ_c + ε. So a score
    withheld because the answer disagreed counts as an answer instead of missing data, and catch
    (x = 0) and opposite (x < 0) trials separate bias from gain.

    Parameters:
        ratings: all trials, contrasts signed by the condition's expected direction.
        answer: shape (trials,), 1 the expected change, 0 the same, -1 the opposite change.

    Raises:
        ValueError: an invalid answer, or not one per trial.
    """
    _check_answers(ratings, answer)
    complete = (answer != EXPECTED) | ~np.isnan(ratings.rating)
    trials, answer = ratings.where(complete), answer[complete]
    if refusal := _refusal(trials, answer):
        return refusal
    scale, category = _scale(trials, answer)
    axes = axes_about(trials.contrast, trials.rating[answer == EXPECTED])
    ready = prepared(trials, category, scale, axes)
    posterior = latent_posterior(ready)
    reference = float(trials.contrast[trials.contrast > 0].mean())
    threshold = len(np.unique(answer[answer != EXPECTED])) - 1
    return JointSensitivity(
        ratings=fitted(ready, posterior),
        detection=_detection(ready, posterior, reference, threshold),
        reference_contrast=reference,
    )


def _check_answers(ratings: Ratings, answer: IntArray) -> None:
    if len(answer) != len(ratings.rating):
        raise ValueError(f"answers must have {len(ratings.rating)} trials, got {len(answer)}")
    other = answer[~np.isin(answer, [OPPOSITE, SAME, EXPECTED])]
    if other.size:
        raise ValueError(f"an answer must be -1, 0 or 1, got {other[0]}")


def _refusal(trials: Ratings, answer: IntArray) -> NotEstimable | None:
    if not (trials.contrast <= 0).any():
        return NotEstimable("the study has no catch or opposite trials with an answer")
    if not (trials.contrast > 0).any():
        return NotEstimable("no trial has an expected change")
    if (answer == EXPECTED).all():
        return NotEstimable("every answer was the expected change, even without one")
    different = len(np.unique(trials.rating[answer == EXPECTED]))
    if different < 3:
        return NotEstimable(f"at least 3 different ratings are needed, got {different}")
    return None


def _scale(trials: Ratings, answer: IntArray) -> tuple[Scale, IntArray]:
    """Return the ordered answers and each trial's position among them."""
    values = np.unique(trials.rating[answer == EXPECTED])
    between = (values[1:] + values[:-1]) / 2
    disagreeing = np.unique(answer[answer != EXPECTED])
    names = {OPPOSITE: "opposite", SAME: "same"}
    below = values[0] - np.arange(len(disagreeing), 0, -1.0)
    rated = np.searchsorted(values, trials.rating) + len(disagreeing)
    category = np.where(answer == EXPECTED, rated, np.searchsorted(disagreeing, answer))
    edges = np.concatenate([below, between])
    fixed = np.isin(np.arange(len(edges)), [len(below), len(edges) - 1])
    return Scale(
        categories=(*(names[int(a)] for a in disagreeing), *(f"{value:g}" for value in values)),
        edges=edges,
        fixed=fixed,
    ), category.astype(np.int64)


def _detection(
    ready: PreparedTrials, posterior: LatentPosterior, reference: float, threshold: int
) -> tuple[ChangeDetection, ...]:
    """Return each subject's d′ and criterion; `threshold` is that of the expected change."""
    slope = np.array([0.0, reference / ready.axes.x_sd])
    at_zero = np.array([1.0, -ready.axes.x_mean / ready.axes.x_sd])
    d_primes, d_intervals = _in_noise_units(posterior, slope, None)
    criteria, c_intervals = _in_noise_units(posterior, -at_zero, threshold)
    return tuple(
        ChangeDetection(
            subject=name,
            d_prime=float(d_primes[row]),
            d_prime_interval=d_intervals[row],
            criterion=float(criteria[row]),
            criterion_interval=c_intervals[row],
        )
        for row, name in enumerate(ready.subjects)
    )


def _in_noise_units(
    posterior: LatentPosterior, of_line: FloatArray, threshold: int | None
) -> tuple[FloatArray, list[Interval]]:
    """Return mean and interval of (threshold + of_line · line) / σ for each subject."""
    combinations = posterior.of_lines(of_line)[:-1]
    if threshold is not None:
        combinations[:, threshold] = 1.0
    found = posterior.marginals(combinations).over(posterior.residual_sds)
    weights = posterior.points.weights
    return weights @ found.means, found.interval_95(weights)
