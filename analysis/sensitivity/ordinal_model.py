"""M2: ordinal mixed model of ratings, with thresholds, a ceiling and condition effects."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from analysis.estimates import BoolArray, FloatArray, IntArray, Interval, NotEstimable
from analysis.sensitivity.curvature import OrdinalTrials, counted
from analysis.sensitivity.integration import Marginals, WeightedPoints, weighted_points
from analysis.sensitivity.laplace import Components, LatentField, LatentModes
from analysis.sensitivity.lines import (
    Axes,
    LineMixture,
    Lines,
    axes_of,
    covariance_matrices,
    log_prior_of_spread,
    spread_of,
    summary,
    turn_of,
)
from analysis.sensitivity.marginals import marginals
from analysis.sensitivity.ratings import Ratings

# A study of few trials leaves the variance components uncertain, so that it needs more points to
# integrate over them; each costs less.
FEWEST_POINTS, MOST_POINTS = 400, 2000
POINTS_BY_TRIALS = 6e7
# Modes are foreseen by a parabola, up to this distance from the middle of the known ones.
FARTHEST = 2.5
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
    `effective_points` is the effective sample size of the integration over variance components.
    """

    lines: Lines
    residual_sd: float
    categories: tuple[str, ...]
    thresholds: tuple[float, ...]
    discrepancies: Mapping[str, Estimate]
    effective_points: float


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

    trials: OrdinalTrials
    points: WeightedPoints

    modes: LatentModes

    @property
    def residual_sds(self) -> FloatArray:
        """σ at each point, in standard units of the ratings."""
        return np.asarray(np.exp(self.points.points[:, 0]))

    def marginals(self, combinations: FloatArray) -> Marginals:
        """Return posteriors of combinations (quantities, parameters) of the latent parameters."""
        points = self.points
        return marginals(self.trials, self.modes, points.points, points.weights, combinations)

    def of_lines(self, of_line: FloatArray) -> FloatArray:
        """Return combinations: of_line · line of each subject and, last, of the population."""
        subjects, size = self.trials.subjects, len(self.trials.shared_start)
        rows = np.zeros((subjects + 1, size + 2 * subjects))
        rows[:, self.trials.line_columns] = of_line
        rows[:-1, size:] = np.kron(np.eye(subjects), of_line)
        return rows


def ordinal_sensitivity(ratings: Ratings) -> OrdinalSensitivity | NotEstimable:
    """Return bias and gain of each subject on the latent scale, or why they are not estimable.

    latent = α_s + g_s x + δ_c + ε, ε ~ N(0, σ²); a rating is given when the latent value lies
    between its two thresholds, which all subjects share. The outermost thresholds are fixed midway
    between the two lowest and the two highest ratings given, so that bias and gain are in rating
    points and comparable with M1. δ_c ~ N(0, τ_δ²). Priors are those of M1, half-Cauchy for σ and
    τ_δ, and a very wide normal prior for thresholds and population that only keeps them finite.
    Given σ, T and τ_δ, the posterior of the rest is approximated about its mode, as normal but for
    its skewness; over these three it is integrated (nested Laplace approximation: Rue, Martino and
    Chopin, Journal of the Royal Statistical Society B 71, 2009).
    """
    ready = prepared_ratings(ratings)
    return ready if isinstance(ready, NotEstimable) else fitted(ready, latent_posterior(ready))


def prepared_ratings(ratings: Ratings) -> PreparedTrials | NotEstimable:
    """Return the rated trials, each different rating being a category, or why they set no scale."""
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
    return prepared(trials, np.asarray(category), scale, axes)


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
    start = START if ready.trials.conditions else START[:-1]
    known = start[None], field.modes(_components(start[None]), field.start(1))

    def log_posterior(points: FloatArray) -> FloatArray:
        nonlocal known
        modes = field.modes(_components(points), _foreseen(field, known, points))
        known = points, modes
        return modes.log_evidence + _log_prior(points)

    wanted = int(POINTS_BY_TRIALS / len(ready.trials.x) ** 2)
    count = min(max(wanted, FEWEST_POINTS), MOST_POINTS)
    points = weighted_points(log_posterior, start, count)
    # The last evaluation was at the returned points, so these are their modes.
    return LatentPosterior(trials=ready.trials, points=points, modes=known[1])


