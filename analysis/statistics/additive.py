"""Effects of conditions and subjects, and whether subjects differ in more than their level."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from analysis.no_answer import NoAnswer
from analysis.scores import FloatArray, ScoreTable
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
    shrinkage: float | NoAnswer
    subject_shrinkage: Mapping[str, float | NoAnswer]


@dataclass(frozen=True, kw_only=True)
class GainHeterogeneity:
    """Whether subjects differ in how strongly the conditions' effects show in their scores.

    `gains` has each subject's slope on the condition effects (1 on average); `tau` is the moment
    estimate of the standard deviation of the true slopes, 0 when they spread no more than chance.
    """

    f: float
    df: tuple[int, int]
    p: float
    gains: Mapping[str, float]
    tau: float


def additive_effects(table: ScoreTable) -> AdditiveEffects | NoAnswer:
    """Return condition and subject effects by least squares, or why there are none."""
    fit = two_way(table)
    if isinstance(fit, NoAnswer):
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


def gain_heterogeneity(table: ScoreTable) -> GainHeterogeneity | NoAnswer:
    """Return the test of equal slopes on the condition effects, or why there is none.

    Each subject's scores are regressed on the additive condition effects (Mandel's bundle of
    straight lines, Technometrics 3, 1961; after Tukey's one degree of freedom). The spread of the
    slopes is DerSimonian and Laird's moment estimate.
    """
    fit = two_way(table)
    if isinstance(fit, NoAnswer):
        return fit
    leverage, slopes = _excess_slopes(fit)
    sloped = leverage > 1e-12 * max(1.0, float(leverage.max()))
    df = (int(sloped.sum()) - 1, fit.residual_df - int(sloped.sum()) + 1)
    if not (fit.columns**2).sum() > 0 or not sloped.any():
        return NoAnswer(reason="the conditions do not differ, so that no slope can be seen")
    if min(df) < 1:
        return NoAnswer(reason=f"slopes and residual have {df[0]} and {df[1]} degrees of freedom")
    between = float((leverage * slopes**2)[sloped].sum())
    within = fit.residual_squares - between
    if within <= 1e-12 * fit.residual_squares:
        return NoAnswer(reason="the slopes explain the scores entirely, no residual is left")
    variance = within / df[1]
    f = between / df[0] / variance
    return GainHeterogeneity(
        f=f,
        df=df,
        p=float(fdtrc(*df, f)),
        gains={
            name: 1.0 + float(slope)
            for name, slope, known in zip(fit.table.subjects, slopes, sloped, strict=True)
            if known
        },
        tau=_moment_tau(leverage[sloped] / variance, slopes[sloped]),
    )


def _named(names: tuple[str, ...], values: FloatArray) -> dict[str, float]:
    return {name: float(value) for name, value in zip(names, values, strict=True)}


def _shrinkage(variance: float, residual: float, count: int) -> float | NoAnswer:
    if variance + residual == 0:
        return NoAnswer(reason="neither subjects nor residuals vary")
    return variance / (variance + residual / count)


def _excess_slopes(fit: TwoWay) -> tuple[FloatArray, FloatArray]:
    """Return each subject's sum of squared condition effects and slope minus 1."""
    given = fit.table.given
    effects = np.where(given, fit.columns, 0.0)
    effects = np.where(given, effects - (effects.sum(1) / given.sum(1))[:, None], 0.0)
    leverage = (effects**2).sum(axis=1)
    products = (effects * np.where(given, fit.residuals, 0.0)).sum(axis=1)
    slopes = np.divide(products, leverage, out=np.zeros_like(products), where=leverage > 0)
    return leverage, slopes


def _moment_tau(precision: FloatArray, excess: FloatArray) -> float:
    heterogeneity = (precision * excess**2).sum() - (len(precision) - 1)
    scale = precision.sum() - (precision**2).sum() / precision.sum()
    return float(np.sqrt(max(0.0, heterogeneity / scale)))
