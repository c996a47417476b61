"""M2: ordinal mixed model of ratings, with thresholds, a ceiling and condition effects."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from analysis.estimates import BoolArray, FloatArray, IntArray, Interval, NotEstimable
from analysis.sensitivity.curvature import OrdinalTrials, counted
from analysis.sensitivity.integration import WeightedPoints, intervals_95, weighted_points
from analysis.sensitivity.laplace import Components, LatentField, LatentMode
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

POINTS = 60
# log σ, log τ_bias, log τ_gain, artanh ρ and log τ_discrepancy.
START = np.array([-0.5, -0.7, -0.7, 0.0, -1.5])
FEWEST_CONDITIONS = 3


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A posterior mean with its 95 % interval."""

    value: float
    interval: Interval


@dataclass(frozen=True, kw_only=True)
class OrdinalSensitivity:
    """The fit of M2 (or M3), in rating points.

    `thresholds` lie between the `categories`, from the lowest up; `discrepancies` are the effects
    of conditions beyond their predicted contrasts, empty with fewer than three conditions.
    """

    lines: Lines
    residual_sd: float
    categories: tuple[str, ...]
    thresholds: tuple[float, ...]
    discrepancies: Mapping[str, Estimate]


@dataclass(frozen=True, kw_only=True, eq=False)
class Scale:
    """Names of the ordered answers, the thresholds between them, and which of those are fixed."""

    categories: tuple[str, ...]
    edges: FloatArray
    fixed: BoolArray


@dataclass(frozen=True, kw_only=True, eq=False)
class PreparedTrials:
    """Trials in standard units, with the names and units of the result."""

    subjects: tuple[str, ...]
    conditions: tuple[str, ...]
    categories: tuple[str, ...]
    axes: Axes
    trials: OrdinalTrials


@dataclass(frozen=True, kw_only=True, eq=False)
class LatentPosterior:
    """Weighted points (log σ, log τ_bias, log τ_gain, artanh ρ, log τ_δ) and the mode at each."""

    points: WeightedPoints
    modes: tuple[LatentMode, ...]

    @property
    def residual_sds(self) -> FloatArray:
        """σ at each point, in standard units of the ratings."""
        return np.asarray(np.exp(self.points.points[:, 0]))


def ordinal_sensitivity(ratings: Ratings) -> OrdinalSensitivity | NotEstimable:
    """Return bias and gain of each subject on the latent scale, or why they are not estimable.

    latent = α_s + g_s x + δ_c + ε, ε ~ N(0, σ²); a rating is given when the latent value lies
    between its two thresholds, which all subjects share. The outermost thresholds are fixed midway
    between the two lowest and the two highest ratings given, so that bias and gain are in rating
    points and comparable with M1. δ_c ~ N(0, τ_δ²). Priors are those of M1, half-Cauchy for σ and
    τ_δ, and a very wide normal prior for thresholds and population that only keeps them finite.
    Given σ, T and τ_δ, the posterior of the rest is approximated as normal about its mode; over
    these three it is integrated (nested Laplace approximation: Rue, Martino and Chopin, Journal of
    the Royal Statistical Society B 71, 2009).
    """
    trials = ratings.given
    axes = axes_of(trials)
    if isinstance(axes, NotEstimable):
        return axes
    values, category = np.unique(trials.rating, return_inverse=True)
    if len(values) < 3:
        return NotEstimable(
            "two different ratings do not set the unit of the latent scale, at least 3 are needed"
        )
    edges = (values[1:] + values[:-1]) / 2
    fixed = np.isin(np.arange(len(edges)), [0, len(edges) - 1])
    names = tuple(f"{value:g}" for value in values)
    scale = Scale(categories=names, edges=edges, fixed=fixed)
    ready = prepared(trials, np.asarray(category), scale, axes)
    return fitted(ready, latent_posterior(ready))


def prepared(trials: Ratings, category: IntArray, scale: Scale, axes: Axes) -> PreparedTrials:
    """Return the trials in standard units, with equal ones counted."""
    x = (trials.contrast - axes.x_mean) / axes.x_sd
    rows, weight = counted(np.stack([trials.subject, trials.condition, x, category], axis=-1))
    used = len(np.unique(trials.condition))
    return PreparedTrials(
        subjects=trials.subjects,
        conditions=trials.conditions,
        categories=scale.categories,
        axes=axes,
        trials=OrdinalTrials(
            subjects=len(trials.subjects),
            conditions=len(trials.conditions) if used >= FEWEST_CONDITIONS else 0,
            subject=rows[:, 0].astype(np.int64),
            condition=rows[:, 1].astype(np.int64),
            x=rows[:, 2],
            category=rows[:, 3].astype(np.int64),
            weight=weight,
            thresholds=(scale.edges - axes.y_mean) / axes.y_sd,
            free=~scale.fixed,
        ),
    )


