"""Cumulative mixed model of the scores: condition effects that a ceiling does not bias."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc, chdtri, ndtri

from analysis.estimates import FloatArray, IntArray, Interval, NotEstimable
from analysis.statistics.ordinal_likelihood import (
    MANY,
    Link,
    ScoreCounts,
    log_likelihood,
    unpacked,
)
from analysis.statistics.ordinal_maximum import (
    Maximum,
    covariance_at,
    maximum,
    profile_limit,
    start_of,
)
from analysis.statistics.signed_rank import DECIMALS

MOST_CATEGORIES = 21
# Difference of log-likelihoods that is rounding.
ROUNDING = 1e-6
# First value of the interaction's SD.
FIRST_SD = 0.5
# An SD of so many standard errors has a likelihood like a normal one among many subjects.
STANDARD_ERRORS, NORMAL_95 = 5.0, float(ndtri(0.975))


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
    *,
    scores: FloatArray,
    subject: IntArray,
    condition: IntArray,
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
    categories, category = np.unique(np.round(scores, DECIMALS), return_inverse=True)
    people, person = np.unique(subject, return_inverse=True)
    counts = np.zeros((len(people), len(conditions), len(categories)))
    np.add.at(counts, (person, condition, category), 1.0)
    if refusal := _refusal(counts, conditions):
        return refusal
    data = ScoreCounts(counts=counts)
    best = maximum(start_of(data, link), data, link)
    covariance = covariance_at(best, data, link)
    if isinstance(covariance, NotEstimable):
        return covariance
    if covariance is None:
        return NotEstimable(
            "the likelihood has no maximum, because scores do not overlap between conditions or "
            "subjects"
        )
    # A climb stops elsewhere on every processor; a step of Newton's from there does not.
    slope = log_likelihood(best.packed, data, link, best.nodes)[1]
    best = replace(best, packed=best.packed + covariance @ slope)
    fitted = unpacked(best.packed, data)
    return OrdinalEffects(
        link=link,
        reference=conditions[0],
        effects=_named(conditions, fitted.effects[1:]),
        standard_errors=_named(conditions, _standard_errors(covariance, data)),
        thresholds=tuple(fitted.thresholds.tolist()),
        categories=tuple(categories.tolist()),
        subject_sd=abs(float(fitted.sds[0])),
        log_likelihood=best.value,
        interaction=_interaction(best, covariance, data, link, conditions),
    )


def _named(conditions: tuple[str, ...], values: FloatArray) -> dict[str, float]:
    return dict(zip(conditions[1:], values.tolist(), strict=True))


def _standard_errors(covariance: FloatArray, data: ScoreCounts) -> FloatArray:
    effects = slice(data.categories - 1, data.categories + data.conditions - 2)
    return np.asarray(np.sqrt(np.diag(covariance))[effects])


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


def _interaction(
    without: Maximum,
    covariance: FloatArray,
    data: ScoreCounts,
    link: Link,
    conditions: tuple[str, ...],
) -> Interaction | NotEstimable:
    """Return the fit with a random level of each subject under each condition.

    Parameters:
        without: the maximum without it.
        covariance: that of its parameters.
        data, link: of both.
        conditions: names.
    """
    if data.counts.sum(axis=2).max() < 2:
        return NotEstimable("no subject scored a condition twice")
    best = maximum(np.append(without.packed, FIRST_SD), data, link)
    ratio = 2 * (best.value - without.value)
    if ratio < ROUNDING:
        at_0 = np.append(without.packed, 0.0)
        best = Maximum(packed=at_0, value=without.value, nodes=best.nodes)
        ratio, spread = 0.0, 0.0
    else:
        known = covariance_at(best, data, link)
        if not isinstance(known, np.ndarray):
            return NotEstimable(
                "the scores do not determine the standard deviation between a subject's conditions"
            )
        covariance, spread = known, float(np.sqrt(known[-1, -1]))
    fitted = unpacked(best.packed, data)
    return Interaction(
        sd=abs(float(fitted.sds[1])),
        sd_interval=_interval(best, ratio, spread, data, link),
        likelihood_ratio=ratio,
        p=float(chdtrc(1, ratio)) / 2 if ratio else 1.0,
        effects=_named(conditions, fitted.effects[1:]),
        standard_errors=_named(conditions, _standard_errors(covariance, data)),
        subject_sd=abs(float(fitted.sds[0])),
        log_likelihood=best.value,
    )


def _interval(
    best: Maximum, ratio: float, spread: float, data: ScoreCounts, link: Link
) -> Interval | NotEstimable:
    """Return the 95% interval of the last SD by the profile likelihood.

    Of many subjects, where the SD is well above 0, the profile is the parabola of its standard
    error.

    Parameters:
        best: the maximum.
        ratio: twice the rise of the log-likelihood from an SD of 0 to the maximum.
        spread: standard error of the SD, 0 where it is unknown.
        data, link: of the maximum.
    """
    sd = abs(float(best.packed[-1]))
    if len(data.counts) >= MANY and sd > STANDARD_ERRORS * spread > 0:
        return sd - NORMAL_95 * spread, sd + NORMAL_95 * spread
    limits = [0.0]
    for side in (-1.0, 1.0) if ratio > chdtri(1, 0.05) else (1.0,):
        first = max(sd + side * (2 * spread or FIRST_SD), 0.0)
        found = profile_limit(best, side, first, data, link)
        if found is None:
            return NotEstimable("the likelihood does not limit the standard deviation")
        limits.append(found)
    return limits[-2], limits[-1]
