"""M2: ordinal mixed model of ratings, with thresholds, a ceiling and condition effects."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial

import numpy as np
from scipy.special import ndtr

from analysis.estimates import Estimate, FloatArray, NotEstimable
from analysis.sensitivity import lines as of_lines
from analysis.sensitivity.curvature import OrdinalTrials, counted
from analysis.sensitivity.integration import Marginals, settled
from analysis.sensitivity.laplace import Components, LatentField
from analysis.sensitivity.latent_posterior import LatentPosterior, integrated, log_evidence
from analysis.sensitivity.marginals import standard_deviations

# log σ, log τ_bias, log τ_gain, artanh ρ and log τ_discrepancy.
START = np.array([-0.5, -0.7, -0.7, 0.0, -1.5])
FEWEST_CONDITIONS = 3


@dataclass(frozen=True, kw_only=True)
class OrdinalSensitivity:
    """The fit of M2, in rating points.

    `thresholds` lie between the `categories`, from the lowest up; `discrepancies` are the effects
    of conditions beyond their predicted contrasts, posterior means, none of fewer than three.
    `effective_points` is the effective sample size of the integration over variance components.
    """

    lines: of_lines.Lines
    residual_sd: float
    categories: tuple[str, ...]
    thresholds: tuple[float, ...]
    discrepancies: Mapping[str, Estimate]
    effective_points: float

    def expected_ratings(self, contrast: FloatArray) -> FloatArray:
        """Return the mean rating of a subject on the line in the middle, by contrast.

        The categories must be ratings; discrepancies are 0, all parameters at their estimates.
        """
        bias, gain = self.lines.middle
        place = bias + gain * contrast[:, None]
        above = ndtr((place - np.array(self.thresholds)) / self.residual_sd)
        values = np.array(self.categories, dtype=np.float64)
        return np.asarray(values[0] + above @ np.diff(values))


@dataclass(frozen=True, kw_only=True, eq=False)
class PreparedTrials:
    """Trials in standard units, with the names and units of the result."""

    subjects: tuple[str, ...]
    conditions: tuple[str, ...]
    categories: tuple[str, ...]
    axes: of_lines.Axes
    trials: OrdinalTrials

    @cached_property
    def field(self) -> LatentField:
        """The log posterior of the trials' latent parameters."""
        return LatentField(self.trials)

    @cached_property
    def _content(self) -> tuple[object, ...]:
        of_trials = (getattr(self.trials, part.name) for part in fields(self.trials))
        values = (each.tobytes() if isinstance(each, np.ndarray) else each for each in of_trials)
        return self.subjects, self.conditions, self.categories, self.axes, *values

    def __eq__(self, other: object) -> bool:
        return isinstance(other, PreparedTrials) and self._content == other._content

    def __hash__(self) -> int:
        return hash(self._content)


def ordinal_sensitivity(ratings: of_lines.Ratings) -> OrdinalSensitivity | NotEstimable:
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
    if isinstance(ready, NotEstimable):
        return ready
    return posterior_of(ready).fit


def ordinal_lines(ratings: of_lines.Ratings) -> of_lines.LineMixture | NotEstimable:
    """Return the posteriors alone of which the fit has the medians and intervals."""
    ready = prepared_ratings(ratings)
    if isinstance(ready, NotEstimable):
        return ready
    known = posterior_of(ready)
    return known.refusal or known.lines


