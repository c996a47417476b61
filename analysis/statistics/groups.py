"""Groups of people compared: rank tests by permutation, shifts, and group x condition.

Numbers of equations are those of docs/mathematics/groups.md.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations, islice
from math import comb, prod

import numpy as np
from scipy.special import ndtri

from analysis.estimates import LEVEL, LOWER, UPPER, FloatArray, IntArray, Interval, NotEstimable
from analysis.statistics.corrections import holm, holm_of
from analysis.statistics.omnibus import SEED, MonteCarlo, shuffles_of
from analysis.statistics.signed_rank import DECIMALS, doubled_midranks

LARGEST_EXACT = 100
"""People in two groups up to whom rank sums have exact chances: some 50 ms."""
MOST_WAYS = 100_000
"""Ways to put people into groups that are listed; of more, random ones are drawn."""


# How people could have come into the groups: every way, or random ones where there are too many.


@lru_cache(maxsize=4)
def _ways(sizes: tuple[int, ...]) -> tuple[IntArray, bool]:
    """Return groups of people, shape (ways, people), and whether these are all ways."""
    people = sum(sizes)
    if prod(comb(sum(sizes[: k + 1]), size) for k, size in enumerate(sizes)) <= MOST_WAYS:
        ways, left = np.zeros((1, 0), dtype=np.int64), np.array([sizes])
        for _ in range(people):
            row, group = np.nonzero(left)
            ways, left = np.column_stack([ways[row], group]), left[row]
            left[np.arange(len(row)), group] -= 1
        return ways, True
    ordered = np.tile(np.repeat(np.arange(len(sizes)), sizes), (shuffles_of(people), 1))
    return np.random.default_rng(SEED).permuted(ordered, axis=1), False


def permuted(values: FloatArray, groups: IntArray) -> MonteCarlo:
    """Return the p of groups whose means of centred values differ as much as these, (3).

    It is exact, without an error, where all ways can be listed. `values` has shape (people,
    columns), with a mean of 0 in each column, NaN if missing; `groups` has shape (people,), from 0,
    each with somebody.
    """
    ways, every = _ways(tuple(np.bincount(groups).tolist()))
    given = ~np.isnan(values)
    both = np.column_stack([np.where(given, values, 0.0), given])
    spread = np.zeros(len(ways) + 1)
    for group in range(int(groups.max()) + 1):
        among = np.vstack([groups, ways]) == group
        sums, counts = np.split(among.astype(np.float64) @ both, 2, axis=1)
        spread += (sums**2 / np.maximum(counts, 1)).sum(axis=1)
    reached = int((spread[1:] >= spread[0] * (1 - 1e-9)).sum())
    if every:
        return MonteCarlo(p=reached / len(ways), error=0.0, shuffles=len(ways))
    return MonteCarlo.of(reached, len(ways))


# Two groups: the Wilcoxon-Mann-Whitney test, and the shift between them.


def _ways_by_sum(ranks: IntArray, size: int) -> FloatArray:
    """Return, by sum, how many choices of `size` of the positive integers have it, (1)."""
    ways = np.zeros((size + 1, int(ranks.sum()) + 1))
    ways[0, 0] = 1.0
    for rank in ranks.tolist():
        ways[1:, rank:] += ways[:-1, :-rank]
    return np.asarray(ways[size])


@dataclass(frozen=True, kw_only=True)
class TwoGroups:
    """The Wilcoxon-Mann-Whitney test of group `a` against group `b`, two-sided, and their shift.

    `u` counts the pairs of people in which the one of `a` has more, ties half; `superiority` is u
    as a share. `shift` is the Hodges-Lehmann estimate of a - b, with its 95% interval. `error` is
    the Monte Carlo error of `p`, 0 if that is exact; `p_holm` is corrected over the family.
    """

    a: str
    b: str
    n: tuple[int, int]
    u: float
    superiority: float
    p: float
    error: float
    shift: float
    shift_interval: Interval | NotEstimable
    p_holm: float = float("nan")

    @property
    def differs(self) -> bool:
        """Whether the groups differ after Holm's correction, p < .05."""
        return self.p_holm < LEVEL


def two_groups(a: str, b: str, of_a: FloatArray, of_b: FloatArray) -> TwoGroups | NotEstimable:
    """Return the comparison of two groups' values, or why there is none; NaN counts for nothing.

    Up to 100 people p counts all ways to choose group `a`, ties kept (1); of more, random ones
    (Mann and Whitney, Annals of Mathematical Statistics 18, 1947). The interval inverts the
    test without ties (2) (Hodges and Lehmann, same Annals 34, 1963).

    >>> found = two_groups("old", "young", np.array([1.0, 2.0, 2.5]), np.array([3.0, 4.0, 5.0]))
    >>> found.p, found.shift, found.shift_interval
    (0.1, -2.0, NotEstimable(reason='groups of 3 and 3 are too small for a 95% interval'))
    """
    of_a, of_b = of_a[~np.isnan(of_a)], of_b[~np.isnan(of_b)]
    n, m = sizes = of_a.size, of_b.size
    if not n or not m:
        return NotEstimable(f"nobody of {a if not n else b} has a value")
    ranks = doubled_midranks(np.concatenate([of_a, of_b]))
    total, p, error = int(ranks[:n].sum()), 1.0, 0.0
    if n + m > LARGEST_EXACT:
        tested = permuted((ranks - ranks.mean())[:, None], np.repeat([0, 1], sizes))
        p, error = tested.p, tested.error
    else:
        ways = _ways_by_sum(ranks, n)
        distance = np.abs(np.arange(len(ways)) * (n + m) - n * int(ranks.sum()))
        p = float(min(1.0, ways[distance >= distance[total]].sum() / ways.sum()))
    u = (total - n * (n + 1)) / 2
    apart = of_a[:, None] - of_b
    return TwoGroups(
        a=a,
        b=b,
        n=sizes,
        u=u,
        superiority=u / (n * m),
        p=p,
        error=error,
        shift=float(np.median(apart)),
        shift_interval=_shift_interval(apart, n, m),
    )


