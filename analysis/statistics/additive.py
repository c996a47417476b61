"""Additive effects of conditions and subjects, and the test of equal slopes across subjects."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from analysis.estimates import (
    UPPER,
    BoolArray,
    FloatArray,
    IntArray,
    Interval,
    NotEstimable,
    ScoreTable,
)
from analysis.statistics import intervals, omnibus
from analysis.statistics.two_way import TwoWay, two_way

SHUFFLES = 9_999
# Large tables get fewer shuffles, at least the least number.
MOST_CELLS = 3_000_000
LEAST_SHUFFLES = 999
# Cells at a time: what the processor's cache holds or, where these would be few tables, so many
# that the system gives memory in large pages.
_CACHED_CELLS, _PAGED_CELLS, _FEW_TABLES = 2**15, 2**19, 32


@dataclass(frozen=True, kw_only=True)
class AdditiveEffects:
    """Score = grand mean + condition + subject + residual, effects in rating points by name.

    Effects sum to zero. Subjects and conditions without any score are absent. `subject_sd` is
    the moment estimate of the standard deviation between subjects (0 if they differ less than
    expected by chance). `shrinkage` is the shrinkage factor of a subject with every condition
    scored; `subject_shrinkage` is that of each subject with the scores the subject gave. The
    95% intervals are over subjects for conditions, and over residuals for subjects.
    """

    grand_mean: float
    conditions: Mapping[str, float]
    subjects: Mapping[str, float]
    residual_sd: float
    residual_df: int
    subject_sd: float
    shrinkage: float | NotEstimable
    subject_shrinkage: Mapping[str, float | NotEstimable]
    condition_intervals: Mapping[str, Interval]
    subject_intervals: Mapping[str, Interval]


@dataclass(frozen=True, kw_only=True)
class GainHeterogeneity:
    """The test of whether subjects respond to the conditions equally strongly.

    `gains` has each subject's slope on the condition effects (1 on average), except for subjects
    whose slope cannot be compared with the others'; `tau` is the moment estimate of the standard
    deviation of the true slopes (0 if they differ less than expected by chance). `f` is Mandel's;
    `p` is not its tail, but from shufflings (see `gain_heterogeneity`).
    """

    f: float
    df: tuple[int, int]
    p: float
    gains: Mapping[str, float]
    tau: float


def additive_effects(table: ScoreTable) -> AdditiveEffects | NotEstimable:
    """Return condition and subject effects by least squares, or why they are not estimable."""
    if isinstance(fit := two_way(table), NotEstimable):
        return fit
    subject_variance = max(0.0, fit.row_variance)
    counts = fit.table.given.sum(axis=1).tolist()
    condition_halves, subject_halves = _halves(fit)
    return AdditiveEffects(
        grand_mean=fit.grand_mean,
        conditions=dict(zip(fit.table.conditions, fit.columns.tolist(), strict=True)),
        subjects=dict(zip(fit.table.subjects, fit.rows.tolist(), strict=True)),
        residual_sd=float(np.sqrt(fit.residual_variance)),
        residual_df=fit.residual_df,
        subject_sd=float(np.sqrt(subject_variance)),
        shrinkage=_shrinkage(subject_variance, fit.residual_variance, len(fit.columns)),
        subject_shrinkage={
            name: _shrinkage(subject_variance, fit.residual_variance, count)
            for name, count in zip(fit.table.subjects, counts, strict=True)
        },
        condition_intervals=_around(fit.table.conditions, fit.columns, condition_halves),
        subject_intervals=_around(fit.table.subjects, fit.rows, subject_halves),
    )


def _around(
    names: tuple[str, ...], effects: FloatArray, halves: FloatArray
) -> Mapping[str, Interval]:
    """Return the interval of each effect, but for those whose residuals show no spread."""
    ends = zip((effects - halves).tolist(), (effects + halves).tolist(), strict=True)
    known = zip(names, ends, (halves > intervals.NO_WIDTH).tolist(), strict=True)
    return {name: interval for name, interval, wide in known if wide}


def _halves(fit: TwoWay) -> tuple[FloatArray, FloatArray]:
    """Return half the widths of the intervals of conditions and of subjects.

    A condition's error is robust to dependence within subjects (Liang and Zeger, Biometrika 73,
    1986), who may differ in their effects by as much as they like. A subject's, (8) of
    mathematics/ordinal, has the variance of the residuals.
    """
    root, subjects = _root_of_inverse(fit.table.given), len(fit.rows)
    inverse = root @ root.T
    influence = np.where(fit.table.given, fit.residuals, 0.0) @ inverse
    robust = np.sqrt((influence**2).sum(axis=0) * subjects / (subjects - 1))
    shares = 1 / fit.table.given.sum(axis=1)
    own = fit.table.given * shares[:, None]
    apart = (own - own.mean(axis=0)) @ root
    factor = shares * (1 - 2 / subjects) + shares.mean() / subjects + (apart**2).sum(axis=1)
    return (
        stdtrit(subjects - 1, UPPER) * robust,
        stdtrit(fit.residual_df, UPPER) * np.sqrt(fit.residual_variance * factor),
    )


def gain_heterogeneity(
    table: ScoreTable, *, shuffles: int = SHUFFLES
) -> GainHeterogeneity | NotEstimable:
    """Return the test of equal slopes on the condition effects, or why it is not possible.

    The model adds to the additive fit each subject's slope on the fitted condition effects
    (Mandel's bundle of straight lines, Technometrics 3, 1961); F and τ² follow from (10) of
    mathematics/ordinal, where cells may be missing. p is that of (11), because the tail of F
    supposes that everybody's scores scatter alike. It is the larger of two: of the scores shuffled
    within subjects, which is exact where no condition has an effect, and of the residuals shuffled
    and added back (Freedman and Lane, Journal of Business and Economic Statistics 1, 1983), right
    where effects are large. The shufflings are drawn from a fixed seed. How often equal slopes are
    rejected is on that page; a ceiling that effects reach makes slopes differ.

    Args:
        table: the scores.
        shuffles: most shufflings; large tables get fewer.
    """
    if isinstance(fit := two_way(table), NotEstimable):
        return fit
    if isinstance(slopes := _slopes(fit), NotEstimable):
        return slopes
    df = (slopes.rank, fit.residual_df - slopes.rank)
    if min(df) < 1:
        return NotEstimable(f"slopes and residual have {df[0]} and {df[1]} degrees of freedom")
    within = fit.residual_squares - slopes.squares
    if within <= 1e-12 * fit.residual_squares:
        return NotEstimable("the slopes fit the scores exactly, so there is no residual")
    variance = within / df[1]
    f = slopes.squares / df[0] / variance
    return GainHeterogeneity(
        f=f,
        df=df,
        p=_shuffled_p(fit, shuffles),
        gains={fit.table.subjects[row]: 1.0 + excess for row, excess in slopes.excess.items()},
        tau=float(np.sqrt(max(0.0, (slopes.squares - df[0] * variance) / slopes.information))),
    )


def _shrinkage(variance: float, residual: float, count: int) -> float | NotEstimable:
    if variance + residual == 0:
        return NotEstimable("neither subjects nor residuals vary")
    return variance / (variance + residual / count)


@dataclass(frozen=True, kw_only=True)
class _Slopes:
    """Slopes on the condition effects, added to the additive fit.

    `squares` is their extra sum of squares and `rank` its degrees of freedom; `information` is the
    trace of their information matrix; `excess` has each slope minus 1 (0 on average) by row of the
    table, for the rows whose slopes can be compared.
    """

    squares: float
    rank: int
    information: float
    excess: Mapping[int, float]


def _slopes(fit: TwoWay) -> _Slopes | NotEstimable:
    """Return the slopes by least squares, adjusted for subjects and conditions: (10).

    `own` are E and `scaled` U, which has only as many singular values as there are conditions.
    """
    given = fit.table.given
    effects = np.where(given, fit.columns, 0.0)
    own = np.where(given, effects - (effects.sum(axis=1) / given.sum(axis=1))[:, None], 0.0)
    lengths = np.sqrt((own**2).sum(axis=1))
    rows = np.flatnonzero(lengths > 1e-6 * max(1.0, float(lengths.max())))
    if not (fit.columns**2).sum() > 0 or not rows.size:
        return NotEstimable("the conditions do not differ, so slopes cannot be estimated")
    own, lengths = own[rows], lengths[rows]
    residuals = np.where(given, fit.residuals, 0.0)[rows]
    products = (own * residuals).sum(axis=1) / lengths
    scaled = own / lengths[:, None] @ _root_of_inverse(given)
    turned, sizes, _ = np.linalg.svd(scaled, full_matrices=False)
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


def _shuffled_p(fit: TwoWay, most: int) -> float:
    """Return the p of unequal slopes, of scores or of residuals shuffled, whichever is larger."""
    given = fit.table.given
    shuffles = int(np.clip(MOST_CELLS // given.size, LEAST_SHUFFLES, most))
    rng = np.random.default_rng(omnibus.SEED)
    # Tables stand last, so that sums over few conditions are sums of long rows; the first of all is
    # not shuffled.
    order = np.tile(
        np.arange(given.shape[1], dtype=np.int16)[:, None], (len(given), 1, 1 + shuffles)
    )
    for row, cells in enumerate(given):
        own = np.flatnonzero(cells)
        order[row, own, 1:] = rng.permuted(np.tile(own, (shuffles, 1)), axis=1).T
    residuals, effects = np.where(given, fit.residuals, 0.0), given * fit.columns
    inverse = _root_of_inverse(given)
    inverse = inverse @ inverse.T
    first = given.shape[1] * np.arange(len(given))[:, None, None]

    def shares(part: NDArray[np.int16]) -> FloatArray:
        places = first + part
        shuffled = (residuals + effects).take(places), residuals.take(places) + effects[..., None]
        return _share_of_slopes(np.concatenate(shuffled, axis=2), given, inverse).reshape(2, -1)

    # Some tables at a time: all of a large study's would take a quarter of a gigabyte.
    cached, paged = (cells // given.size for cells in (_CACHED_CELLS, _PAGED_CELLS))
    at_once = cached if cached >= _FEW_TABLES else max(paged, 1)
    parts = np.array_split(order, -(-order.shape[2] // at_once), axis=2)
    found = np.concatenate(list(map(shares, parts)), axis=1)
    return float((found >= found[0, 0] * (1 - 1e-9)).mean(axis=1).max())


def _share_of_slopes(scores: FloatArray, given: BoolArray, inverse: FloatArray) -> FloatArray:
    """Return which share of the residuals slopes on the effects take up, in each of many tables.

    Subjects are weighted by 1 / variance, in the effects, too: residuals from an unweighted mean
    are correlated with it, those of the subject with the largest scatter most. Half the mean
    variance is added to each, because one of few scores may be nothing by chance.

    Args:
        scores: shape (subjects, conditions, tables), 0 where not given.
        given: shape (subjects, conditions).
        inverse: of the conditions' information, unweighted.
    """
    cells, counts = given[..., None].astype(np.float64), given.sum(axis=1)[:, None]

    def centred(values: FloatArray) -> FloatArray:
        means = (values * cells).sum(axis=1) / counts
        return np.asarray((values - means[:, None]) * cells)

    def products(a: FloatArray, b: FloatArray) -> FloatArray:
        return np.asarray(np.einsum("sct,sct->st", a, b))

    own = centred(scores)
    residuals = own - centred((inverse @ own.sum(axis=0))[None])
    variances = products(residuals, residuals) / np.maximum(counts - 1, 1)
    variances += variances.mean(axis=0) / 2
    # Only ratios of weights matter; tables without residuals weight all alike.
    least = variances.min(axis=0)
    weights = np.where(least > 0, least, 1.0) / np.where(least > 0, variances, 1.0)
    projections = given[:, :, None] * np.eye(len(inverse)) - (
        given[:, :, None] * given[:, None] / counts[:, None]
    )
    # A constant added to all effects is confounded with the subjects' levels, and 1 fixes it.
    information = np.tensordot(weights.T, projections, 1) + 1.0
    weighted = np.einsum("st,sct->tc", weights, own)
    effects = np.linalg.solve(information, weighted[..., None])[..., 0]
    lines = centred(np.ascontiguousarray(effects.T)[None])
    residuals = own - lines
    lengths, no_squares = products(lines, lines), 1e-18 * products(own, own).sum(axis=0)
    known = lengths > no_squares
    # (11), mathematics/ordinal
    along = products(lines, residuals) ** 2 * known / np.where(known, lengths, 1.0)
    total = (weights * products(residuals, residuals)).sum(axis=0)
    some = total > no_squares
    return np.asarray((weights * along).sum(axis=0) * some / np.where(some, total, 1.0))


def _root_of_inverse(given: BoolArray) -> FloatArray:
    """Return R so that R R' is the inverse of the conditions' information, given the subjects."""
    weights = given.astype(np.float64)
    own = weights / weights.sum(axis=1, keepdims=True)
    values, vectors = np.linalg.eigh(np.diag(weights.sum(axis=0)) - weights.T @ own)
    # The first eigenvalue is 0: raising all conditions equally is confounded with the subjects.
    return np.asarray(vectors[:, 1:] / np.sqrt(values[1:]))


def _largest_group(free: FloatArray) -> IntArray:
    """Return the largest group of rows that move together in every undetermined direction."""
    if free.shape[1] == 1:
        return np.arange(len(free))
    alike = (np.abs(free[:, None] - free[None]) < 1e-6 * np.abs(free).max()).all(axis=2)
    return np.flatnonzero(alike[alike.sum(axis=1).argmax()])
