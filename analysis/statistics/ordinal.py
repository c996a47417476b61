"""Cumulative mixed model of the scores: condition effects that a ceiling does not bias."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import logit, ndtri

from analysis.estimates import FloatArray, IntArray, NotEstimable
from analysis.statistics.ordinal_likelihood import (
    Link,
    Parameters,
    ScoreCounts,
    log_likelihood,
    unpacked,
)
from analysis.statistics.signed_rank import DECIMALS

FIRST_NODES = 81
MOST_NODES = 1296
MOST_CATEGORIES = 21
# Bound on the parameters, in latent units; an estimate that diverges stops here.
FARTHEST = 50.0
# Largest slope of the log-likelihood that counts as a maximum.
STEEP = 1e-3
# Least curvature of the log-likelihood: a flatter direction has no maximum within the bounds.
FLAT = 1e-5


@dataclass(frozen=True, kw_only=True)
class OrdinalEffects:
    """Effects of conditions on the latent scale, whose residual is standard normal or logistic.

    `effects` are relative to the `reference` condition, which they omit; `thresholds` lie between
    the scores that occur, `categories`. `subject_sd` is the standard deviation of the subjects'
    levels. Standard errors are from the observed information.
    """

    link: Link
    reference: str
    effects: Mapping[str, float]
    standard_errors: Mapping[str, float]
    thresholds: tuple[float, ...]
    categories: tuple[float, ...]
    subject_sd: float
    log_likelihood: float


def ordinal_effects_of_trials(
    *,
    scores: FloatArray,
    subject: IntArray,
    condition: IntArray,
    conditions: tuple[str, ...],
    link: Link,
) -> OrdinalEffects | NotEstimable:
    """Return the maximum-likelihood fit to single trials, or why it is not possible.

    P(score <= c_k) = F(θ_k - β_condition - b_subject), b ~ N(0, σ²): the cumulative link model
    of McCullagh (Journal of the Royal Statistical Society B 42, 1980) with a random level.

    Parameters:
        scores: shape (trials,), finite; each distinct value is a category.
        subject: shape (trials,), whole numbers.
        condition: shape (trials,), positions in `conditions`.
        conditions: names; the first is the reference.
        link: F normal ("probit") or logistic ("logit").
    """
    categories, category = np.unique(np.round(scores, DECIMALS), return_inverse=True)
    people, person = np.unique(subject, return_inverse=True)
    counts = np.zeros((len(people), len(conditions), len(categories)))
    np.add.at(counts, (person, condition, category), 1.0)
    if refusal := _refusal(counts, conditions):
        return refusal
    data = ScoreCounts(counts=counts)
    packed, value, nodes = _maximum(data, link)
    covariance = _covariance(packed, data, link, nodes)
    fitted = unpacked(packed, data.categories)
    if isinstance(covariance, NotEstimable):
        return covariance
    if covariance is None:
        extreme = conditions[int(np.argmax(np.abs(fitted.effects)))]
        return NotEstimable(
            "the likelihood has no maximum, because scores do not overlap between "
            f"conditions or subjects; the effect that diverges is that of {extreme}"
        )
    errors = np.sqrt(np.diag(covariance))[data.categories - 1 : -1]
    return OrdinalEffects(
        link=link,
        reference=conditions[0],
        effects=dict(zip(conditions[1:], fitted.effects[1:].tolist(), strict=True)),
        standard_errors=dict(zip(conditions[1:], errors.tolist(), strict=True)),
        thresholds=tuple(fitted.thresholds.tolist()),
        categories=tuple(categories.tolist()),
        subject_sd=abs(fitted.subject_sd),
        log_likelihood=value,
    )


def _refusal(counts: FloatArray, conditions: tuple[str, ...]) -> NotEstimable | None:
    subjects, _, categories = counts.shape
    if subjects < 2:
        return NotEstimable(f"the model needs scores of at least 2 subjects, got {subjects}")
    if not 2 <= categories <= MOST_CATEGORIES:
        return NotEstimable(
            f"the model needs 2 to {MOST_CATEGORIES} different scores, got {categories}"
        )
    for name, number in zip(conditions, counts.sum(axis=(0, 2)), strict=True):
        if number == 0:
            return NotEstimable(f"no score was given under {name}")
    return None


def _maximum(data: ScoreCounts, link: Link) -> tuple[FloatArray, float, int]:
    """Return parameters, log-likelihood and the number of nodes at which it has converged."""
    packed, value = _climb(_start(data, link), data, link, FIRST_NODES)
    nodes = FIRST_NODES
    while nodes < MOST_NODES and np.abs(packed).max() < FARTHEST / 2:
        finer = log_likelihood(packed, data, link, 2 * nodes)[0]
        nodes *= 2
        if abs(finer - value) < 1e-9 * abs(value):
            break
        packed, value = _climb(packed, data, link, nodes)
    return packed, value, nodes


def _climb(
    start: FloatArray, data: ScoreCounts, link: Link, nodes: int
) -> tuple[FloatArray, float]:
    def cost(packed: FloatArray) -> tuple[float, FloatArray]:
        value, gradient = log_likelihood(packed, data, link, nodes)
        return -value, -gradient

    bounds = [(-FARTHEST, FARTHEST)] * len(start)
    bounds[1 : data.categories - 1] = [(-np.log(FARTHEST) * 4, np.log(FARTHEST))] * (
        data.categories - 2
    )
    found = minimize(
        cost,
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=bounds,
        options={"gtol": 1e-7, "ftol": 1e-15, "maxiter": 1000, "maxcor": 30},
    )
    return np.asarray(found.x, dtype=np.float64), -float(found.fun)


def _start(data: ScoreCounts, link: Link) -> FloatArray:
    """Return the initial parameters: no condition effects, and subjects with unit variance."""
    shares = np.cumsum(data.counts.sum(axis=(0, 1)))[:-1] / data.counts.sum()
    quantile = ndtri if link == "probit" else logit
    return Parameters(
        thresholds=np.asarray(quantile(shares)) * np.sqrt(2.0),
        effects=np.zeros(data.conditions),
        subject_sd=1.0,
    ).packed


def _covariance(
    packed: FloatArray, data: ScoreCounts, link: Link, nodes: int
) -> FloatArray | NotEstimable | None:
    """Return the inverse observed information, None if the parameters are not at a maximum.

    If all but the last parameter, the subjects' standard deviation, have a maximum, say so.
    """
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
