"""M1: linear mixed model of ratings on predicted contrast, with a line per subject."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from analysis.estimates import BoolArray, FloatArray, IntArray, NotEstimable
from analysis.sensitivity import lines as of_lines
from analysis.sensitivity.integration import Marginals, WeightedPoints, weighted_points

POINTS = 400
AT_ONCE, MIXED_AT_ONCE = 8_000, 200_000
"""So many matrices, of points times subjects, for the likelihood alone and for all that is told."""
# Variance of a single subject's gain relative to itself, which would be 0.
SMALLEST = 1e-12
# log σ, log τ_bias, log τ_gain and artanh ρ, in standard deviations of the ratings.
START = np.array([-0.5, -0.7, -0.7, 0.0])


@dataclass(frozen=True, kw_only=True, eq=False)
class LineSums:
    """Sufficient statistics of the trials for a line per subject.

    `counts` (subjects,) trials; `gram` (subjects, 2, 2) = Z'Z and `products` (subjects, 2) = Z'y
    with rows Z = (1, x); `squares` (subjects,) = y'y.
    """

    counts: FloatArray
    gram: FloatArray
    products: FloatArray
    squares: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class LinePosterior:
    """Log marginal likelihood and posterior of the lines, given variance components.

    `log_likelihood` (points,) has the population's line integrated out. `population` (points, 2)
    and `population_covariance` (points, 2, 2) are the population's. Given that line, a subject's
    own is `kept` @ it + a departure of mean `own` (points, subjects, 2) with `own_covariances`
    (points, subjects, 2, 2), independent between subjects.
    """

    log_likelihood: FloatArray
    own: FloatArray
    kept: FloatArray
    own_covariances: FloatArray
    population: FloatArray
    population_covariance: FloatArray

    # Not at every point where a search for the maximum asks for the likelihood alone.
    @property
    def means(self) -> FloatArray:
        """Each subject's intercept and slope, shape (points, subjects, 2)."""
        shared = self.kept @ self.population[:, None, :, None]
        return np.asarray(self.own + shared[..., 0])

    @property
    def covariances(self) -> FloatArray:
        """Their covariances, shape (points, subjects, 2, 2)."""
        shared = self.kept @ self.population_covariance[:, None]
        return np.asarray(self.own_covariances + shared @ np.swapaxes(self.kept, -1, -2))


def line_sums(subject: IntArray, subjects: int, x: FloatArray, y: FloatArray) -> LineSums:
    """Return the sums over the trials of each subject."""

    def total(values: FloatArray) -> FloatArray:
        return np.bincount(subject, weights=values, minlength=subjects).astype(np.float64)

    ones = np.ones_like(x)
    gram = np.array([[total(ones), total(x)], [total(x), total(x * x)]])
    return LineSums(
        counts=total(ones),
        gram=np.moveaxis(gram, -1, 0),
        products=np.stack([total(y), total(x * y)], axis=-1),
        squares=total(y * y),
    )


def own_gains(ratings: of_lines.Ratings) -> FloatArray:
    """Return each subject's least-squares gain by the own trials alone, shape (subjects,).

    It is NaN where contrasts do not vary. Nothing is borrowed from other subjects, as the gains of
    the models are, which would draw groups of subjects together.
    """
    trials = ratings.given
    sums = line_sums(trials.subject, len(trials.subjects), trials.contrast, trials.rating)
    (count, x), xx = sums.gram[:, 0].T, sums.gram[:, 1, 1]
    y, xy = sums.products.T
    spread = count * xx - x**2
    known = spread > 1e-12 * count * xx
    found = np.full(len(count), np.nan)
    found[known] = (count * xy - x * y)[known] / spread[known]
    return found


def without_noise(sums: LineSums) -> NotEstimable | None:
    """Return why ratings in standard units tell no noise, or None if they do."""
    own = np.linalg.pinv(sums.gram, rcond=1e-9, hermitian=True) @ sums.products[..., None]
    explained = (sums.products * own[..., 0]).sum(axis=1)
    if (sums.squares - explained).sum() > 1e-9 * sums.counts.sum():
        return None
    return NotEstimable(
        "each subject's ratings lie exactly on a line, so there is no residual to "
        "separate noise from differences between subjects"
    )