def latent_posterior(ready: PreparedTrials) -> LatentPosterior:
    """Return the posterior of prepared trials, discretised in σ, T and τ_δ."""
    field = LatentField(ready.trials)
    modes = [field.mode(_components(START), field.start())]

    def log_posterior(points: FloatArray) -> FloatArray:
        nonlocal modes
        latest, found = modes[0], []
        for point in points:
            latest = field.mode(_components(point), (latest.shared, latest.own))
            found.append(latest)
        modes = found
        evidence = np.array([mode.log_evidence for mode in found])
        return np.asarray(evidence + [_log_prior(point) for point in points])

    start = START if ready.trials.conditions else START[:-1]
    posterior = weighted_points(log_posterior, start, POINTS)
    # The last evaluation was at the returned points, so `modes` are their modes.
    return LatentPosterior(points=posterior, modes=tuple(modes))


def _components(point: FloatArray) -> Components:
    return Components(
        residual_sd=float(np.exp(point[0])),
        between=covariance_matrices(point[None, 1:4])[0],
        discrepancy_sd=float(np.exp(point[4])) if len(point) > 4 else 1.0,
    )


def _log_prior(point: FloatArray) -> float:
    spread = log_prior_of_spread(point[1:3]).sum()
    others = np.delete(point, [1, 2, 3])
    half_cauchy = (others - np.log1p(np.exp(2 * others))).sum()
    return float(spread + half_cauchy - 2 * np.log(np.cosh(point[3])))


def fitted(ready: PreparedTrials, known: LatentPosterior) -> OrdinalSensitivity:
    """Return lines, thresholds and discrepancies of the posterior, in rating points."""
    posterior, modes = known.points, known.modes
    trials, axes = ready.trials, ready.axes
    lines = [_line_posterior(mode, trials.line_columns) for mode in modes]
    mixture = LineMixture(
        weights=posterior.weights,
        means=np.array([means for means, _ in lines]),
        covariances=np.array([covariances for _, covariances in lines]),
        between=covariance_matrices(posterior.points[:, 1:4]),
    )
    counts = np.bincount(trials.subject, weights=trials.weight, minlength=trials.subjects)
    shared = posterior.weights @ np.array([mode.shared for mode in modes])
    thresholds = axes.y_mean + axes.y_sd * trials.edges(shared)[1:-1]
    return OrdinalSensitivity(
        lines=summary(ready.subjects, counts.astype(np.float64), mixture, axes),
        residual_sd=float(posterior.mean(known.residual_sds)) * axes.y_sd,
        categories=ready.categories,
        thresholds=tuple(thresholds.tolist()),
        discrepancies=_discrepancies(ready, posterior.weights, modes),
    )


def _line_posterior(mode: LatentMode, columns: slice) -> tuple[FloatArray, FloatArray]:
    """Return mean and covariance of each subject's line and, last, the population's."""
    curvature = mode.curvature
    shared = np.linalg.inv(curvature.shared_precision)
    pick = np.zeros((2, len(mode.shared)))
    pick[:, columns] = np.eye(2)
    reach = pick - np.linalg.solve(curvature.own_precision, curvature.cross)
    own = np.linalg.inv(curvature.own_precision) + reach @ shared @ np.swapaxes(reach, 1, 2)
    line = mode.shared[columns]
    return np.vstack([mode.own + line, line]), np.concatenate([own, (pick @ shared @ pick.T)[None]])


def _discrepancies(
    ready: PreparedTrials, weights: FloatArray, modes: tuple[LatentMode, ...]
) -> dict[str, Estimate]:
    if not ready.trials.conditions:
        return {}
    first, unit = ready.trials.line_columns.stop, ready.axes.y_sd
    means = unit * np.array([mode.shared[first:] for mode in modes])
    inverses = [np.linalg.inv(mode.curvature.shared_precision) for mode in modes]
    sds = unit * np.sqrt([np.diag(inverse)[first:] for inverse in inverses])
    values, intervals = (weights @ means).tolist(), intervals_95(weights, means, sds)
    return {
        name: Estimate(value=value, interval=interval)
        for name, value, interval in zip(ready.conditions, values, intervals, strict=True)
    }
