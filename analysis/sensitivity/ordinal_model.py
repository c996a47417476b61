"""M2: M1 behind the rating scale, with its steps, its ceiling and what conditions add."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from analysis.estimates import FloatArray, Interval, NotEstimable
from analysis.loading.score_table import BoolArray
from analysis.sensitivity.curvature import OrdinalTrials, counted
from analysis.sensitivity.integration import (
    WeightedPoints,
    intervals_95,
    mixture_mean,
    weighted_points,
)
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
from analysis.sensitivity.ratings import IntArray, Ratings

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

    `thresholds` lie between the `categories`, from the lowest up; `discrepancies` are what each
    condition adds to the rating beyond its predicted contrast, empty with fewer than three
    conditions.
    """

    lines: Lines
    residual_sd: float
    categories: tuple[str, ...]
    thresholds: tuple[float, ...]
    discrepancies: Mapping[str, Estimate]


@dataclass(frozen=True, kw_only=True, eq=False)
class Scale:
    """Names of the ordered answers, thresholds between them, and which of those are held."""

    categories: tuple[str, ...]
    edges: FloatArray
    held: BoolArray


@dataclass(frozen=True, kw_only=True, eq=False)
class PreparedTrials:
    """Trials ready to be fitted, with the names and units in which the result is told."""

    subjects: tuple[str, ...]
    conditions: tuple[str, ...]
    categories: tuple[str, ...]
    axes: Axes
    trials: OrdinalTrials


@dataclass(frozen=True, kw_only=True, eq=False)
class LatentPosterior:
    """Weighted points (log σ, log τ_bias, log τ_gain, artanh ρ, log τ_δ), the mode at each."""

    points: WeightedPoints
    modes: tuple[LatentMode, ...]

    @property
    def residual_sds(self) -> FloatArray:
        """σ at each point, in standard units of the ratings."""
        return np.asarray(np.exp(self.points.points[:, 0]))


def ordinal_sensitivity(ratings: Ratings) -> OrdinalSensitivity | NotEstimable:
    """Return bias and gain of each subject on the scale behind the ratings, or why not.

    latent = α_s + g_s x + δ_c + ε, ε ~ N(0, σ²); a rating is given when the latent value lies
    between two thresholds that all subjects share. The outermost thresholds are held midway
    between the two lowest and the two highest ratings given, so that bias and gain are in rating
    points and compare with M1. δ_c ~ N(0, τ_δ²). Priors are those of M1, half-Cauchy for σ
    and τ_δ, and for thresholds and population a normal one so wide that it only keeps them finite.
    Given σ, T and τ_δ the posterior of the rest is taken as normal about its mode; over those it
    is integrated (nested Laplace approximation: Rue, Martino and Chopin, Journal of the Royal
    Statistical Society B 71, 2009).
    """
    trials = ratings.given
    axes = axes_of(trials)
    if isinstance(axes, NotEstimable):
        return axes
    values, category = np.unique(trials.rating, return_inverse=True)
    if len(values) < 3:
        return NotEstimable(
            reason="two different ratings give the latent scale no unit, at least 3 are needed"
        )
    edges = (values[1:] + values[:-1]) / 2
    held = np.isin(np.arange(len(edges)), [0, len(edges) - 1])
    names = tuple(f"{value:g}" for value in values)
    scale = Scale(categories=names, edges=edges, held=held)
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
            free=~scale.held,
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
    # The last points asked for are those returned, so that their modes are known already.
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
    """Return what the posterior says of lines, thresholds and discrepancies, in rating points."""
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
    shared = mixture_mean(posterior.weights, np.array([mode.shared for mode in modes]))
    thresholds = axes.y_mean + axes.y_sd * trials.edges(shared)[1:-1]
    return OrdinalSensitivity(
        lines=summary(ready.subjects, counts.astype(np.float64), mixture, axes),
        residual_sd=float(posterior.mean(np.exp(posterior.points[:, 0]))) * axes.y_sd,
        categories=ready.categories,
        thresholds=tuple(thresholds.tolist()),
        discrepancies=_discrepancies(ready, posterior.weights, modes),
    )


def _line_posterior(mode: LatentMode, columns: slice) -> tuple[FloatArray, FloatArray]:
    """Return mean and covariance of each subject's line and, last, of the population's."""
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
    values = mixture_mean(weights, means).tolist()
    return {
        name: Estimate(value=value, interval=interval)
        for name, value, interval in zip(
            ready.conditions, values, intervals_95(weights, means, sds), strict=True
        )
    }