def line_posterior(sums: LineSums, residual_sd: FloatArray, between: FloatArray) -> LinePosterior:
    """Return likelihood and lines at given variance components.

    By Woodbury's identity, (5) to (7) of docs/mathematics/sensitivity.md, each subject costs a few
    products of 2 x 2 matrices.

    Parameters:
        sums: of the trials.
        residual_sd: shape (points,), σ.
        between: shape (points, 2, 2), T.
    """
    variance = residual_sd[:, None] ** 2
    a = sums.gram / variance[..., None, None]
    c = sums.products / variance[..., None]
    t = between[:, None]
    keep, log_size = _kept(t, a)
    shift = keep @ t
    info = (a @ keep).sum(axis=1)
    score = (np.swapaxes(keep, -1, -2) @ c[..., None])[..., 0].sum(axis=1)
    covariance = np.linalg.inv(info)
    population = (covariance @ score[..., None])[..., 0]
    own = (shift @ c[..., None])[..., 0]
    quadratic = (sums.squares / variance - (c * own).sum(-1)).sum(1) - (score * population).sum(-1)
    log_det = (sums.counts * np.log(variance) + log_size).sum(axis=1)
    profile = -(log_det + quadratic + sums.counts.sum() * np.log(2 * np.pi)) / 2
    return LinePosterior(
        log_likelihood=profile - np.linalg.slogdet(info)[1] / 2,
        own=own,
        kept=np.asarray(keep, dtype=np.float64),
        own_covariances=shift,
        population=population,
        population_covariance=covariance,
    )


