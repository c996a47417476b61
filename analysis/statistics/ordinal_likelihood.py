"""Marginal likelihood of ordered scores with random levels of subjects and of their cells."""

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Literal, TypeAlias

import numpy as np
from numpy.polynomial.hermite_e import hermegauss
from scipy.special import log_expit, log_ndtr, logsumexp

from analysis.estimates import FloatArray

Link: TypeAlias = Literal["probit", "logit"]

# Limits of the integrals over a subject's level and a cell's, in standard deviations.
REACH, CELL_REACH = 8.0, 6.0
SMALLEST = 1e-300
# So many subjects of similar levels share the levels at which their likelihood is not negligible:
# relative to the largest, its logarithm is at least -FAR, and at the ends the posterior is small.
ALIKE, FAR, NEGLIGIBLE = 100, 35.0, 1e-9
# From so many subjects on, cells' levels are integrated by Gauss-Hermite quadrature.
MANY = 200


@dataclass(frozen=True, kw_only=True, eq=False)
class ScoreCounts:
    """Number of scores, shape (subjects, conditions, categories), from the lowest score up."""

    counts: FloatArray

    @cached_property
    def alike(self) -> list[FloatArray]:
        """The counts (conditions, subjects, categories) of subjects with similar mean scores."""
        sums = self.counts.sum(axis=1)
        means = sums @ np.arange(self.categories) / sums.sum(axis=1)
        groups = np.array_split(np.argsort(means, kind="stable"), -(-len(means) // ALIKE))
        return [np.swapaxes(self.counts[group], 0, 1) for group in groups]

    @property
    def conditions(self) -> int:
        """Number of conditions."""
        return int(self.counts.shape[1])

    @property
    def categories(self) -> int:
        """Number of distinct scores."""
        return int(self.counts.shape[2])


@dataclass(frozen=True, kw_only=True, eq=False)
class Parameters:
    """Thresholds (categories - 1), condition effects (the first is 0) and SDs of random levels.

    The SD between subjects comes first. The second one, if there is one, is that between a
    subject's conditions, the subject × condition interaction.
    """

    thresholds: FloatArray
    effects: FloatArray
    sds: FloatArray

    @property
    def packed(self) -> FloatArray:
        """Free parameters: first threshold, log increments, effects but the first, SDs."""
        increments = np.log(np.diff(self.thresholds))
        return np.concatenate([self.thresholds[:1], increments, self.effects[1:], self.sds])


def unpacked(packed: FloatArray, data: ScoreCounts) -> Parameters:
    """Return the parameters of a vector that `Parameters.packed` made."""
    effects = data.categories - 1
    increments = np.exp(packed[1:effects])
    sds = effects + data.conditions - 1
    return Parameters(
        thresholds=packed[0] + np.concatenate([[0.0], np.cumsum(increments)]),
        effects=np.concatenate([[0.0], packed[effects:sds]]),
        sds=packed[sds:],
    )


def log_likelihood(
    packed: FloatArray, data: ScoreCounts, link: Link, nodes: int
) -> tuple[float, FloatArray]:
    """Return the log-likelihood and its gradient with respect to the packed parameters.

    P(score <= k | subject s, condition j) = F(θ_k - β_j - σ u_s - ω v_sj), u_s and v_sj ~ N(0, 1),
    F the normal or logistic distribution function, ω = 0 where the parameters have one SD. The
    integrals over v_sj, and over u_s outside them, are computed by the trapezoidal rule on evenly
    spaced points, `nodes` and half as many, which converges exponentially for such integrands; the
    points are the same for all subjects, so that the cost per subject is one matrix product.
    Among many subjects, levels at which one has no likelihood to speak of are left out.
    """
    parameters = unpacked(packed, data)
    levels, log_weights = _normal_nodes(REACH, nodes)
    own, log_own = _own_nodes(nodes, data) if len(parameters.sds) > 1 else _normal_nodes(0.0, 1)
    standard = np.stack([np.repeat(levels, len(own)), np.tile(own, nodes)])[: len(parameters.sds)]
    location = parameters.effects[:, None] + parameters.sds @ standard
    log_p, slopes = _log_probabilities(parameters.thresholds, location, link)
    log_p_of = log_p.reshape(*log_p.shape[:2], nodes, len(own))
    weights, total = np.zeros(log_p_of.shape), 0.0
    for counts in data.alike:
        window = slice(0, nodes)
        if len(data.alike) > 1:
            window = _window(_cells(counts[:, [0, -1]], log_p_of, log_own)[0] + log_weights)
        while True:
            by_cell, known = _cells(counts, log_p_of[:, :, window], log_own)
            by_level = by_cell + log_weights[window]
            per_subject = logsumexp(by_level, axis=1, keepdims=True)
            shares = np.exp(by_level - per_subject)
            if _holds(window, shares, nodes):
                break
            window = slice(0, nodes)
        known *= shares[:, :, None]
        flat = known.reshape(*known.shape[:2], -1)
        weights[:, :, window] += (np.swapaxes(counts, 1, 2) @ flat).reshape(
            weights[:, :, window].shape
        )
        total += float(per_subject.sum())
    return total, _gradient(parameters, weights.reshape(log_p.shape), slopes, standard)


def _cells(
    counts: FloatArray, log_p: FloatArray, log_own: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the log-likelihood of subjects at levels, and the shares of their cells' levels.

    Parameters:
        counts: shape (conditions, subjects, categories).
        log_p: shape (conditions, categories, levels, own levels).
        log_own: shape (own levels,), weights.

    Returns:
        Arrays of shape (subjects, levels) and (conditions, subjects, levels, own levels).
    """
    flat = log_p.reshape(*log_p.shape[:2], -1)
    cells = (counts @ flat).reshape(*counts.shape[:2], *log_p.shape[2:]) + log_own
    highest = cells.max(axis=3, keepdims=True)
    cells -= highest
    known = np.exp(cells, out=cells)
    total = known.sum(axis=3, keepdims=True)
    known /= total
    return (highest + np.log(total)).sum(axis=0)[..., 0], known


def _window(by_level: FloatArray) -> slice:
    """Return the levels that are not negligible for some of the subjects."""
    near = np.flatnonzero((by_level > by_level.max(axis=1, keepdims=True) - FAR).any(axis=0))
    return slice(int(near[0]), int(near[-1]) + 1)


def _holds(window: slice, shares: FloatArray, nodes: int) -> bool:
    """Return whether the window has all levels that count: a likelihood has one peak."""
    below = window.start == 0 or shares[:, 0].max() < NEGLIGIBLE
    return bool(below and (window.stop == nodes or shares[:, -1].max() < NEGLIGIBLE))


def _own_nodes(nodes: int, data: ScoreCounts) -> tuple[FloatArray, FloatArray]:
    """Return points and log weights of the integral over a cell's level.

    Of many subjects by Gauss and Hermite, which needs fewer points for the same precision.
    """
    if len(data.counts) < MANY:
        return _normal_nodes(CELL_REACH, nodes // 2)
    points, weights = hermegauss(nodes // 5)
    return points, np.log(weights / weights.sum())


@cache
def _normal_nodes(reach: float, count: int) -> tuple[FloatArray, FloatArray]:
    """Return points and log weights of an integral over a standard normal variable."""
    points = np.linspace(-reach, reach, count) if count > 1 else np.zeros(1)
    return points, np.asarray(-(points**2) / 2 - logsumexp(-(points**2) / 2))


def _log_probabilities(
    thresholds: FloatArray, location: FloatArray, link: Link
) -> tuple[FloatArray, tuple[FloatArray, FloatArray]]:
    """Return log P and its derivatives by upper and lower threshold.

    All have shape (conditions, categories, nodes).
    """
    edges = np.concatenate([[-np.inf], thresholds, [np.inf]])[None, :, None]
    bounds = edges - location[:, None, :]
    log_p = log_interval(bounds[:, :-1], bounds[:, 1:], link)
    log_density = log_density_of(bounds, link)
    # (3), mathematics/ordinal
    upper = np.exp(np.minimum(log_density[:, 1:] - log_p, -np.log(SMALLEST)))
    lower = -np.exp(np.minimum(log_density[:, :-1] - log_p, -np.log(SMALLEST)))
    return log_p, (upper, lower)


def log_interval(lower: FloatArray, upper: FloatArray, link: Link) -> FloatArray:
    """Return log(F(upper) - F(lower)), computed in the tail where F keeps its precision."""
    log_cdf = log_ndtr if link == "probit" else log_expit
    mirrored = lower > 0  # (4), mathematics/ordinal
    high = log_cdf(np.where(mirrored, -lower, upper))
    low = log_cdf(np.where(mirrored, -upper, lower))
    # Thresholds that meet during a search must give a tiny probability, not NaN.
    return np.asarray(high + np.log(-np.expm1(np.minimum(low - high, -SMALLEST))))


def log_density_of(values: FloatArray, link: Link) -> FloatArray:
    """Return the logarithm of the link's density, -inf at the infinite edges."""
    if link == "probit":
        return np.asarray(-(values**2) / 2 - np.log(2 * np.pi) / 2)
    return np.asarray(log_expit(values) + log_expit(-values))


def _gradient(
    parameters: Parameters,
    weights: FloatArray,
    slopes: tuple[FloatArray, FloatArray],
    standard: FloatArray,
) -> FloatArray:
    upper, lower = weights * slopes[0], weights * slopes[1]
    by_threshold = upper[:, :-1].sum(axis=(0, 2)) + lower[:, 1:].sum(axis=(0, 2))
    by_location = -(upper + lower).sum(axis=1)
    # An increment moves its own threshold and all above it.
    from_top = np.cumsum(by_threshold[::-1])[::-1]
    increments = np.diff(parameters.thresholds)
    return np.concatenate(
        [
            from_top[:1],
            from_top[1:] * increments,
            by_location.sum(axis=1)[1:],
            standard @ by_location.sum(axis=0),
        ]
    )
