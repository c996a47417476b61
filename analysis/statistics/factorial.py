"""Effects of factors within people: main effects and interactions of two, by permutation.

Numbers of equations are those of docs/mathematics/ordinal.md.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations, permutations, product
from math import factorial, prod
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import chdtrc, fdtrc, ncfdtr, stdtrit

from analysis.estimates import ENDS, LEVEL, BoolArray, FloatArray, IntArray, Interval, NotEstimable
from analysis.statistics import corrections, intervals, ordinal, signed_rank
from analysis.statistics.omnibus import SEED, MonteCarlo, shuffles_of

SESSION = "session"
"""Names the factor whose levels are the sessions of a participant."""
MOST_ARRANGEMENTS = 300_000
"""Arrangements that are listed for an exact p."""
MOST_SHUFFLES = 20_000
_SHUFFLES = 999
"""Of a simulated study, of which there are thousands."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Crossed:
    """Mean scores by person and by level of each factor; NaN where no score was given.

    `factors` has the names of the levels of each factor; `scores` has shape (people, levels of the
    first factor, levels of the second, ...).
    """

    factors: Mapping[str, tuple[str, ...]]
    scores: FloatArray

    @property
    def complete(self) -> FloatArray:
        """The scores of the people who have one in every cell."""
        levels = tuple(range(1, self.scores.ndim))
        return self.scores[~np.isnan(self.scores).any(axis=levels)]

    def places(self, names: Iterable[str]) -> tuple[int, ...]:
        """Return the positions of the named factors."""
        return tuple(list(self.factors).index(name) for name in names)

    def over(self, *names: str) -> FloatArray:
        """Return these people's means by level of the named factors alone, in their order."""
        axes = [place + 1 for place in self.places(names)]
        moved = np.moveaxis(self.complete, axes, range(1, len(axes) + 1))
        return np.asarray(moved.mean(axis=tuple(range(len(axes) + 1, moved.ndim))))


@dataclass(frozen=True, kw_only=True)
class Effect:
    """Main effect of a factor, or the interaction of two, tested within `people`.

    `p` is the larger of two: `p_permuted`, of random shufflings if there is a `monte_carlo`, which
    holds however scores are spread, and `p_f`, that of F with Greenhouse and Geisser's `epsilon`,
    which holds also if people differ more at some levels than at others. Of the sizes,
    `partial_eta2` is the share of the effect in what other effects and people's levels leave, and
    `generalized_eta2` its share in all but the other effects (Olejnik and Algina, Psychological
    Methods 8, 2003).
    """

    people: int
    f: float
    df: tuple[int, int]
    epsilon: float
    p_f: float
    p_permuted: float
    monte_carlo: MonteCarlo | None
    partial_eta2: float
    partial_eta2_interval: Interval | NotEstimable
    generalized_eta2: float

    @property
    def p(self) -> float:
        """The p that decides."""
        return max(self.p_permuted, self.p_f)


@dataclass(frozen=True, kw_only=True)
class TestedEffect:
    """An effect of one or two factors by their names; `p_holm` is over all effects of a study."""

    factors: tuple[str, ...]
    effect: Effect | NotEstimable
    p_holm: float | NotEstimable

    @property
    def name(self) -> str:
        """The factors, such as `voltage` or `voltage × frequency`."""
        return " × ".join(self.factors)

    @property
    def found(self) -> bool:
        """Whether there is an effect after Holm's correction, p < .05."""
        return not isinstance(self.p_holm, NotEstimable) and self.p_holm < LEVEL


@dataclass(frozen=True, kw_only=True)
class LevelMean:
    """Mean score at a level of a factor, and its difference from the mean of all its levels."""

    factor: str
    level: str
    mean: float
    difference: float
    difference_interval: Interval | NotEstimable


@dataclass(frozen=True, kw_only=True)
class Factorial:
    """The effects of a study's factors, main ones first, and the means by level."""

    effects: tuple[TestedEffect, ...]
    levels: tuple[LevelMean, ...]

    def of(self, *factors: str) -> TestedEffect | None:
        """Return the effect of these factors, in any order, or None where there is none."""
        return next((it for it in self.effects if set(it.factors) == set(factors)), None)