def corrected(pairs: Sequence[TwoGroups]) -> tuple[TwoGroups, ...]:
    """Return the same with p corrected over all of them."""
    p_holm = holm([pair.p for pair in pairs])
    return tuple(replace(pair, p_holm=p) for pair, p in zip(pairs, p_holm, strict=True))


def _shift_interval(apart: FloatArray, n: int, m: int) -> Interval | NotEstimable:
    if not (outside := _outside(min(n, m), max(n, m))):
        return NotEstimable(f"groups of {n} and {m} are too small for a 95% interval")
    # Means of a few whole scores tie often. Between tied differences the place is interpolated,
    # because an interval that ended on them would hold the truth in up to 99%.
    value, ties = np.unique(np.round(apart, DECIMALS), return_counts=True)
    places = np.cumsum(ties) - ties / 2
    low, high = np.interp([outside - 0.5, apart.size - outside + 0.5], places, value)
    return float(low), float(high)


@lru_cache(maxsize=256)
def _outside(n: int, m: int) -> int:
    """Return the place of the interval's end among the sorted differences, from 1; 0 if none."""
    if n + m > LARGEST_EXACT:
        half = float(ndtri(UPPER)) * np.sqrt(n * m * (n + m + 1) / 12)
        return int(n * m / 2 - half)
    ways = _ways_by_sum(np.arange(1, n + m + 1), n)[n * (n + 1) // 2 :]
    return int((np.cumsum(ways) <= LOWER * ways.sum()).sum())


# Any number of groups, one value of each person, and several measures.


@dataclass(frozen=True, kw_only=True)
class GroupMean:
    """How many people of a group have a value, with their mean and median; NaN of nobody."""

    name: str
    n: int
    mean: float
    median: float


@dataclass(frozen=True, kw_only=True)
class Compared:
    """A value of each person, compared between the groups.

    `statistic` is u of two groups and H of Kruskal and Wallis (1952), corrected for ties, of more.
    """

    groups: tuple[GroupMean, ...]
    statistic: float
    p: float
    error: float
    pairs: tuple[TwoGroups, ...]


def compared(values: FloatArray, groups: IntArray, names: Sequence[str]) -> Compared | NotEstimable:
    """Return the comparison of people's values between groups, or why there is none.

    Groups without any value are left out of the test. p permutes people between groups: of two
    groups by rank sums (1), of more by Kruskal and Wallis' H (3), (4). `values` has shape
    (people,), NaN if missing; so has `groups`, positions in `names`.
    """
    own = [values[(groups == group) & ~np.isnan(values)] for group in range(len(names))]
    some = [group for group, found in enumerate(own) if found.size]
    if len(some) < 2:
        return NotEstimable("only one group has values" if some else "nobody has a value")
    kept = np.concatenate([own[group] for group in some])
    if np.ptp(kept) < 1e-9:
        return NotEstimable("everybody has the same value")
    tests = [two_groups(names[a], names[b], own[a], own[b]) for a, b in combinations(some, 2)]
    pairs = [test for test in tests if isinstance(test, TwoGroups)]
    statistic, p, error = pairs[0].u, pairs[0].p, pairs[0].error
    if len(some) > 2:
        ranks = doubled_midranks(kept) / 2
        places = np.repeat(np.arange(len(some)), [own[group].size for group in some])
        centred = ranks - ranks.mean()
        sums = np.bincount(places, weights=centred)
        between = float((sums**2 / np.bincount(places)).sum())
        statistic = (len(ranks) - 1) * between / float((centred**2).sum())
        tested = permuted(centred[:, None], places)
        p, error = tested.p, tested.error
    return Compared(
        groups=tuple(
            GroupMean(
                name=name,
                n=found.size,
                mean=float(found.mean()) if found.size else np.nan,
                median=float(np.median(found)) if found.size else np.nan,
            )
            for name, found in zip(names, own, strict=True)
        ),
        statistic=statistic,
        p=p,
        error=error,
        pairs=corrected(pairs),
    )


@dataclass(frozen=True, kw_only=True)
class GroupInteraction:
    """Whether groups differ in what conditions do: a test of people's centred profiles.

    `share` is how much of the variation of people's profiles the groups explain, 0 to 1; `people`
    those with scores of two conditions.
    """

    share: float
    p: float
    error: float
    people: int


def interaction(scores: FloatArray, groups: IntArray) -> GroupInteraction | NotEstimable:
    """Return the test of group x condition, or why there is none.

    (5): scores less their condition's mean and then less the person's own; people with their whole
    profiles, missing scores included, are permuted between groups. So a group that scores higher
    throughout does not count as an interaction, and no distribution is assumed. `scores` has shape
    (people, conditions), NaN if missing, and `groups` (people,).
    """
    known = (~np.isnan(scores)).sum(axis=1) >= 2
    profiles, sizes = scores[known], np.bincount(groups[known])
    profiles = profiles[:, ~np.isnan(profiles).all(axis=0)]
    of = np.unique(groups[known], return_inverse=True)[1]
    if (sizes > 0).sum() < 2:
        return NotEstimable("only one group has people with scores of two conditions")
    profiles = profiles - np.nanmean(profiles, axis=0)
    profiles = profiles - np.nanmean(profiles, axis=1, keepdims=True)
    squares = float(np.nansum(profiles**2))
    if squares < 1e-9:
        return NotEstimable("everybody's scores differ alike between conditions")
    explained = sum(
        float(np.nansum(np.nansum(own, axis=0) ** 2 / np.maximum((~np.isnan(own)).sum(axis=0), 1)))
        for own in (profiles[of == group] for group in np.unique(of))
    )
    tested = permuted(profiles, of)
    return GroupInteraction(
        share=explained / squares, p=tested.p, error=tested.error, people=int(known.sum())
    )


# A study's groups: the three questions, and where they lead.

SCORE, GAIN, INTERACTION = "mean score", "gain", "group × condition"
"""The questions that a study of groups asks, each once."""
CLAIMED = {
    "score": "mean responses differ between groups",
    "gain": "slopes differ between groups",
    "interaction": "effects of conditions differ between groups",
}
"""What is claimed if these of `GroupStatistics` answer a question by yes."""


@dataclass(frozen=True, kw_only=True)
class GroupStatistics:
    """Groups compared by people's mean responses, gains, profiles, and responses to each condition.

    `p_holm` has the questions that have an answer, with p corrected over them: they are one family.
    `conditions` have p corrected over all pairs of groups and all conditions.
    """

    score: Compared | NotEstimable
    gain: Compared | NotEstimable
    interaction: GroupInteraction | NotEstimable
    conditions: Mapping[str, Compared | NotEstimable]
    p_holm: Mapping[str, float]

    def holds(self, question: str) -> bool:
        """Return whether a question is answered by yes, p < .05 after Holm's correction."""
        return self.p_holm.get(question, 1.0) < LEVEL

    @property
    def in_conditions(self) -> list[tuple[str, TwoGroups]]:
        """The conditions and pairs of groups that differ there.

        They count only where mean responses or profiles differ, so that without any difference
        between groups something is claimed in at most 5% of studies.
        """
        if not (self.holds(SCORE) or self.holds(INTERACTION)):
            return []
        return [
            (name, pair)
            for name, found in self.conditions.items()
            if isinstance(found, Compared)
            for pair in found.pairs
            if pair.differs
        ]


def group_statistics(
    responses: FloatArray,
    gains: FloatArray,
    groups: IntArray,
    names: Sequence[str],
    conditions: Sequence[str],
) -> GroupStatistics:
    """Return everything that is said of groups.

    `responses` has shape (people, conditions), NaN if missing; `gains`, each from the person's own
    trials alone, and `groups`, positions in `names`, have shape (people,).
    """
    mean = compared(mean_scores(responses), groups, names)
    gain = compared(gains, groups, names)
    profiles = interaction(responses, groups)
    asked = {SCORE: mean, GAIN: gain, INTERACTION: profiles}
    corrected_p = zip(asked, holm_of([*asked.values()]), strict=True)
    found = [compared(own, groups, names) for own in responses.T]
    # All pairs in all conditions are one family.
    pairs = iter(corrected([it for own in found if isinstance(own, Compared) for it in own.pairs]))
    return GroupStatistics(
        score=mean,
        gain=gain,
        interaction=profiles,
        conditions={
            name: replace(own, pairs=tuple(islice(pairs, len(own.pairs))))
            if isinstance(own, Compared)
            else own
            for name, own in zip(conditions, found, strict=True)
        },
        p_holm={name: p for name, p in corrected_p if not isinstance(p, NotEstimable)},
    )


def mean_scores(scores: FloatArray) -> FloatArray:
    """Return each person's mean over conditions; NaN of a person without any score.

    Where scores are missing, it is the mean departure from the conditions' means, plus their mean,
    so that nobody ranks low because only the weak conditions were scored.
    """
    given = ~np.isnan(scores)
    some, scored = given.any(axis=0), given.any(axis=1)
    found = np.full(len(scores), np.nan)
    if not scored.any():
        return found
    means = np.nanmean(scores[:, some], axis=0)
    found[scored] = np.nanmean(scores[np.ix_(scored, some)] - means, axis=1) + means.mean()
    return found
