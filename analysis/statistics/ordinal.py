"""Cumulative mixed model of the scores: condition effects that a ceiling does not bias.

Numbers of equations are those of docs/mathematics/ordinal.md.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.polynomial.hermite_e import hermegauss
from scipy.optimize import minimize
from scipy.special import chdtrc, chdtri, log_expit, log_ndtr, logit, logsumexp, ndtri

from analysis.estimates import LEVEL, UPPER, FloatArray, IntArray, Interval, NotEstimable
from analysis.statistics.signed_rank import DECIMALS

Link: TypeAlias = Literal["probit", "logit"]

# Limits of the integrals over a subject's level and a cell's, in standard deviations.
REACH, CELL_REACH = 8.0, 6.0
SMALLEST = 1e-300
# So many subjects of similar levels share the levels at which their likelihood is not negligible:
# relative to the largest, its logarithm is at least -FAR, and at the ends the posterior is small.
ALIKE, FAR, NEGLIGIBLE = 100, 35.0, 1e-9
# From so many subjects on, cells' levels are first integrated by Gauss-Hermite quadrature.
MANY, GAUSS_HERMITE = 200, 8


@dataclass(frozen=True, kw_only=True, eq=False)
class ScoreCounts:
    """Number of scores, shape (subjects, conditions, categories), from the lowest score up.

    `link` is the distribution of the latent residual. `design` has the effect of each condition per
    coefficient, shape (conditions, coefficients); without it each condition but the first has a
    coefficient of its own.
    """

    counts: FloatArray
    link: Link
    design: FloatArray | None = None

    @cached_property
    def coding(self) -> FloatArray:
        """The design."""
        own = np.eye(self.counts.shape[1])[:, 1:]
        return own if self.design is None else self.design

    @cached_property
    def alike(self) -> list[FloatArray]:
        """The counts (conditions, subjects, categories) of subjects with similar mean scores."""
        sums = self.counts.sum(axis=1)
        means = sums @ np.arange(self.categories) / sums.sum(axis=1)
        groups = np.array_split(np.argsort(means, kind="stable"), -(-len(means) // ALIKE))
        return [np.swapaxes(self.counts[group], 0, 1) for group in groups]

    @property
    def coefficients(self) -> slice:
        """Where the coefficients of the effects stand among the packed parameters."""
        return slice(self.categories - 1, self.categories - 1 + self.coding.shape[1])

    @property
    def categories(self) -> int:
        """Number of distinct scores."""
        return int(self.counts.shape[2])


@dataclass(frozen=True, kw_only=True, eq=False)
class Parameters:
    """Thresholds (categories - 1), condition effects and SDs of random levels.

    The SD between subjects comes first. The second one, if there is one, is that between a
    subject's conditions, the subject × condition interaction.
    """

    thresholds: FloatArray
    effects: FloatArray
    sds: FloatArray


def unpacked(packed: FloatArray, data: ScoreCounts) -> Parameters:
    """Return the parameters of a vector of free ones.

    These are the first threshold, log increments of the others, coefficients of effects, and SDs.
    """
    own = data.coefficients
    increments = np.exp(packed[1 : own.start])
    return Parameters(
        thresholds=packed[0] + np.concatenate([[0.0], np.cumsum(increments)]),
        effects=data.coding @ packed[own],
        sds=packed[own.stop :],
    )


def log_likelihood(packed: FloatArray, data: ScoreCounts, nodes: int) -> tuple[float, FloatArray]:
    """Return the log-likelihood (2) and its gradient with respect to the packed parameters.

    (1): P(score <= k | subject s, condition j) = F(θ_k - β_j - σ u_s - ω v_sj), all u, v ~ N(0, 1),
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
    log_p, slopes = _log_probabilities(parameters.thresholds, location, data.link)
    by_level = log_p.reshape(*log_p.shape[:2], nodes, len(own))
    total, weights = _shares(data, by_level, log_weights, log_own)
    # `slopes` is overwritten.
    upper, lower = (np.multiply(weights.reshape(log_p.shape), slope, out=slope) for slope in slopes)
    by_threshold = upper[:, :-1].sum(axis=(0, 2)) + lower[:, 1:].sum(axis=(0, 2))
    by_location = -np.add(upper, lower, out=upper).sum(axis=1)
    # An increment moves its own threshold and all above it.
    from_top = np.cumsum(by_threshold[::-1])[::-1]
    return total, np.concatenate(
        [
            from_top[:1],
            from_top[1:] * np.diff(parameters.thresholds),
            data.coding.T @ by_location.sum(axis=1),
            standard @ by_location.sum(axis=0),
        ]
    )