def _kept(t: FloatArray, a: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (8), (I + T A)⁻¹ of 2 x 2 covariances, and the log determinant of I + T A."""
    product = t @ a
    traces = product[..., 0, 0] + product[..., 1, 1]
    sizes = [m[..., 0, 0] * m[..., 1, 1] - m[..., 0, 1] * m[..., 1, 0] for m in (t, a)]
    determinant = 1 + traces + np.maximum(sizes[0] * sizes[1], 0.0)
    adjugate = (1 + traces)[..., None, None] * np.eye(2) - product
    return adjugate / determinant[..., None, None], np.log(determinant)


@dataclass(frozen=True, kw_only=True)
class LinearSensitivity:
    """The fit of M1: lines and residual standard deviation, in rating points.

    `effective_points` is the effective sample size of the integration over variance components.
    """

    lines: of_lines.Lines
    residual_sd: float
    effective_points: float


def linear_sensitivity(ratings: of_lines.Ratings) -> LinearSensitivity | NotEstimable:
    """Return each subject's bias and gain by partial pooling, or why they are not estimable.

    y = α_s + g_s x + ε, (α_s, g_s) ~ N((α, g), T), ε ~ N(0, σ²). Priors: α, g and log σ flat, the
    standard deviations in T as in `log_prior_of_spread`, their correlation uniform. Intervals are
    integrated over σ and T.

    The model has no ceiling: if many ratings are the largest possible, it underestimates gains.
    `ordinal_sensitivity` is for such ratings.
    """
    found = linear_lines(ratings)
    if isinstance(found, NotEstimable):
        return found
    residual_sd, _ = _components(found.points.points)
    return LinearSensitivity(
        lines=of_lines.summary(ratings.subjects, found),
        residual_sd=float(found.points.mean(residual_sd)) * found.axes.y_sd,
        effective_points=found.points.effective,
    )


def linear_lines(ratings: of_lines.Ratings) -> of_lines.LineMixture | NotEstimable:
    """Return the posteriors alone of which the fit has the medians and intervals."""
    trials = ratings.given
    axes = of_lines.axes_of(trials)
    if isinstance(axes, NotEstimable):
        return axes
    x = (trials.contrast - axes.x_mean) / axes.x_sd
    y = (trials.rating - axes.y_mean) / axes.y_sd
    sums = line_sums(trials.subject, len(trials.subjects), x, y)
    if refusal := without_noise(sums):
        return refusal

    def log_posterior(points: FloatArray) -> FloatArray:
        spread = of_lines.log_prior_of_spread(points[:, 2]) - 2 * np.log(
            2**0.5 * np.cosh(points[:, 3])
        )
        return np.asarray(_log_posterior(sums, points) + spread)

    def equal_gains(points: FloatArray) -> FloatArray:
        return _log_posterior(sums, np.insert(points, [2, 2], [-np.inf, 0.0], axis=1))

    posterior, _ = next(weighted_points(log_posterior, START, POINTS))
    if refusal := posterior.refusal():
        return refusal

    def evidence_of_equal() -> float:
        return next(weighted_points(equal_gains, START[:2], POINTS // 2))[0].log_evidence

    mixture = _mixture(sums, posterior, axes, evidence_of_equal)
    return mixture.refusal or mixture


def _log_posterior(sums: LineSums, points: FloatArray) -> FloatArray:
    """Return the log posterior, but for the priors of τ_gain and ρ."""
    # In stretches, because the matrices of a large study at all points would fill the memory.
    stretches = np.array_split(points, -(-points.shape[0] * len(sums.counts) // AT_ONCE))
    known = [line_posterior(sums, *_components(some)).log_likelihood for some in stretches]
    return np.asarray(np.concatenate(known) + of_lines.log_prior_of_spread(points[:, 1]))


def _components(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return σ and T of points (log σ, log τ_bias, log τ_gain, artanh ρ)."""
    return np.exp(points[:, 0]), of_lines.covariance_matrices(points[:, 1:4])


def _mixture(
    sums: LineSums, posterior: WeightedPoints, axes: of_lines.Axes, equal: Callable[[], float]
) -> of_lines.LineMixture:
    residual_sd, between = _components(posterior.points)
    turn = of_lines.turn_of(axes)
    count = -(-len(residual_sd) * len(sums.counts) // MIXED_AT_ONCE)
    parts = zip(np.array_split(residual_sd, count), np.array_split(between, count), strict=True)
    found = [_lines_at(sums, *part, turn) for part in parts]
    joined = map(np.concatenate, zip(*found, strict=True))
    means, variances, own_variance, relative, relative_sds = joined
    bias, gain = (
        Marginals(means=means[..., part], sds=np.sqrt(variances[..., part])) for part in (0, 1)
    )
    return of_lines.LineMixture(
        points=posterior,
        axes=axes,
        bias=bias.plus(axes.y_mean),
        gain=gain,
        relative=Marginals(means=relative, sds=relative_sds),
        own_variance=own_variance,
        residual_sd=residual_sd * axes.y_sd,
        log_evidence_of_equal=equal,
        counts=sums.counts,
    )


def _lines_at(
    sums: LineSums, residual_sd: FloatArray, between: FloatArray, turn: FloatArray
) -> tuple[FloatArray, ...]:
    """Return means and variances of lines, own variances, and means and SDs of relative gains."""
    known = line_posterior(sums, residual_sd, between)
    lost = np.eye(2) - known.kept
    departures = lost @ known.population_covariance[:, None] @ np.swapaxes(lost, -1, -2)
    departures += known.own_covariances
    covariances = np.concatenate([known.covariances, known.population_covariance[:, None]], axis=1)
    return (
        np.concatenate([known.means, known.population[:, None]], axis=1) @ turn.T,
        np.diagonal(turn @ covariances @ turn.T, axis1=-2, axis2=-1),
        departures[..., 1, 1] / between[:, None, 1, 1],
        *_relative_gains(known, sums.counts > 0, float(turn[1, 1])),
    )


def _relative_gains(
    known: LinePosterior, rated: BoolArray, unit: float
) -> tuple[FloatArray, FloatArray]:
    """Return mean and SD, (9), of each subject's gain less the mean of those who `rated`."""
    mean = rated / rated.sum()
    slopes, kept = known.means[..., 1], known.kept[:, :, 1]
    kept = kept - np.einsum("s,psi->pi", mean, kept)[:, None]
    own = known.own_covariances[..., 1, 1]
    variances = own * (1 - 2 * mean) + (own @ mean**2)[:, None]
    variances += ((kept @ known.population_covariance) * kept).sum(axis=2)
    means = slopes - (slopes @ mean)[:, None]
    return unit * means, unit * np.sqrt(np.maximum(variances, SMALLEST))