def factorial_tests(crossed: Crossed, by_session: Crossed | None = None) -> Factorial:
    """Return every main effect and interaction of two factors.

    `crossed` is over the sessions; `by_session` is the same by session as well, for the effects of
    `SESSION`, so that who missed a session counts for the other effects.
    """
    wide = by_session or crossed
    names = effects_of(wide.factors)
    found = [_of(wide if SESSION in of else crossed, of) for of in names]
    return Factorial(
        effects=tuple(
            TestedEffect(factors=of, effect=it, p_holm=p)
            for of, it, p in zip(names, found, corrections.holm_of(found), strict=True)
        ),
        levels=tuple(
            mean
            for name in wide.factors
            for mean in _level_means(wide if name == SESSION else crossed, name)
        ),
    )


def effects_of(factors: Iterable[str]) -> list[tuple[str, ...]]:
    """Return the factors of each effect: main effects, then interactions of two."""
    names = list(factors)
    return [*((name,) for name in names), *combinations(names, 2)]


def factorial_p(crossed: Crossed, by_session: Crossed | None = None) -> list[float]:
    """Return p of each effect as simulations need it, in a fraction of the time; NaN if none.

    One of .05 or more is that of F alone, which no permutation can make smaller, so that the same
    effects are found; a smaller one is of 999 shufflings.
    """
    wide, found = by_session or crossed, []
    for of in effects_of(wide.factors):
        among = wide if SESSION in of else crossed
        test = _f_test(among.complete, among.places(of)) if len(among.complete) > 1 else None
        if not isinstance(test, _FTest):
            found.append(float("nan"))
        elif test.p >= LEVEL:
            found.append(test.p)
        else:
            found.append(max(test.p, _monte_carlo(test.own, _SHUFFLES).p))
    return found


def _of(crossed: Crossed, factors: tuple[str, ...]) -> Effect | NotEstimable:
    scores = crossed.complete
    if len(scores) < 2:
        cells = scores[0].size if len(scores) else prod(crossed.scores.shape[1:])
        return NotEstimable(
            f"the test needs at least 2 people with a score in each of {cells} cells, got "
            f"{len(scores)}"
        )
    return within_effect(scores, crossed.places(factors))


def within_effect(scores: FloatArray, factors: tuple[int, ...]) -> Effect | NotEstimable:
    """Return the effect of one factor or the interaction of several.

    (21): F = n Σ r̄² / df over Σ (r - r̄)² / (df (n - 1)), where r are a person's means by level of
    these factors, less the means over each of them, and r̄ is their mean over n people. Under the
    hypothesis a person's levels are exchangeable, so that the levels of each factor may be shuffled
    within each person, for an interaction the rows and the columns of r. The permutation p is the
    share of these arrangements whose F is at least as large. `scores` has shape (people, levels of
    each factor), none missing; `factors` are positions among the factors.
    """
    if isinstance(test := _f_test(scores, factors), NotEstimable):
        return test
    exact = exact_p(test.own)
    shuffled = _monte_carlo(test.own) if exact is None else None
    # All that is not an effect: people's levels, and how people differ in effects.
    rest = float(((scores - scores.mean(axis=0)) ** 2).sum())
    between = scores.size / test.own.size * test.between
    return Effect(
        people=len(scores),
        f=test.f,
        df=test.df,
        epsilon=test.epsilon,
        p_f=test.p,
        p_permuted=shuffled.p if shuffled else exact or 0.0,
        monte_carlo=shuffled,
        partial_eta2=test.between / test.total,
        partial_eta2_interval=_eta2_interval(test.f, *(test.epsilon * df for df in test.df)),
        generalized_eta2=between / (between + rest),
    )


class _FTest(NamedTuple):
    """F of (21) with each person's deviations `own` and the sums of squares that it is made of."""

    own: FloatArray
    between: float
    total: float
    f: float
    df: tuple[int, int]
    epsilon: float
    p: float


def _f_test(scores: FloatArray, factors: tuple[int, ...]) -> _FTest | NotEstimable:
    others = tuple(axis + 1 for axis in range(scores.ndim - 1) if axis not in factors)
    own = scores.mean(axis=others)
    for axis in range(1, own.ndim):
        own = own - own.mean(axis=axis, keepdims=True)
    people = len(own)
    noise = own.size * (1e-12 * max(1.0, float(np.abs(scores).max()))) ** 2
    total, between = float((own**2).sum()), people * float((own.mean(axis=0) ** 2).sum())
    if total <= noise:
        return NotEstimable("nobody's scores differ in this way")
    if total - between <= noise:
        return NotEstimable("everybody's scores differ alike, so that F has no error to compare to")
    df = prod(levels - 1 for levels in own.shape[1:])
    f = between / df / ((total - between) / (df * (people - 1)))
    spread = np.linalg.eigvalsh(np.cov(own.reshape(people, -1), rowvar=False))
    epsilon = float(spread.sum() ** 2 / (df * (spread**2).sum()))
    return _FTest(
        own=own,
        between=between,
        total=total,
        f=f,
        df=(df, df * (people - 1)),
        epsilon=epsilon,
        p=float(fdtrc(epsilon * df, epsilon * df * (people - 1), f)),
    )