def _foreseen(
    field: LatentField, known: tuple[FloatArray, LatentModes], points: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return starts for the search of the modes at `points`, linear in those that are known."""
    centre = known[0].mean(axis=0)
    design, wanted = (_polynomial(part - centre) for part in (known[0], points))
    columns = design.shape[1] if len(known[0]) > 2 * design.shape[1] else 1 + points.shape[1]
    plane = np.linalg.lstsq(design[:, :columns], known[1].parameters, rcond=1e-6)[0]
    found, size = wanted[:, :columns] @ plane, known[1].shared.shape[1]
    in_order = field.trials.in_order(found[:, :size])
    found = np.where(in_order[:, None], found, known[1].parameters.mean(axis=0))
    return found[:, :size], found[:, size:].reshape(len(points), -1, 2)


def _polynomial(away: FloatArray) -> FloatArray:
    """Return 1, the distances, limited, and their products of two."""
    near = np.clip(away, -FARTHEST, FARTHEST)
    one, other = np.triu_indices(near.shape[1])
    return np.column_stack([np.ones(len(near)), near, near[:, one] * near[:, other]])


def _components(points: FloatArray) -> Components:
    return Components(
        residual_sd=np.exp(points[:, 0]),
        between=covariance_matrices(points[:, 1:4]),
        discrepancy_sd=np.exp(points[:, 4]) if points.shape[1] > 4 else np.ones(len(points)),
    )


def _log_prior(points: FloatArray) -> FloatArray:
    spread = log_prior_of_spread(points[:, 1:3]).sum(axis=1)
    others = np.delete(points, [1, 2, 3], axis=1)
    half_cauchy = (others - np.log1p(np.exp(2 * others))).sum(axis=1)
    return np.asarray(spread + half_cauchy - 2 * np.log(np.cosh(points[:, 3])))


def fitted(ready: PreparedTrials, known: LatentPosterior) -> OrdinalSensitivity:
    """Return lines, thresholds and discrepancies of the posterior, in rating points."""
    points, trials, axes = known.points, ready.trials, ready.axes
    bias, gain = turn_of(axes)
    lines, first = trials.subjects + 1, len(trials.shared_start) - trials.conditions
    effects = axes.y_sd * np.eye(trials.conditions, known.modes.parameters.shape[1], first)
    found = known.marginals(np.vstack([known.of_lines(bias), known.of_lines(gain), effects]))
    mixture = LineMixture(
        weights=points.weights,
        bias=found.part(slice(lines)).plus(axes.y_mean),
        gain=found.part(slice(lines, 2 * lines)),
        spread=spread_of(covariance_matrices(points.points[:, 1:4]), axes),
    )
    counts = np.bincount(trials.subject, weights=trials.weight, minlength=trials.subjects)
    thresholds = trials.edges((points.weights @ known.modes.shared)[None])[0, 1:-1]
    return OrdinalSensitivity(
        lines=summary(ready.subjects, counts.astype(np.float64), mixture),
        residual_sd=float(points.mean(known.residual_sds)) * axes.y_sd,
        categories=ready.categories,
        thresholds=tuple((axes.y_mean + axes.y_sd * thresholds).tolist()),
        discrepancies=_discrepancies(ready, points.weights, found.part(slice(2 * lines, None))),
        effective_points=points.effective,
    )


def _discrepancies(
    ready: PreparedTrials, weights: FloatArray, found: Marginals
) -> dict[str, Estimate]:
    if not ready.trials.conditions:
        return {}
    values, intervals = (weights @ found.means).tolist(), found.interval_95(weights)
    return {
        name: Estimate(value=value, interval=interval)
        for name, value, interval in zip(ready.conditions, values, intervals, strict=True)
    }
