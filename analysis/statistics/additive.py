"""Effects of conditions and subjects, and whether subjects differ in more than their level."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from analysis.estimates import FloatArray, IntArray, NotEstimable
from analysis.loading.score_table import BoolArray, ScoreTable
from analysis.statistics.two_way import TwoWay, two_way


@dataclass(frozen=True, kw_only=True)
class AdditiveEffects:
    """Score = grand mean + condition + subject + residual, effects in rating points by name.

    Effects sum to zero. Subjects and conditions without any score are absent. `subject_sd` is
    the moment estimate of how far subjects differ (0 when they differ less than chance makes
    them). `shrinkage` is the share of a subject's observed deviation that is to be believed, with
    every condition scored; `subject_shrinkage` is the same with the scores each subject gave.
    """

    grand_mean: float
    conditions: Mapping[str, float]
    subjects: Mapping[str, float]
    residual_sd: float
    residual_df: int
    subject_sd: float
    shrinkage: float | NotEstimable
    subject_shrinkage: Mapping[str, float | NotEstimable]


@dataclass(frozen=True, kw_only=True)
class GainHeterogeneity:
    """Whether subjects differ in how strongly the conditions' effects show in their scores.

    `gains` has each subject's slope on the condition effects (1 on average), without the subjects
    whose slope cannot be compared with the others'; `tau` is the moment estimate of the standard
    deviation of the true slopes, 0 when they spread no more than chance.
    """

    f: float
    df: tuple[int, int]
    p: float
    gains: Mapping[str, float]
    tau: float


def additive_effects(table: ScoreTable) -> AdditiveEffects | NotEstimable:
    """Return condition and subject effects by least squares, or why there are none."""
    fit = two_way(table)
    if isinstance(fit, NotEstimable):
        return fit
    subject_variance = max(0.0, fit.row_variance)
    counts = fit.table.given.sum(axis=1)
    return AdditiveEffects(
        grand_mean=fit.grand_mean,
        conditions=_named(fit.table.conditions, fit.columns),
        subjects=_named(fit.table.subjects, fit.rows),
        residual_sd=float(np.sqrt(fit.residual_variance)),
        residual_df=fit.residual_df,
        subject_sd=float(np.sqrt(subject_variance)),
        shrinkage=_shrinkage(subject_variance, fit.residual_variance, len(fit.columns)),
        subject_shrinkage={
            name: _shrinkage(subject_variance, fit.residual_variance, int(count))
            for name, count in zip(fit.table.subjects, counts, strict=True)
        },
    )


def gain_heterogeneity(table: ScoreTable) -> GainHeterogeneity | NotEstimable:
    """Return the test of equal slopes on the condition effects, or why there is none.

    To the additive fit a slope of each subject on the fitted condition effects is added (Mandel's
    bundle of straight lines, Technometrics 3, 1961; after Tukey's one degree of freedom). F is of
    the extra sum of squares Q, given levels of subjects and of conditions, so that cells may be
    missing; the effects and the residuals that Q is made of are independent, which makes it exact.
    τ² = (Q - df σ²) / trace of the slopes' information (Henderson's method III).
    """
    fit = two_way(table)
    if isinstance(fit, NotEstimable):
        return fit
    slopes = _slopes(fit)
    if isinstance(slopes, NotEstimable):
        return slopes
    df = (slopes.rank, fit.residual_df - slopes.rank)
    if min(df) < 1:
        return NotEstimable(
            reason=f"slopes and residual have {df[0]} and {df[1]} degrees of freedom"
        )
    within = fit.residual_squares - slopes.squares
    if within <= 1e-12 * fit.residual_squares:
        return NotEstimable(reason="the slopes explain the scores entirely, no residual is left")
    variance = within / df[1]
    f = slopes.squares / df[0] / variance
    return GainHeterogeneity(
        f=f,
        df=df,
        p=float(fdtrc(*df, f)),
        gains={fit.table.subjects[row]: 1.0 + excess for row, excess in slopes.excess.items()},
        tau=float(np.sqrt(max(0.0, (slopes.squares - df[0] * variance) / slopes.information))),
    )


def _named(names: tuple[str, ...], values: FloatArray) -> dict[str, float]:
    return {name: float(value) for name, value in zip(names, values, strict=True)}


def _shrinkage(variance: float, residual: float, count: int) -> float | NotEstimable:
    if variance + residual == 0:
        return NotEstimable(reason="neither subjects nor residuals vary")
    return variance / (variance + residual / count)


@dataclass(frozen=True, kw_only=True)
class _Slopes:
    """What slopes on the condition effects add to the additive fit.

    `squares` is their extra sum of squares and `rank` its degrees of freedom; `information` the
    trace of their information matrix; `excess` each slope minus 1 by row of the table, 0 on
    average, of the rows whose slopes can be compared.
    """

    squares: float
    rank: int
    information: float
    excess: Mapping[int, float]


def _slopes(fit: TwoWay) -> _Slopes | NotEstimable:
    """Return the slopes by least squares, subjects and conditions allowed for.

    With E the effects about each subject's own mean over the cells given, their information is
    G = diag(E E') - E L⁺ E', L that of the conditions. In units of √diag(E E') it is I - U U', so
    that the singular values of U, few as the conditions, solve it; those of 1 are what a level of
    each condition does as well as slopes.
    """
    own = _about_row_means(fit.columns, fit.table.given)
    lengths = np.sqrt((own**2).sum(axis=1))
    rows = np.flatnonzero(lengths > 1e-6 * max(1.0, float(lengths.max())))
    if not (fit.columns**2).sum() > 0 or not rows.size:
        return NotEstimable(reason="the conditions do not differ, so that no slope can be seen")
    own, lengths = own[rows], lengths[rows]
    residuals = np.where(fit.table.given, fit.residuals, 0.0)[rows]
    products = (own * residuals).sum(axis=1) / lengths
    turned, sizes, _ = np.linalg.svd(
        own / lengths[:, None] @ _root_of_inverse(fit.table.given), full_matrices=False
    )
    left = 1 - sizes**2
    absorbed = left < 1e-9
    along = turned.T @ products
    weights = np.where(absorbed, -1.0, 1 / np.where(absorbed, 1.0, left) - 1)
    excess = (products + turned @ (weights * along)) / lengths
    comparable = _largest_group(turned[:, absorbed] / lengths[:, None])
    excess -= excess[comparable].mean()
    return _Slopes(
        squares=float(products @ products + weights @ along**2),
        rank=len(rows) - int(absorbed.sum()),
        information=float((lengths**2 * (1 - (turned**2 @ sizes**2))).sum()),
        excess={int(rows[place]): float(excess[place]) for place in comparable},
    )


def _about_row_means(columns: FloatArray, given: BoolArray) -> FloatArray:
    """The columns' values about their mean over the cells given in each row, 0 elsewhere."""
    values = np.where(given, columns, 0.0)
    return np.where(given, values - (values.sum(axis=1) / given.sum(axis=1))[:, None], 0.0)


def _root_of_inverse(given: BoolArray) -> FloatArray:
    """Return R with R R' the inverse of the conditions' information, given levels of subjects."""
    weights = given.astype(np.float64)
    own = weights / weights.sum(axis=1, keepdims=True)
    values, vectors = np.linalg.eigh(np.diag(weights.sum(axis=0)) - weights.T @ own)
    # All conditions raised alike is what a level of the subjects does: its value is 0.
    return np.asarray(vectors[:, 1:] / np.sqrt(values[1:]))


def _largest_group(free: FloatArray) -> IntArray:
    """Return the rows that move alike in every direction that the data leave free."""
    if free.shape[1] == 1:
        return np.arange(len(free))
    alike = (np.abs(free[:, None] - free[None]) < 1e-6 * np.abs(free).max()).all(axis=2)
    return np.flatnonzero(alike[alike.sum(axis=1).argmax()])