def exact_p(own: FloatArray) -> float | None:
    """Return the share of all arrangements with an effect at least as large, if they can be listed.

    `own` has shape (people, levels of each factor): deviations of each person.
    """
    shape = own.shape[1:]
    if prod(factorial(levels) for levels in shape) > MOST_ARRANGEMENTS:
        return None
    orders = [np.ix_(*order) for order in product(*(permutations(range(n)) for n in shape))]
    # The same rearrangement of everybody changes nothing, so that the first person's scores stay.
    sums = own[:1].reshape(1, -1)
    for person in own[1:]:
        images = np.round([person[order].ravel() for order in orders], signed_rank.DECIMALS)
        # Each different image comes of equally many arrangements.
        images = np.unique(images, axis=0)
        if len(sums) * len(images) > MOST_ARRANGEMENTS:
            return None
        sums = (sums[:, None] + images).reshape(-1, images.shape[1])
    return float(_reach(sums, own).mean())


def _monte_carlo(own: FloatArray, most: int = MOST_SHUFFLES) -> MonteCarlo:
    """Return p of random arrangements from a fixed seed, as `omnibus.monte_carlo_p` does."""
    shuffles = shuffles_of(own.size, most)
    rng = np.random.default_rng(SEED)
    sums = np.zeros((shuffles, *own.shape[1:]))
    for person in own:
        moved = person[None]
        for axis, levels in enumerate(person.shape, start=1):
            order = rng.random((shuffles, levels)).argsort(axis=1)
            along = [shuffles] + [1] * person.ndim
            along[axis] = levels
            moved = np.take_along_axis(moved, order.reshape(along), axis)
        sums += moved
    return MonteCarlo.of(int(_reach(sums.reshape(shuffles, -1), own).sum()), shuffles)


def _reach(sums: FloatArray, own: FloatArray) -> BoolArray:
    """Return which sums over people are as unequal as those of `own`.

    F rises with the sum of their squares, because shuffling leaves that of the scores as it is.
    """
    observed = float((own.sum(axis=0) ** 2).sum())
    return np.asarray((sums**2).sum(axis=1) >= observed * (1 - 1e-7))


def _eta2_interval(f: float, df: float, error_df: float) -> Interval | NotEstimable:
    """Return the 95% interval of partial η²: λ / (λ + df of the error), λ of the noncentral F.

    (22): the ends are the λ for which an F as large, or as small, has a chance of 2.5% (Steiger,
    Psychological Methods 9, 2004). A lower end of 0 is no noncentrality at all. The degrees of
    freedom are those of the p of F, corrected by Greenhouse and Geisser's ε.
    """

    def excess(lam: float, chance: float) -> float:
        return float(ncfdtr(df, error_df, lam, f)) - chance

    ends = []
    for chance in reversed(ENDS):
        above = df * f + 10.0
        while excess(above, chance) > 0:
            above *= 1.5
        if np.isnan(excess(above, chance)):
            return NotEstimable("F is too large for an interval")
        least = excess(0.0, chance) <= 0
        ends.append(0.0 if least else float(brentq(excess, 0.0, above, args=(chance,))))
    low, high = (lam / (lam + error_df) for lam in ends)
    return low, high


def _level_means(crossed: Crossed, name: str) -> list[LevelMean]:
    by_level = crossed.over(name)
    if not len(by_level):
        return []
    own = by_level - by_level.mean(axis=1, keepdims=True)
    return [
        LevelMean(
            factor=name,
            level=level,
            mean=float(by_level[:, place].mean()),
            difference=float(own[:, place].mean()),
            difference_interval=intervals.mean_interval(own[:, place]),
        )
        for place, level in enumerate(crossed.factors[name])
    ]


def cell_intervals(crossed: Crossed, *names: str) -> tuple[FloatArray, FloatArray]:
    """Return the means by level of these factors, and halves of their 95% intervals.

    The intervals are of scores without people's levels (Cousineau, Tutorials in Quantitative
    Methods for Psychology 1, 2005; corrected by Morey, the same 4, 2008).
    """
    cells = crossed.over(*names)
    people, levels = len(cells), cells[0].size
    level = cells.reshape(people, -1).mean(axis=1).reshape(-1, *[1] * (cells.ndim - 1))
    spread = (cells - level).std(axis=0, ddof=1) * np.sqrt(levels / (levels - 1) / people)
    return cells.mean(axis=0), float(stdtrit(people - 1, ENDS[1])) * spread


