"""Maximum of the ordinal likelihood, and the curvature there."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.optimize import minimize
from scipy.special import chdtri, logit, ndtri

from analysis.estimates import FloatArray, NotEstimable
from analysis.statistics.ordinal_likelihood import (
    Link,
    Parameters,
    ScoreCounts,
    log_likelihood,
    unpacked,
)

# First and largest number of nodes, and the change of the log-likelihood on doubling them that
# counts as none, by the number of random levels.
NODES = {1: (81, 1296, 1e-7), 2: (41, 324, 1e-5)}
# Bound on the parameters, in latent units; an estimate that diverges stops here.
FARTHEST = 50.0
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


def maximum(start: FloatArray, data: ScoreCounts, link: Link) -> Maximum:
    """Return the maximum that a climb from `start` reaches."""
    nodes, most, rounding = NODES[len(unpacked(start, data).sds)]
    packed, value = _climb(start, data, link, nodes)
    while nodes < most and np.abs(packed).max() < FARTHEST / 2:
        finer = log_likelihood(packed, data, link, 2 * nodes)[0]
        if abs(finer - value) < rounding:
            break
        nodes *= 2
        packed, value = _climb(packed, data, link, nodes)
    return Maximum(packed=packed, value=value, nodes=nodes)


def _climb(
    start: FloatArray, data: ScoreCounts, link: Link, nodes: int
) -> tuple[FloatArray, float]:
    def cost(packed: FloatArray) -> tuple[float, FloatArray]:
        value, gradient = log_likelihood(packed, data, link, nodes)
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


def start_of(data: ScoreCounts, link: Link) -> FloatArray:
    """Return the initial parameters: no condition effects, and subjects with unit variance."""
    shares = np.cumsum(data.counts.sum(axis=(0, 1)))[:-1] / data.counts.sum()
    quantile = ndtri if link == "probit" else logit
    return Parameters(
        thresholds=np.asarray(quantile(shares)) * np.sqrt(2.0),
        effects=np.zeros(data.conditions),
        sds=np.ones(1),
    ).packed


def covariance_at(
    found: Maximum, data: ScoreCounts, link: Link
) -> FloatArray | NotEstimable | None:
    """Return the inverse observed information, None if the parameters are not at a maximum.

    If all but the last parameter, a standard deviation, have a maximum, say so.
    """
    packed, nodes = found.packed, found.nodes
    slope = np.abs(log_likelihood(packed, data, link, nodes)[1]).max()
    if slope > STEEP or np.abs(packed).max() >= FARTHEST / 2:
        return None
    step = 1e-5
    columns = []
    for direction in np.eye(len(packed)) * step:
        ahead = log_likelihood(packed + direction, data, link, nodes)[1]
        behind = log_likelihood(packed - direction, data, link, nodes)[1]
        columns.append((behind - ahead) / (2 * step))
    information = np.array(columns)
    information = (information + information.T) / 2
    if np.linalg.eigvalsh(information)[0] < FLAT:
        if np.linalg.eigvalsh(information[:-1, :-1])[0] < FLAT:
            return None
        return NotEstimable(
            "the scores do not determine the standard deviation between subjects: too few "
            "subjects have two scores that tell about their level"
        )
    return np.asarray(np.linalg.inv(information))


def profile_limit(
    best: Maximum, side: float, first: float, data: ScoreCounts, link: Link
) -> float | None:
    """Return the end of the last parameter's 95% interval by the profile likelihood, at least 0.

    Parameters:
        best: the maximum.
        side: 1 for the upper, -1 for the lower end.
        first: where the search starts.
        data, link: of the maximum.
    """
    _, most, _ = NODES[len(unpacked(best.packed, data).sds)]
    least = best.value - float(chdtri(1, 0.05)) / 2
    nodes, packed = best.nodes, np.append(best.packed[:-1], first)
    # A larger SD may need more nodes than the maximum does.
    while nodes <= most:
        packed = _farthest(packed, side, least, nodes, data, link)
        if abs(log_likelihood(packed, data, link, 2 * nodes)[0] - least) < FAR_OFF:
            return float(packed[-1])
        nodes *= 2
    return None


def _farthest(
    start: FloatArray, side: float, least: float, nodes: int, data: ScoreCounts, link: Link
) -> FloatArray:
    """Return the parameters with the largest last one, times `side`, that are this likely."""
    towards = np.append(np.zeros(len(start) - 1), -side)

    @cache
    def above(packed: bytes) -> tuple[float, FloatArray]:
        value, gradient = log_likelihood(np.frombuffer(packed), data, link, nodes)
        return value - least, gradient

    def rise(packed: FloatArray) -> float:
        return above(packed.tobytes())[0]

    def slope(packed: FloatArray) -> FloatArray:
        return above(packed.tobytes())[1]

    def shorter(packed: FloatArray) -> tuple[float, FloatArray]:
        return float(towards @ packed), towards

    found = minimize(
        shorter,
        start,
        jac=True,
        method="SLSQP",
        bounds=[*_bounds(start, data)[:-1], (0.0, FARTHEST)],
        constraints={"type": "ineq", "fun": rise, "jac": slope},
        options={"ftol": 1e-9},
    )
    return np.asarray(found.x, dtype=np.float64)
