"""Effects of factors within people: main effects on ranks, interactions of two on means.

Numbers of equations are those of docs/mathematics/response.md.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations, permutations, product
from math import factorial, nan, prod
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import fdtrc, ncfdtr, stdtrit

from analysis.estimates import ENDS, LEVEL, BoolArray, FloatArray, Interval, NotEstimable
from analysis.statistics import corrections, intervals, signed_rank
from analysis.statistics.omnibus import SEED, MonteCarlo, shuffles_of
from protocol.study.factor import CONDITION

SESSION = "session"
"""Names the factor whose levels are the sessions of a participant."""
MOST_ARRANGEMENTS = 300_000
"""Arrangements that are listed for an exact p."""
MOST_SHUFFLES = 20_000
_SHUFFLES = 999
"""Of a simulated study, of which there are thousands."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Crossed:
    """Mean responses by person and by level of each factor; NaN where nothing was answered.

    `factors` has the names of the levels of each factor; `responses` has shape (people, levels of
    the first factor, levels of the second, ...).
    """

    factors: Mapping[str, tuple[str, ...]]
    responses: FloatArray

    @property
    def complete(self) -> FloatArray:
        """The responses of the people who answered in every cell."""
        return self.responses[self.are_complete]

    @property
    def are_complete(self) -> BoolArray:
        """Who answered in every cell, shape (people,)."""
        levels = tuple(range(1, self.responses.ndim))
        return np.asarray(~np.isnan(self.responses).any(axis=levels))

    def tested(self, *names: str) -> FloatArray:
        """Return what the effect of these factors is tested on, of the shape of `complete`.

        A main effect is tested on each person's ranks of all cells, so that a rare answer of no
        change counts no more than its place; ranks have no interactions to speak of.
        """
        cells = self.complete
        if len(names) > 1:
            return cells
        ranks = signed_rank.doubled_midranks(cells.reshape(len(cells), prod(cells.shape[1:]))) / 2
        return ranks.reshape(cells.shape)

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
    holds however responses are spread, and `p_f`, that of F with Greenhouse and Geisser's
    `epsilon`, which holds also if people differ more at some levels than at others. Main effects
    are of ranks, interactions of means; `partial_eta2` is the share of the effect in what other
    effects and people's levels leave of these. Where everybody differs alike there is no F, and
    `p_permuted` decides.
    """

    people: int
    f: float | NotEstimable
    df: tuple[int, int]
    epsilon: float | NotEstimable
    p_f: float | NotEstimable
    p_permuted: float
    monte_carlo: MonteCarlo | None
    partial_eta2: float
    partial_eta2_interval: Interval | NotEstimable

    @property
    def p(self) -> float:
        """The p that decides."""
        if isinstance(self.p_f, NotEstimable):
            return self.p_permuted
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
    """Mean response at a level of a factor, and its difference from the mean of all its levels.

    `expected` is the share of the level's trials that were answered as expected, and `score` their
    mean score: which of the two moved, the response alone does not tell. NaN where there are none.
    """

    factor: str
    level: str
    mean: float
    difference: float
    difference_interval: Interval | NotEstimable
    expected: float = nan
    score: float = nan


@dataclass(frozen=True, kw_only=True)
class Factorial:
    """The effects of a study's factors, main ones first, and the means by level."""

    effects: tuple[TestedEffect, ...]
    levels: tuple[LevelMean, ...]

    def of(self, *factors: str) -> TestedEffect | None:
        """Return the effect of these factors, in any order, or None where there is none."""
        return next((it for it in self.effects if set(it.factors) == set(factors)), None)