# The same effects on the latent scale of an ordinal mixed model, which no end of the scale bends.


@dataclass(frozen=True, kw_only=True)
class LatentEffect:
    """Wald's test of one effect: χ² of its coefficients by their covariance."""

    factors: tuple[str, ...]
    chi2: float
    df: int
    p: float


@dataclass(frozen=True, kw_only=True)
class LatentLevel:
    """Effect of a level relative to the mean of its factor's levels, and its standard error."""

    factor: str
    level: str
    effect: float
    standard_error: float

    @property
    def effect_interval(self) -> Interval:
        """The 95% interval, which tables ask for by its name."""
        half = ordinal.NORMAL_95 * self.standard_error
        return self.effect - half, self.effect + half


@dataclass(frozen=True, kw_only=True)
class LatentFactorial:
    """Effects in units of the latent residual's SD, with SDs of people and of their cells.

    `cell_sd` is None where nobody scored a cell twice, or where it is 0.
    """

    effects: tuple[LatentEffect, ...]
    levels: tuple[LatentLevel, ...]
    subject_sd: float
    cell_sd: float | None


def latent_factorial(
    scores: FloatArray, subject: IntArray, cell: IntArray, factors: Mapping[str, tuple[str, ...]]
) -> LatentFactorial | NotEstimable:
    """Return main effects and interactions of two in the cumulative probit model of (1).

    (23): β of a cell is the sum of the coefficients of its levels and pairs of levels, which add
    up to 0 over each factor. People differ in level, and, where cells were scored twice, in each
    cell; if they differ in the effect of a whole factor, errors here are too small.

    `scores`, finite, `subject`, whole numbers, and `cell` have shape (trials,); cells are positions
    among all combinations of levels, of which the last factor is fastest.
    """
    # The effect of the last level is minus the sum of the others.
    sums = {
        name: np.concatenate([np.eye(len(levels) - 1), -np.ones((1, len(levels) - 1))])
        for name, levels in factors.items()
    }
    terms = [(name,) for name in factors] + list(combinations(factors, 2))
    places = np.indices([len(levels) for levels in factors.values()]).reshape(len(factors), -1)
    main = {name: sums[name][at] for name, at in zip(factors, places, strict=True)}
    columns = [
        main[of[0]]
        if len(of) == 1
        else np.einsum("ci,cj->cij", *(main[name] for name in of)).reshape(places.shape[1], -1)
        for of in terms
    ]
    design = np.concatenate(columns, axis=1)
    if isinstance(counts := ordinal.score_counts(scores, subject, cell, len(design)), NotEstimable):
        return counts
    data = ordinal.ScoreCounts(counts=counts, link="probit", design=design)
    if isinstance(fit := ordinal.fitted_levels(data), NotEstimable):
        return fit
    best, covariance = fit
    wider = ordinal.fitted_cells(best, covariance, data)
    if not isinstance(wider, NotEstimable):
        best, covariance = wider
    at = data.coefficients
    values, errors = best.packed[at], covariance[at, at]
    ends = np.cumsum([0, *(own.shape[1] for own in columns)])
    spans = dict(zip(terms, map(slice, ends[:-1], ends[1:]), strict=True))
    return LatentFactorial(
        effects=tuple(_wald(of, values[own], errors[own, own]) for of, own in spans.items()),
        levels=tuple(
            LatentLevel(factor=name, level=level, effect=float(effect), standard_error=float(error))
            for name, levels in factors.items()
            for level, effect, error in zip(
                levels,
                sums[name] @ values[spans[(name,)]],
                np.sqrt(
                    np.diag(sums[name] @ errors[spans[(name,)], spans[(name,)]] @ sums[name].T)
                ),
                strict=True,
            )
        ),
        subject_sd=abs(float(ordinal.unpacked(best.packed, data).sds[0])),
        cell_sd=None if isinstance(wider, NotEstimable) else abs(float(best.packed[-1])) or None,
    )


def _wald(of: tuple[str, ...], values: FloatArray, errors: FloatArray) -> LatentEffect:
    chi2 = float(values @ np.linalg.solve(errors, values))
    return LatentEffect(factors=of, chi2=chi2, df=len(values), p=float(chdtrc(len(values), chi2)))