def _shares(
    data: ScoreCounts, log_p: FloatArray, log_weights: FloatArray, log_own: FloatArray
) -> tuple[float, FloatArray]:
    """Return (2) and how many scores are where: of each condition and category at each level."""
    # A cell's own levels go first: what is done along a short last axis takes numpy much longer.
    log_p = np.ascontiguousarray(np.moveaxis(log_p, 3, 0))
    nodes, weights, total = len(log_weights), np.zeros(log_p.shape), 0.0
    for counts in data.alike:
        windows = [slice(0, nodes)]
        if len(data.alike) > 1:
            ends = _cells(counts[:, [0, -1]], log_p, log_own)[0] + log_weights
            windows = [_window(ends), *windows]
        for window in windows:
            by_cell, known = _cells(counts, log_p[..., window], log_own)
            by_level = by_cell + log_weights[window]
            per_subject = logsumexp(by_level, axis=1, keepdims=True)
            shares = np.exp(by_level - per_subject)
            if _holds(window, shares, nodes):
                break
        known *= shares
        weights[..., window] += np.swapaxes(counts, 1, 2) @ known
        total += float(per_subject.sum())
    return total, np.ascontiguousarray(np.moveaxis(weights, 0, 3))


def _cells(
    counts: FloatArray, log_p: FloatArray, log_own: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the log-likelihood of subjects at levels, and the shares of their cells' levels.

    Shapes: `counts` (conditions, subjects, categories), `log_p` (own levels, conditions,
    categories, levels), `log_own` (own levels,), and (subjects, levels) and (own levels,
    conditions, subjects, levels) of what is returned.
    """
    cells = counts @ log_p
    cells += log_own[:, None, None, None]
    highest = cells.max(axis=0)
    cells -= highest
    known = np.exp(cells, out=cells)
    total = _total(known)
    known /= total
    return (highest + np.log(total)).sum(axis=0), known


def _total(parts: FloatArray) -> FloatArray:
    """Return the sum over the first axis, in the order in which numpy adds up to 128 neighbours."""
    whole = len(parts) // 8 * 8
    if not whole:
        return np.asarray(parts.sum(axis=0))
    eight = parts[:whole].reshape(-1, 8, *parts.shape[1:]).sum(axis=0)
    four = eight[::2] + eight[1::2]
    two = four[::2] + four[1::2]
    return np.asarray(sum(parts[whole:], two[0] + two[1]))


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

    Few of Gauss and Hermite's suffice for most cohorts of many subjects. Where they do not, cells
    tell their levels well, and evenly spaced points are closer to each other there.
    """
    if len(data.counts) < MANY or nodes > NODES[2][0]:
        return _normal_nodes(CELL_REACH, nodes // 2)
    points, weights = hermegauss(GAUSS_HERMITE)
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
    edges = np.concatenate([[-np.inf], thresholds, [np.inf]])[:, None]
    log_p, upper, lower = np.empty((3, len(location), len(edges) - 1, location.shape[1]))
    # One condition at a time and in place: what is computed stays in the processor's cache, and
    # the system need not give new memory for each step.
    work = np.empty((4, len(edges), location.shape[1]))
    for own, above, below, at in zip(log_p, upper, lower, location, strict=True):
        log_density = _log_intervals(np.subtract(edges, at, out=work[0]), link, own, work[1:])
        # (3)
        for slope, density in ((above, log_density[1:]), (below, log_density[:-1])):
            np.subtract(density, own, out=slope)
            np.exp(np.minimum(slope, -np.log(SMALLEST), out=slope), out=slope)
        np.negative(below, out=below)
    return log_p, (upper, lower)


def _log_intervals(bounds: FloatArray, link: Link, out: FloatArray, work: FloatArray) -> FloatArray:
    """Put log(F(upper) - F(lower)) between neighbouring `bounds` into `out`.

    Each is computed in the tail where F keeps its precision. Return the logarithm of the density
    at the bounds, -inf at the infinite ones.
    """
    tail: FloatArray = np.abs(bounds, out=work[0])
    whole, low = work[1], work[2, 1:]
    positive = bounds > 0
    mirrored, around = positive[:-1], positive[1:] & ~positive[:-1]  # (4)
    # An edge's tail serves both categories beside it.
    if link == "probit":
        log_ndtr(np.negative(tail, out=tail), out=tail)
        beyond = log_ndtr(bounds[1:][around])
    else:
        log_expit(tail, out=whole)
        np.subtract(whole, tail, out=tail)  # F(-x) = exp(-x) F(x)
        beyond = whole[1:][around]
    np.copyto(out, tail[1:])
    np.copyto(out, tail[:-1], where=mirrored)
    out[around] = beyond
    np.copyto(low, tail[:-1])
    np.copyto(low, tail[1:], where=mirrored)
    # Thresholds that meet during a search must give a tiny probability, not NaN.
    low -= out
    np.expm1(np.minimum(low, -SMALLEST, out=low), out=low)
    out += np.log(np.negative(low, out=low), out=low)
    if link == "logit":
        tail += whole
        return tail
    np.square(bounds, out=bounds)
    bounds /= -2
    bounds -= np.log(2 * np.pi) / 2
    return bounds


# First and largest number of nodes, and the change of the log-likelihood on doubling them that
# counts as none, by the number of random levels.
NODES = {1: (81, 1296, 1e-7), 2: (41, 324, 1e-5)}
# Bound on the parameters, in latent units; an estimate that diverges stops here.
FARTHEST = 50.0
# By symmetry the likelihood has no slope at an SD of 0, where a climb may stop though it rises on
# either side: this far off that shows.
BESIDE = 0.1
# Largest slope of the log-likelihood that counts as a maximum.
STEEP = 1e-3
# Least curvature of the log-likelihood: a flatter direction has no maximum within the bounds.
FLAT = 1e-5
# How far from its limit a log-likelihood may end.
FAR_OFF = 1e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class Maximum:
    """Parameters, log-likelihood and the number of nodes at which it has converged."""

    packed: FloatArray
    value: float
    nodes: int


def maximum(start: FloatArray, data: ScoreCounts) -> Maximum:
    """Return the maximum that a climb from `start` reaches."""
    nodes, most, rounding = NODES[len(unpacked(start, data).sds)]
    packed, value = _top(start, data, nodes)
    while nodes < most and np.abs(packed).max() < FARTHEST / 2:
        finer = log_likelihood(packed, data, 2 * nodes)[0]
        if abs(finer - value) < rounding:
            break
        nodes *= 2
        packed, value = _top(packed, data, nodes)
    return Maximum(packed=packed, value=value, nodes=nodes)


def _top(start: FloatArray, data: ScoreCounts, nodes: int) -> tuple[FloatArray, float]:
    packed, value = _climb(start, data, nodes)
    for place in range(data.coefficients.stop, len(packed)):
        beside = np.where(np.arange(len(packed)) == place, BESIDE, packed)
        if abs(packed[place]) < BESIDE and (
            log_likelihood(beside, data, nodes)[0] > value + ROUNDING
        ):
            packed, value = _climb(beside, data, nodes)
    return packed, value


def _climb(start: FloatArray, data: ScoreCounts, nodes: int) -> tuple[FloatArray, float]:
    def cost(packed: FloatArray) -> tuple[float, FloatArray]:
        value, gradient = log_likelihood(packed, data, nodes)
        return -value, -gradient

    found = minimize(
        cost,
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=_bounds(start, data),
        options={"gtol": 1e-7, "ftol": 1e-15, "maxiter": 1000, "maxcor": 30},
    )
    return np.asarray(found.x, dtype=np.float64), -float(found.fun)


def _bounds(packed: FloatArray, data: ScoreCounts) -> list[tuple[float, float]]:
    bounds = [(-FARTHEST, FARTHEST)] * len(packed)
    increments = (-np.log(FARTHEST) * 4, np.log(FARTHEST))
    bounds[1 : data.categories - 1] = [increments] * (data.categories - 2)
    return bounds


def start_of(data: ScoreCounts) -> FloatArray:
    """Return the initial parameters: no condition effects, and subjects with unit variance."""
    shares = np.cumsum(data.counts.sum(axis=(0, 1)))[:-1] / data.counts.sum()
    quantile = ndtri if data.link == "probit" else logit
    thresholds = np.asarray(quantile(shares)) * np.sqrt(2.0)
    none = np.zeros(data.coding.shape[1])
    return np.concatenate([thresholds[:1], np.log(np.diff(thresholds)), none, np.ones(1)])


def covariance_at(found: Maximum, data: ScoreCounts) -> FloatArray | NotEstimable | None:
    """Return the inverse observed information, None if the parameters are not at a maximum.

    If all but the last parameter, a standard deviation, have a maximum, say so.
    """
    packed, nodes = found.packed, found.nodes

    def slope(at: FloatArray) -> FloatArray:
        return log_likelihood(at, data, nodes)[1]

    if np.abs(slope(packed)).max() > STEEP or np.abs(packed).max() >= FARTHEST / 2:
        return None
    steps = np.eye(len(packed)) * 1e-5
    information = np.array([slope(packed - step) - slope(packed + step) for step in steps]) / 2e-5
    information = (information + information.T) / 2
    if np.linalg.eigvalsh(information)[0] < FLAT:
        if np.linalg.eigvalsh(information[:-1, :-1])[0] < FLAT:
            return None
        return NotEstimable(
            "the scores do not determine the standard deviation between subjects: too few "
            "subjects have two scores that tell about their level"
        )
    return np.asarray(np.linalg.inv(information))


def profile_limit(fit: "Fitted", side: float, data: ScoreCounts) -> float | None:
    """Return the end of the last parameter's 95% interval by the profile (5), at least 0.

    `side` is 1 for the upper, -1 for the lower end.
    """
    best, covariance = fit
    nodes, least = best.nodes, best.value - float(chdtri(1, LEVEL)) / 2
    # In these units the likelihood is about as curved in each direction. In others a search may
    # stop where it is as likely as at the end, and the SD is not.
    root = np.linalg.cholesky(covariance)
    lower, upper = np.array([*_bounds(best.packed, data)[:-1], (0.0, FARTHEST)]).T

    @cache
    def room(away: bytes, nodes: int) -> tuple[FloatArray, FloatArray]:
        packed = best.packed + root @ np.frombuffer(away)
        value, slope = log_likelihood(packed, data, nodes)
        left = np.concatenate([[value - least], packed - lower, upper - packed])
        return left, np.vstack([slope @ root, root, -root])

    def shorter(away: FloatArray) -> tuple[float, FloatArray]:
        return -side * float(root[-1] @ away), -side * root[-1]

    spread = float(np.linalg.norm(root[-1]))
    step = NORMAL_95 if side > 0 else -min(NORMAL_95, float(best.packed[-1]) / spread / 2)
    away = root[-1] * step / spread
    # A larger SD may need more nodes than the maximum does.
    while nodes <= NODES[2][1]:
        limits: Any = {
            "type": "ineq",
            "fun": lambda away, nodes: room(away.tobytes(), nodes)[0],
            "jac": lambda away, nodes: room(away.tobytes(), nodes)[1],
            "args": (nodes,),
        }
        found = minimize(
            shorter, away, jac=True, method="SLSQP", constraints=limits, options={"ftol": 1e-9}
        )
        away, nodes = np.asarray(found.x, dtype=np.float64), 2 * nodes
        (off, *_), (slope, *_) = room(away.tobytes(), nodes)
        # What the other parameters would gain at the same SD: their part of the slope.
        beside = slope - root[-1] * (root[-1] @ slope) / spread**2
        if max(abs(off), float(beside @ beside)) < FAR_OFF:
            return float(best.packed[-1] + root[-1] @ away)
    return None


MOST_CATEGORIES = 21
# Difference of log-likelihoods that is rounding.
ROUNDING = 1e-6
# First value of the interaction's SD.
FIRST_SD = 0.5
NORMAL_95 = float(ndtri(UPPER))


@dataclass(frozen=True, kw_only=True)
class Interaction:
    """The same model with a random level of each subject under each condition.

    `sd` is the standard deviation of those levels, 0 if the likelihood is largest there, with the
    95% interval of the profile likelihood. `p` tests that it is 0 by the likelihood ratio, which
    then is 0 or chi-square with one degree of freedom, with equal probability (Self and Liang,
    Journal of the American Statistical Association 82, 1987).
    """

    sd: float
    sd_interval: Interval | NotEstimable
    likelihood_ratio: float
    p: float
    effects: Mapping[str, float]
    standard_errors: Mapping[str, float]
    subject_sd: float
    log_likelihood: float


@dataclass(frozen=True, kw_only=True)
class OrdinalEffects:
    """Effects of conditions on the latent scale, whose residual is standard normal or logistic.

    `effects` are relative to the `reference` condition, which they omit; `thresholds` lie between
    the scores that occur, `categories`. `subject_sd` is the standard deviation of the subjects'
    levels. Standard errors are from the observed information; where subjects repeated conditions
    and differ in their effects, those of the `interaction` model are right and these too small.
    """

    link: Link
    reference: str
    effects: Mapping[str, float]
    standard_errors: Mapping[str, float]
    thresholds: tuple[float, ...]
    categories: tuple[float, ...]
    subject_sd: float
    log_likelihood: float
    interaction: Interaction | NotEstimable


def ordinal_effects_of_trials(
    scores: FloatArray,
    subject: IntArray,
    condition: IntArray,
    *,
    conditions: tuple[str, ...],
    link: Link,
) -> OrdinalEffects | NotEstimable:
    """Return the maximum-likelihood fit to single trials, or why it is not possible.

    P(score <= c_k) = F(θ_k - β_condition - b_subject), b ~ N(0, σ²): the cumulative link model
    of McCullagh (Journal of the Royal Statistical Society B 42, 1980) with a random level. Where a
    subject repeated a condition, a second fit has one of subject × condition beside it.

    Parameters:
        scores: shape (trials,), finite; each distinct value is a category.
        subject: shape (trials,), whole numbers.
        condition: shape (trials,), positions in `conditions`.
        conditions: names; the first is the reference.
        link: F normal ("probit") or logistic ("logit").
    """
    counts = score_counts(scores, subject, condition, len(conditions))
    if isinstance(counts, NotEstimable):
        return counts
    for name, given in zip(conditions, counts.sum(axis=(0, 2)), strict=True):
        if given == 0:
            return NotEstimable(f"no score was given under {name}")
    data = ScoreCounts(counts=counts, link=link)
    fit = fitted_levels(data)
    if isinstance(fit, NotEstimable):
        return fit
    return OrdinalEffects(
        link=link,
        reference=conditions[0],
        thresholds=tuple(unpacked(fit[0].packed, data).thresholds.tolist()),
        categories=tuple(np.unique(np.round(scores, DECIMALS)).tolist()),
        **_effects(fit, data, conditions),
        interaction=_interaction(fit, data, conditions),
    )


Fitted: TypeAlias = tuple[Maximum, FloatArray]
"""A maximum and the covariance of its parameters."""


def fitted_levels(data: ScoreCounts) -> Fitted | NotEstimable:
    """Return the fit without levels of cells."""
    best = maximum(start_of(data), data)
    covariance = covariance_at(best, data)
    if isinstance(covariance, NotEstimable):
        return covariance
    if covariance is None:
        return NotEstimable(
            "the likelihood has no maximum, because scores do not overlap between conditions or "
            "subjects"
        )
    # A climb stops elsewhere on every processor; a step of Newton's from there does not.
    slope = log_likelihood(best.packed, data, best.nodes)[1]
    return replace(best, packed=best.packed + covariance @ slope), covariance


def _effects(found: Fitted, data: ScoreCounts, conditions: tuple[str, ...]) -> dict[str, Any]:
    """Return the fields that say the same of a fit with and without levels of cells."""
    best, covariance = found
    fitted, errors = unpacked(best.packed, data), np.sqrt(np.diag(covariance))[data.coefficients]
    return {
        "effects": dict(zip(conditions[1:], fitted.effects[1:].tolist(), strict=True)),
        "standard_errors": dict(zip(conditions[1:], errors.tolist(), strict=True)),
        "subject_sd": abs(float(fitted.sds[0])),
        "log_likelihood": best.value,
    }


def score_counts(
    scores: FloatArray, subject: IntArray, condition: IntArray, conditions: int
) -> FloatArray | NotEstimable:
    """Return how often each subject gave each score, shape (subjects, conditions, categories)."""
    categories, category = np.unique(np.round(scores, DECIMALS), return_inverse=True)
    people, person = np.unique(subject, return_inverse=True)
    if len(people) < 2:
        return NotEstimable(f"the model needs scores of at least 2 subjects, got {len(people)}")
    if not 2 <= len(categories) <= MOST_CATEGORIES:
        return NotEstimable(
            f"the model needs 2 to {MOST_CATEGORIES} different scores, got {len(categories)}"
        )
    counts = np.zeros((len(people), conditions, len(categories)))
    np.add.at(counts, (person, condition, category), 1.0)
    return counts


def fitted_cells(
    without: Maximum, covariance: FloatArray, data: ScoreCounts
) -> Fitted | NotEstimable:
    """Return the fit with levels of subjects' cells; their SD is 0 where these do not differ.

    `covariance` is that of the parameters of the fit `without` them, and stays if the SD is 0,
    which has no error of its own.
    """
    if data.counts.sum(axis=2).max() < 2:
        return NotEstimable("no subject scored a condition twice")
    best = maximum(np.append(without.packed, FIRST_SD), data)
    if 2 * (best.value - without.value) < ROUNDING:
        wider = np.pad(covariance, (0, 1))
        wider[-1, -1] = FIRST_SD**2
        return replace(without, packed=np.append(without.packed, 0.0), nodes=best.nodes), wider
    best.packed[-1] = abs(best.packed[-1])
    known = covariance_at(best, data)
    if isinstance(known, np.ndarray):
        return best, known
    return NotEstimable(
        "the scores do not determine the standard deviation between a subject's conditions"
    )


def _interaction(
    without: Fitted, data: ScoreCounts, conditions: tuple[str, ...]
) -> Interaction | NotEstimable:
    found = fitted_cells(*without, data)
    if isinstance(found, NotEstimable):
        return found
    ratio = 2 * (found[0].value - without[0].value)
    return Interaction(
        sd=float(found[0].packed[-1]),
        sd_interval=_interval(found, ratio, data),
        likelihood_ratio=ratio,
        p=float(chdtrc(1, ratio)) / 2 if ratio else 1.0,
        **_effects(found, data, conditions),
    )


def _interval(found: Fitted, ratio: float, data: ScoreCounts) -> Interval | NotEstimable:
    """Return the 95% interval of the last SD; `ratio` is twice the rise from an SD of 0."""
    sides = (-1.0, 1.0) if ratio > chdtri(1, LEVEL) else (1.0,)
    low, high = [0.0, *(profile_limit(found, side, data) for side in sides)][-2:]
    if low is None or high is None:
        return NotEstimable("the likelihood does not limit the standard deviation")
    return low, high
