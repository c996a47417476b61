"""Deterministic integration over a few parameters, such as variance components."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import combinations_with_replacement
from math import lgamma
from typing import Protocol, TypeAlias, TypeVar

import numpy as np
from scipy.special import gammaincinv, logsumexp, ndtr, ndtri

from analysis.estimates import ENDS, BoolArray, FloatArray, IntArray, Interval, NotEstimable

# Maps points of shape (count, dimensions) to log densities of shape (count,).
LogDensity: TypeAlias = Callable[[FloatArray], FloatArray]

# Tails heavier than those of any density here, so that no weight is unbounded.
PROPOSAL_DF = 5.0
PILOT, LEAST_EFFECTIVE = 100, 200.0
REACH, STEEPNESS = 6.0, 20.0
CURVATURE_STEP = 0.2
MODE_STEPS, MODE_RISE, LONGEST_STEP = 30, 0.05, 1.0
# Limits to which the curvature of a direction at the mode is clipped.
LEAST_CURVATURE, MOST_CURVATURE = 0.1, 1e8
QUANTILE_STEPS, QUANTILE_TOLERANCE = 60, 1e-5
# Bits to which proposals are rounded.
BITS = 12
# What stands for the log density of a point at which it is unknown, and how many points may be so.
NOWHERE, MOST_UNKNOWN = -1e9, 0.01
# A point of less weight changes no digit that is shown.
NEGLIGIBLE = 1e-12
# Halves of the points may disagree on a limit by so much of the interval's width.
MOST_DISAGREEMENT = 0.1
INTEGRATION = "its integration over the differences between people"
DISAGREEMENT = NotEstimable(
    f"two sets of points of {INTEGRATION} disagree on a limit by more than "
    f"{MOST_DISAGREEMENT:.0%} of the interval's width"
)
# Points at which a smooth function stands for the density, and the distance in SDs from which its
# polynomial levels off.
SMOOTH_POINTS, LEVEL_FROM = 4096, 5.0
# A polynomial has at most this share of the number of points in coefficients.
MOST_COEFFICIENTS = 0.25
# Quantiles that are sought together, until all of them are found; their arrays fit into the cache.
AT_ONCE = 64
# Of more points than twice as many, so many give a start for the search of a quantile.
FEW = 100


@dataclass(frozen=True, kw_only=True, eq=False)
class WeightedPoints:
    """A discretised posterior: points (count, dimensions) and weights that sum to 1.

    It represents the density if at least `least` points are effective, at a share of at most
    `MOST_UNKNOWN` the density is `unknown`, and the two `halves` (2, count), weights of a set of
    points each, which are shifted against each other, agree. `log_evidence` is the logarithm of the
    integral of the density, `log_density` (count,) its own at the points.
    """

    points: FloatArray
    weights: FloatArray
    halves: FloatArray
    least: float
    effective: float
    unknown: float
    log_evidence: float
    log_density: FloatArray

    def refusal(self, *quantities: tuple["Marginals", Sequence[Interval]]) -> NotEstimable | None:
        """Return why the points do not tell quantities and their intervals, or None if they do."""
        return next(self._reasons(quantities), None)

    def _reasons(
        self, quantities: Iterable[tuple["Marginals", Sequence[Interval]]]
    ) -> Iterator[NotEstimable]:
        if self.unknown > MOST_UNKNOWN:
            yield NotEstimable(
                f"it could not be evaluated at {self.unknown:.0%} of the points of {INTEGRATION}"
            )
        if self.effective < self.least:
            # How few there are may depend on the processor where there are hardly any.
            few = self.least / 10
            reached = f"{self.effective:.0f}" if self.effective >= few else f"fewer than {few:.0f}"
            yield NotEstimable(
                f"{INTEGRATION} reached {reached} effective points, and intervals need "
                f"at least {self.least:.0f}"
            )
        for each, intervals in quantities:
            if each.disagreement(self.halves, intervals) > MOST_DISAGREEMENT:
                yield DISAGREEMENT

    def mean(self, values: FloatArray) -> FloatArray:
        """Return the posterior mean of values at the points, along the first axis."""
        return np.asarray(np.tensordot(self.weights, values, axes=1), dtype=np.float64)

    @cached_property
    def _smoothed(self) -> tuple[FloatArray, FloatArray]:
        """More points with weights, and the points themselves with what the first ones leave over.

        At the first the density is that of a normal distribution times a polynomial's exponential,
        which was fitted at the points: so few of these leave noise in a quantile of a parameter.
        What the polynomial misses, the weights of the second correct, some of them negative.
        """
        mean, size = self.mean(self.points), self.points.shape[1]
        away = self.points - mean
        covariance = (self.weights * away.T) @ away
        inverse = np.linalg.inv(np.linalg.cholesky(covariance))
        cubic = (size + 1) * (size + 2) * (size + 3) // 6  # coefficients
        orders = range(1, 4 if cubic < MOST_COEFFICIENTS * len(away) else 3)

        def basis(points: FloatArray) -> tuple[FloatArray, FloatArray]:
            steps = (points - mean) @ inverse.T
            squares = (steps**2).sum(axis=1, keepdims=True)
            near = (steps / np.sqrt(1 + squares / LEVEL_FROM**2)).T
            terms = [
                near[list(of)].prod(axis=0)
                for order in orders
                for of in combinations_with_replacement(range(size), order)
            ]
            return np.column_stack([np.ones(len(points)), *terms]), -squares[:, 0] / 2

        terms, normal = basis(self.points)
        root = np.sqrt(self.weights + 0.01 / len(away))
        fitted = np.linalg.lstsq(
            root[:, None] * terms, root * (self.log_density - normal), rcond=1e-10
        )[0]
        more, log_proposal = _t_points(mean, covariance, SMOOTH_POINTS)
        others, of_more = basis(more)
        weights = _normalised(others @ fitted + of_more - log_proposal)
        missed = self.weights - _normalised(
            np.log(self.weights) + terms @ fitted + normal - self.log_density
        )
        return np.concatenate([more, self.points]), np.concatenate([weights, missed])

    def quantiles(self, of: Callable[[FloatArray], FloatArray], *p: float) -> list[float]:
        """Return quantiles of a function that maps points (count, dimensions) to (count,)."""
        points, weights = self._smoothed
        values = of(np.clip(points, -REACH, REACH))
        return weighted_quantiles(weights, values, *p)


class Told(Protocol):
    """What points tell of their density."""

    @property
    def refusal(self) -> NotEstimable | None:
        """Why they do not represent it, or None."""


Points = TypeVar("Points")
OfPoints = TypeVar("OfPoints", bound=Told)


def settled(drawn: Iterator[Points], tell: Callable[[Points], OfPoints]) -> OfPoints:
    """Return what the first of the points drawn tell, or the second if halves of those disagree.

    Halves of so many points as suffice for the limits may disagree where the posterior is narrow.
    """
    told = tell(next(drawn))
    if told.refusal != DISAGREEMENT:
        return told
    del told  # it takes much memory
    return tell(next(drawn))


def weighted_points(
    log_density: LogDensity,
    start: FloatArray,
    count: int,
    least: float | None = None,
    *,
    pilot: int = PILOT,
    rise: float = MODE_RISE,
    step: FloatArray | float = CURVATURE_STEP,
) -> Iterator[tuple[WeightedPoints, BoolArray]]:
    """Yield weighted points that represent the density, and which of the last ones they are.

    Importance sampling from a t distribution with 5 degrees of freedom, first about the mode, found
    but for a `rise`, and scaled by the curvature there over a `step` along each axis, then with the
    mean and covariance of the points so far. The first are `pilot` in number, then `count`, until
    the effective sample size is at least `least` (None for 200) or four times as many do or would
    not reach it. They are those of an additive low-discrepancy sequence instead of random ones, and
    of a proposal that is rounded, so that the same input gives the same points on every computer.
    Points without weight are left out. Those who find too few points ask for the second ones, which
    are twice as many; there are no more.
    """
    least, enough = LEAST_EFFECTIVE if least is None else least, False
    log_density = _within_reach(log_density)
    centre, covariance = mode_of(log_density, start, rise, step)
    for number in (pilot, count, 2 * count, 4 * count, 8 * count):
        points, log_proposal = _t_points(centre, covariance, number)
        known = log_density(points)
        log_weights = known - log_proposal
        weights = _normalised(log_weights)
        effective = float(1 / (weights**2).sum())  # (18), mathematics/sensitivity
        # At a share so far from what is needed four times as many hardly do: such fits take the
        # longest, and all that were tried were refused in the end.
        more = number < count or (number < 4 * count and least / 10 <= effective < least)
        if enough or not more:
            some = weights > NEGLIGIBLE
            early = np.arange(number) < number // 2
            halves = [half[some] for half in (weights * early, weights * ~early)]
            yield (
                WeightedPoints(
                    points=np.clip(points[some], -REACH, REACH),
                    weights=weights[some] / weights[some].sum(),
                    # A half without any weight agrees with nothing.
                    halves=np.array([half / max(half.sum(), NEGLIGIBLE) for half in halves]),
                    least=least,
                    effective=effective,
                    unknown=float((known <= NOWHERE).mean()),
                    log_evidence=float(logsumexp(log_weights)) - float(np.log(number)),
                    log_density=known[some],
                ),
                some,
            )
            if enough:
                return
            enough = True
        # Few effective points change the covariance little.
        centre, size = weights @ points, points.shape[1]
        away = points - centre
        found = effective * (weights * away.T) @ away
        covariance = (found + size * covariance) / (effective + size)


def _normalised(log_weights: FloatArray) -> FloatArray:
    """Return weights that sum to 1; the least are those that still are numbers."""
    return np.asarray(np.exp(np.maximum(log_weights - logsumexp(log_weights), -300.0)))


def _within_reach(log_density: LogDensity) -> LogDensity:
    # Densities may overflow far out: beyond REACH, the value at the boundary falls off steeply.
    def bounded(points: FloatArray) -> FloatArray:
        inside = np.clip(points, -REACH, REACH)
        known = np.nan_to_num(log_density(inside), nan=NOWHERE)
        return np.asarray(known - STEEPNESS * ((points - inside) ** 2).sum(axis=1))

    return bounded


def low_discrepancy(count: int, dimensions: int) -> FloatArray:
    """Return evenly spread points in the unit cube, shape (count, dimensions).

    Multiples, modulo 1, of the powers of the root of g^(d+1) = g + 1.
    """
    root = 2.0
    for _ in range(60):
        root = (1 + root) ** (1 / (dimensions + 1))
    steps = root ** -np.arange(1.0, dimensions + 1)
    return np.asarray((0.5 + np.arange(1.0, count + 1)[:, None] * steps) % 1.0)


def mode_of(
    log_density: LogDensity,
    start: FloatArray,
    rise: float = MODE_RISE,
    step: FloatArray | float = CURVATURE_STEP,
) -> tuple[FloatArray, FloatArray]:
    """Return the mode, and the inverse of the curvature there.

    Found by Newton's method with differences over steps so long that small errors of the density
    do not matter; the mode need not be exact, as the points adapt.
    """
    mode = start
    for _ in range(MODE_STEPS):
        gradient, covariance = _parabola(log_density, mode, step)
        move = covariance @ gradient
        mode = mode + move / max(1.0, float(np.abs(move).max()) / LONGEST_STEP)
        if gradient @ move < rise:
            break
    return mode, covariance


def _parabola(
    log_density: LogDensity, centre: FloatArray, step: FloatArray | float
) -> tuple[FloatArray, FloatArray]:
    """Return the gradient and inverse curvature of the parabola through values about the centre."""
    size = len(centre)
    first, second = np.triu_indices(size, 1)
    axes = np.diag(np.broadcast_to(step, size))
    steps = np.vstack([axes, axes[first] + axes[second]])
    values = log_density(centre + np.vstack([np.zeros(size), steps, -steps]))
    # (19): second differences along each axis and each diagonal, in units of the steps.
    ahead, behind = np.split(values[1:], 2)
    falls = (2 * values[0] - ahead - behind) / CURVATURE_STEP**2
    curvature = np.diag(falls[:size])
    curvature[first, second] = (falls[size:] - falls[first] - falls[second]) / 2
    curvature[second, first] = curvature[first, second]
    unit = np.diag(axes) / CURVATURE_STEP
    eigenvalues, vectors = np.linalg.eigh(curvature / np.multiply.outer(unit, unit))
    inverse = (vectors / np.clip(eigenvalues, LEAST_CURVATURE, MOST_CURVATURE)) @ vectors.T
    return (ahead - behind)[:size] / (2 * CURVATURE_STEP) / unit, np.asarray(inverse)


def _t_points(
    centre: FloatArray, covariance: FloatArray, count: int
) -> tuple[FloatArray, FloatArray]:
    size = len(centre)
    spread = _rounded(np.asarray(np.linalg.cholesky(covariance), dtype=np.float64))
    scaled = _t_numbers(count, size)
    # (17), mathematics/sensitivity
    constant = lgamma((PROPOSAL_DF + size) / 2) - lgamma(PROPOSAL_DF / 2)
    constant -= size / 2 * np.log(PROPOSAL_DF * np.pi) + np.log(np.diag(spread)).sum()
    log_proposal = constant - (PROPOSAL_DF + size) / 2 * np.log1p(
        (scaled**2).sum(axis=1) / PROPOSAL_DF
    )
    return _rounded(centre) + scaled @ spread.T, log_proposal


# The same ones serve every fit, and take longer than much of what is made of them.
@lru_cache(maxsize=32)
def _t_numbers(count: int, size: int) -> FloatArray:
    """Return low-discrepancy numbers of a t distribution about 0, (count, size)."""
    cube = low_discrepancy(count, size + 1)
    chi_square = 2 * np.asarray(gammaincinv(PROPOSAL_DF / 2, cube[:, size]))
    found = np.asarray(ndtri(cube[:, :size]) * np.sqrt(PROPOSAL_DF / chi_square)[:, None])
    found.flags.writeable = False
    return found


def _rounded(values: FloatArray) -> FloatArray:
    """Return the values to `BITS` bits.

    Other processors round otherwise in the last of 53. What begins with these numbers would carry
    on the difference, and any proposal will do.
    """
    mantissa, exponent = np.frexp(values)
    return np.asarray(np.ldexp(np.round(mantissa * 2**BITS) / 2**BITS, exponent))


@dataclass(frozen=True, kw_only=True, eq=False)
class Marginals:
    """Mean and SD of normal quantities at each weighted point, shape (points, quantities)."""

    means: FloatArray
    sds: FloatArray

    def plus(self, constant: float | FloatArray) -> "Marginals":
        """Return the marginals of the quantities plus a constant, or one per point (points, 1)."""
        return replace(self, means=self.means + constant)

    def part(self, quantities: slice | IntArray) -> "Marginals":
        """Return the marginals of some of the quantities."""
        return Marginals(means=self.means[:, quantities], sds=self.sds[:, quantities])

    def interval_95(self, weights: FloatArray) -> list[Interval]:
        """Return the central 95% interval of each quantity over all points."""
        low, high = self.quantiles(weights, *ENDS)
        return list(zip(low.tolist(), high.tolist(), strict=True))

    def disagreement(self, halves: FloatArray, intervals: Sequence[Interval]) -> float:
        """Return how far halves of the points differ on a limit, at most, in widths of intervals.

        `halves` (2, points) are weights, and `intervals` those of each quantity over all points.
        """
        limits = np.array(intervals).T
        found = []
        for limit in limits:
            score = (limit - self.means) / self.sds
            density = halves.mean(axis=0) @ (_normal_density(score) / self.sds)
            apart = (halves[0] - halves[1]) @ ndtr(score)
            found.append(np.abs(apart) / (density * (limits[1] - limits[0])))
        return float(np.max(found))

    def above_zero(self, weights: FloatArray) -> FloatArray:
        """Return the probability that each quantity is positive."""
        return np.asarray(weights @ ndtr(self.means / self.sds))

    def quantiles(self, weights: FloatArray, *probabilities: float) -> list[FloatArray]:
        """Return quantiles of each quantity over all points: of the mixture of its normals.

        They are found by Newton's method, within an interval that shrinks by bisection where that
        fails. `weights` (points,) sum to 1.
        """
        found: list[list[FloatArray]] = [[np.zeros(0)] for _ in probabilities]
        for first in range(0, self.means.shape[1], AT_ONCE):
            # It keeps what the search of each quantile needs.
            part = self.part(slice(first, first + AT_ONCE))
            for parts, probability in zip(found, probabilities, strict=True):
                parts.append(part._quantile(weights, probability))
        return list(map(np.concatenate, found))

    @cached_property
    def _few(self) -> "Marginals":
        few = slice(None, None, len(self.means) // FEW)
        return Marginals(means=self.means[few], sds=self.sds[few])

    @cached_property
    def _ends(self) -> tuple[FloatArray, FloatArray]:
        # Beyond 9 SDs a normal distribution has 1e-19, less than any quantile asked for.
        means, far = self.means, 9 * self.sds
        return (means - far).min(axis=0), (means + far).max(axis=0)

    def _quantile(self, weights: FloatArray, probability: float) -> FloatArray:
        means, sds, (low, high) = self.means, self.sds, self._ends
        if len(weights) > 2 * FEW:
            # A few of the points, which are spread alike, tell where to begin.
            few = weights[:: len(weights) // FEW]
            value = self._few._quantile(few / few.sum(), probability)
        else:
            centre = weights @ means
            sd = np.sqrt(weights @ (sds**2 + (means - centre) ** 2))
            value = centre + sd * ndtri(probability)
        value = np.clip(value, low, high)
        for _ in range(QUANTILE_STEPS):
            score = (value - means) / sds
            excess = weights @ ndtr(score) - probability
            low, high = np.where(excess < 0, value, low), np.where(excess < 0, high, value)
            density = weights @ (_normal_density(score) / sds)
            step = value - excess / np.maximum(density, 1e-300)
            found = np.abs(excess) < QUANTILE_TOLERANCE
            # The last step squares what is left of the error.
            other = np.where(found, value, (low + high) / 2)
            value = np.where((step > low) & (step < high), step, other)
            if found.all():
                break
        return np.asarray(value)


def _normal_density(score: FloatArray) -> FloatArray:
    return np.asarray(np.exp(-(score**2) / 2) / np.sqrt(2 * np.pi))


def weighted_quantiles(weights: FloatArray, values: FloatArray, *p: float) -> list[float]:
    """Return interpolated quantiles of values at weighted points."""
    order = np.argsort(values)
    # A few weights may be negative.
    reached = np.maximum.accumulate(np.cumsum(weights[order]) - weights[order] / 2)
    found: list[float] = np.interp(p, reached, values[order]).tolist()
    return found