def prepared_ratings(ratings: of_lines.Ratings) -> PreparedTrials | NotEstimable:
    """Return the rated trials, equal ones counted, or why they set no scale.

    Each different rating is a category; the outermost thresholds between them are fixed.
    """
    trials = ratings.given
    axes = of_lines.axes_of(trials)
    if isinstance(axes, NotEstimable):
        return axes
    values, category = np.unique(trials.rating, return_inverse=True)
    if len(values) < 3:
        return NotEstimable(
            "two different ratings do not set the unit of the latent scale, at least 3 are needed"
        )
    edges = (values[1:] + values[:-1]) / 2
    free = np.ones(len(edges), dtype=np.bool_)
    free[[0, -1]] = False
    x = (trials.contrast - axes.x_mean) / axes.x_sd
    rows, weight = counted(np.stack([trials.subject, trials.condition, x, category], axis=-1))
    used = len(np.unique(trials.condition))
    return PreparedTrials(
        subjects=trials.subjects,
        conditions=trials.conditions,
        categories=tuple(f"{value:g}" for value in values),
        axes=axes,
        trials=OrdinalTrials(
            subjects=len(trials.subjects),
            conditions=len(trials.conditions) if used >= FEWEST_CONDITIONS else 0,
            subject=rows[:, 0].astype(np.int64),
            condition=rows[:, 1].astype(np.int64),
            x=rows[:, 2],
            category=rows[:, 3].astype(np.int64),
            weight=weight,
            thresholds=(edges - axes.y_mean) / axes.y_sd,
            free=free,
        ),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class OrdinalPosterior:
    """The posterior of prepared trials, discretised in σ, T and τ_δ."""

    ready: PreparedTrials
    latent: LatentPosterior

    @cached_property
    def _told(self) -> tuple[of_lines.LineMixture, Marginals]:
        return _mixture(self.ready, self.latent)

    @property
    def lines(self) -> of_lines.LineMixture:
        """The posteriors of the lines, in rating points."""
        return self._told[0]

    @cached_property
    def refusal(self) -> NotEstimable | None:
        """Why it does not tell the lines, or None if it does."""
        return self.latent.points.refusal() or self.lines.refusal

    @cached_property
    def fit(self) -> OrdinalSensitivity | NotEstimable:
        """Lines, thresholds and discrepancies, or why the posterior does not tell them."""
        if self.refusal:
            return self.refusal
        ready, points, axes = self.ready, self.latent.points, self.ready.axes
        lines, of_conditions = self._told
        shared = points.weights @ self.latent.modes.shared
        thresholds = ready.trials.edges(shared[None])[0, 1:-1]
        names = ready.conditions if ready.trials.conditions else ()
        values = (points.weights @ of_conditions.means).tolist()
        intervals = of_conditions.interval_95(points.weights)
        return OrdinalSensitivity(
            lines=of_lines.summary(ready.subjects, lines),
            residual_sd=float(points.mean(self.latent.residual_sds)) * axes.y_sd,
            categories=ready.categories,
            thresholds=tuple((axes.y_mean + axes.y_sd * thresholds).tolist()),
            discrepancies={
                name: Estimate(value=value, interval=interval)
                for name, value, interval in zip(names, values, intervals, strict=True)
            },
            effective_points=points.effective,
        )


def posterior_of(ready: PreparedTrials) -> OrdinalPosterior:
    """Return the posterior of prepared trials, of twice the points if halves of them disagree."""
    start = START if ready.trials.conditions else START[:-1]
    known = integrated(ready.field, start, _components, _log_prior)
    return settled(known, lambda latent: OrdinalPosterior(ready=ready, latent=latent))


def _equal_gains(ready: PreparedTrials, middle: FloatArray) -> float:
    """Return the log evidence of the model with τ_gain = 0, in which ρ means nothing.

    The search for its mode begins at the `middle` of the posterior in which gains differ.
    """

    def components(points: FloatArray) -> Components:
        return _components(np.insert(points, [2, 2], [-np.inf, 0.0], axis=1))

    start = np.delete(middle, [2, 3])
    return log_evidence(ready.field, start, components, _log_prior_of_equal)


def _components(points: FloatArray) -> Components:
    return Components(
        residual_sd=np.exp(points[:, 0]),
        root=of_lines.roots_of_covariances(points[:, 1:4]),
        discrepancy_sd=np.exp(points[:, 4]) if points.shape[1] > 4 else np.ones(len(points)),
    )


def _log_prior(points: FloatArray) -> FloatArray:
    spread = of_lines.log_prior_of_spread(points[:, 2]) - 2 * np.log(2**0.5 * np.cosh(points[:, 3]))
    return np.asarray(spread + _log_prior_of_equal(np.delete(points, [2, 3], axis=1)))


def _log_prior_of_equal(points: FloatArray) -> FloatArray:
    others = np.delete(points, 1, axis=1)
    half_cauchy = (others - np.log1p(np.exp(2 * others))).sum(axis=1)
    return np.asarray(of_lines.log_prior_of_spread(points[:, 1]) + half_cauchy)


def _mixture(
    ready: PreparedTrials, known: LatentPosterior
) -> tuple[of_lines.LineMixture, Marginals]:
    """Return the posteriors of the lines and of the discrepancies, in rating points."""
    points, trials, axes = known.points, ready.trials, ready.axes
    bias, gain = of_lines.turn_of(axes)
    counts = np.bincount(trials.subject, weights=trials.weight, minlength=trials.subjects)
    lines, first = trials.subjects + 1, len(trials.shared_start) - trials.conditions
    biases, slopes = (known.of_lines(of) for of in (bias, np.array([0.0, 1.0])))
    gain_unit = float(gain[1])
    departures = replace(slopes, shared=0 * slopes.shared)
    relative = replace(departures, common=-slopes.own)
    effects = biases.shared_only(
        axes.y_sd * np.eye(trials.conditions, first + trials.conditions, first)
    )
    found = known.marginals(
        biases.followed_by(
            biases.shared_only(biases.shared[:1]),
            slopes.times(gain_unit),
            slopes.shared_only(gain_unit * slopes.shared[:1]),
            effects,
            relative.times(gain_unit),
        )
    )
    between = of_lines.covariance_matrices(points.points[:, 1:4])
    others = slice(2 * lines, 2 * lines + trials.conditions)
    mixture = of_lines.LineMixture(
        points=points,
        axes=axes,
        bias=found.part(slice(lines)).plus(axes.y_mean),
        gain=found.part(slice(lines, 2 * lines)),
        relative=found.part(slice(others.stop, None)),
        own_variance=standard_deviations(known.modes.curvature, departures) ** 2
        / between[:, None, 1, 1],
        residual_sd=known.residual_sds * axes.y_sd,
        log_evidence_of_equal=partial(_equal_gains, ready, points.mean(points.points)),
        counts=counts.astype(np.float64),
    )
    return mixture, found.part(others)