def factorial_tests(
    crossed: Crossed,
    by_session: Crossed | None = None,
    answers: Mapping[tuple[str, str], tuple[float, float]] = MappingProxyType({}),
) -> Factorial:
    """Return every main effect and interaction of two factors.

    `crossed` is over the sessions; `by_session` is the same by session as well, for the effects of
    `SESSION`, so that who missed a session counts for the other effects. `answers` has the
    `expected` and `score` of a `LevelMean` by factor and level.
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
            for mean in _level_means(wide if name == SESSION else crossed, name, answers)
        ),
    )


def effects_of(factors: Iterable[str]) -> list[tuple[str, ...]]:
    """Return the factors of each effect: main effects, then interactions of two.

    A study without factors has its conditions as one; whether these differ is asked already.
    """
    names = list(factors)
    return [*((name,) for name in names if name != CONDITION), *combinations(names, 2)]


def factorial_p(crossed: Crossed, by_session: Crossed | None = None) -> list[float]:
    """Return p of each effect as simulations need it, in a fraction of the time; NaN if none.

    One of .05 or more is that of F alone, which no permutation can make smaller, so that the same
    effects are found; a smaller one is of 999 shufflings.
    """
    wide, found = by_session or crossed, []
    for of in effects_of(wide.factors):
        among = wide if SESSION in of else crossed
        cells = among.tested(*of)
        test = _f_test(cells, among.places(of)) if len(cells) > 1 else None
        if not isinstance(test, _FTest):
            found.append(float("nan"))
        elif test.p >= LEVEL:
            found.append(test.p)
        else:
            found.append(max(test.p, _monte_carlo(test.own, _SHUFFLES).p))
    return found


def _of(crossed: Crossed, factors: tuple[str, ...]) -> Effect | NotEstimable:
    cells = crossed.tested(*factors)
    if len(cells) < 2:
        return NotEstimable(
            f"the test needs at least 2 people with an answer in each of "
            f"{prod(crossed.responses.shape[1:])} cells, got {len(cells)}"
        )
    return within_effect(cells, crossed.places(factors))


def within_effect(cells: FloatArray, factors: tuple[int, ...]) -> Effect | NotEstimable:
    """Return the effect of one factor or the interaction of several.

    (6): F = n Σ r̄² / df over Σ (r - r̄)² / (df (n - 1)), where r are a person's means by level of
    these factors, less the means over each of them, and r̄ is their mean over n people. Under the
    hypothesis a person's levels are exchangeable, so that the levels of each factor may be shuffled
    within each person, for an interaction the rows and the columns of r. The permutation p is the
    share of these arrangements whose F is at least as large. `cells` has shape (people, levels of
    each factor), none missing; `factors` are positions among the factors.
    """
    if isinstance(test := _f_test(cells, factors), NotEstimable):
        return test
    exact = exact_p(test.own)
    shuffled = _monte_carlo(test.own) if exact is None else None
    alike = np.isnan(test.f)
    return Effect(
        people=len(cells),
        f=_ALIKE if alike else test.f,
        df=test.df,
        epsilon=_ALIKE if alike else test.epsilon,
        p_f=_ALIKE if alike else test.p,
        p_permuted=shuffled.p if shuffled else exact or 0.0,
        monte_carlo=shuffled,
        partial_eta2=test.between / test.total,
        partial_eta2_interval=_eta2_interval(test.f, *(test.epsilon * df for df in test.df)),
    )


_ALIKE = NotEstimable("everybody differs alike")


class _FTest(NamedTuple):
    """F of (6) with each person's deviations `own` and the sums of squares that it is made of.

    F is NaN where everybody differs alike.
    """

    own: FloatArray
    between: float
    total: float
    f: float
    df: tuple[int, int]
    epsilon: float
    p: float


def _f_test(cells: FloatArray, factors: tuple[int, ...]) -> _FTest | NotEstimable:
    others = tuple(axis + 1 for axis in range(cells.ndim - 1) if axis not in factors)
    own = cells.mean(axis=others)
    for axis in range(1, own.ndim):
        own = own - own.mean(axis=axis, keepdims=True)
    people = len(own)
    noise = own.size * (1e-12 * max(1.0, float(np.abs(cells).max()))) ** 2
    total, between = float((own**2).sum()), people * float((own.mean(axis=0) ** 2).sum())
    if total <= noise:
        return NotEstimable("nobody's responses differ in this way")
    df = prod(levels - 1 for levels in own.shape[1:])
    both = (df, df * (people - 1))
    if total - between <= noise:
        # Everybody differs alike: F has no error to compare to, and shuffles alone decide.
        return _FTest(own, between=total, total=total, f=nan, df=both, epsilon=1.0, p=0.0)
    f = between / df / ((total - between) / (df * (people - 1)))
    spread = np.linalg.eigvalsh(np.cov(own.reshape(people, -1), rowvar=False))
    epsilon = float(spread.sum() ** 2 / (df * (spread**2).sum()))
    return _FTest(
        own=own,
        between=between,
        total=total,
        f=f,
        df=both,
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
    # The same rearrangement of everybody changes nothing, so that the first person's cells stay.
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

    F rises with the sum of their squares, because shuffling leaves that of the cells as it is.
    """
    observed = float((own.sum(axis=0) ** 2).sum())
    return np.asarray((sums**2).sum(axis=1) >= observed * (1 - 1e-7))


def _eta2_interval(f: float, df: float, error_df: float) -> Interval | NotEstimable:
    """Return the 95% interval of partial η²: λ / (λ + df of the error), λ of the noncentral F.

    (7): the ends are the λ for which an F as large, or as small, has a chance of 2.5% (Steiger,
    Psychological Methods 9, 2004). A lower end of 0 is no noncentrality at all. The degrees of
    freedom are those of the p of F, corrected by Greenhouse and Geisser's ε.
    """
    if np.isnan(f):
        return _ALIKE

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


def _level_means(
    crossed: Crossed, name: str, answers: Mapping[tuple[str, str], tuple[float, float]]
) -> list[LevelMean]:
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
            expected=answers.get((name, level), (nan, nan))[0],
            score=answers.get((name, level), (nan, nan))[1],
        )
        for place, level in enumerate(crossed.factors[name])
    ]


def cell_intervals(crossed: Crossed, *names: str) -> tuple[FloatArray, FloatArray]:
    """Return the means by level of these factors, and halves of their 95% intervals.

    The intervals are of responses without people's levels (Cousineau, Tutorials in Quantitative
    Methods for Psychology 1, 2005; corrected by Morey, the same 4, 2008).
    """
    cells = crossed.over(*names)
    people, levels = len(cells), cells[0].size
    level = cells.reshape(people, -1).mean(axis=1).reshape(-1, *[1] * (cells.ndim - 1))
    spread = (cells - level).std(axis=0, ddof=1) * np.sqrt(levels / (levels - 1) / people)
    return cells.mean(axis=0), float(stdtrit(people - 1, ENDS[1])) * spread
