"""M1: ratings that rise with the predicted contrast along a line of each person's own."""

from dataclasses import dataclass

import numpy as np

from analysis.no_answer import NoAnswer
from analysis.scores import FloatArray
from analysis.sensitivity.integration import WeightedPoints, weighted_points
from analysis.sensitivity.linear_likelihood import LineSums, line_posterior, line_sums
from analysis.sensitivity.lines import (
    Axes,
    LineMixture,
    Lines,
    axes_of,
    covariance_matrices,
    log_prior_of_spread,
    summary,
)
from analysis.sensitivity.ratings import Ratings

POINTS = 200
# log σ, log τ_bias, log τ_gain and artanh ρ, in standard deviations of the ratings.
START = np.array([-0.5, -0.7, -0.7, 0.0])


@dataclass(frozen=True, kw_only=True)
class LinearSensitivity:
    """The fit of M1: per-subject and population lines, and how much noise is about them."""

    lines: Lines
    residual_sd: float


def linear_sensitivity(ratings: Ratings) -> LinearSensitivity | NoAnswer:
    """Return each subject's bias and gain by partial pooling, or why there are none.

    y = α_s + g_s x + ε, (α_s, g_s) ~ N((α, g), T), ε ~ N(0, σ²). α and g have flat priors, σ has
    one flat in log σ, the standard deviations in T that of `log_prior_of_spread`, their
    correlation a uniform one. Intervals are integrated over σ and T, not taken at their best
    values.

    The model knows no ceiling: where many ratings are the largest possible, gains come out too
    small. `ordinal_sensitivity` is for such ratings.
    """
    trials = ratings.given
    axes = axes_of(trials)
    if isinstance(axes, NoAnswer):
        return axes
    sums = _standardised_sums(trials, axes)
    if not _has_residual(trials, sums):
        return NoAnswer(
            reason="each subject's ratings lie on a line of their own, no residual is left to "
            "tell noise from differences between subjects"
        )
    posterior = weighted_points(lambda points: _log_posterior(points, sums), START, POINTS)
    return _result(ratings, sums, posterior, axes)


def _standardised_sums(trials: Ratings, axes: Axes) -> LineSums:
    x = (trials.contrast - axes.x_mean) / axes.x_sd
    y = (trials.rating - axes.y_mean) / axes.y_sd
    return line_sums(trials.subject, len(trials.subjects), x, y)


def _has_residual(trials: Ratings, sums: LineSums) -> bool:
    """Whether some subject's ratings depart from the subject's own least-squares line."""
    lines = np.linalg.pinv(sums.gram, rcond=1e-9, hermitian=True) @ sums.products[..., None]
    explained = (sums.products * lines[..., 0]).sum(axis=1)
    return bool((sums.squares - explained).sum() > 1e-9 * len(trials.rating))


def _components(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return σ and T of points (log σ, log τ_bias, log τ_gain, artanh ρ)."""
    return np.exp(points[:, 0]), covariance_matrices(points[:, 1:4])


def _log_posterior(points: FloatArray, sums: LineSums) -> FloatArray:
    residual_sd, between = _components(points)
    prior = log_prior_of_spread(points[:, 1:3]).sum(axis=1) - 2 * np.log(np.cosh(points[:, 3]))
    return np.asarray(line_posterior(sums, residual_sd, between).log_likelihood + prior)


def _result(
    ratings: Ratings, sums: LineSums, posterior: WeightedPoints, axes: Axes
) -> LinearSensitivity:
    residual_sd, between = _components(posterior.points)
    known = line_posterior(sums, residual_sd, between)
    mixture = LineMixture(
        weights=posterior.weights,
        means=np.concatenate([known.means, known.population[:, None]], axis=1),
        covariances=np.concatenate([known.covariances, known.population_covariance[:, None]], 1),
        between=between,
    )
    return LinearSensitivity(
        lines=summary(ratings.subjects, sums.counts, mixture, axes),
        residual_sd=float(posterior.mean(residual_sd)) * axes.y_sd,
    )
