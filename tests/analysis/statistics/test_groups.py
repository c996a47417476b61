"""Groups compared: against scipy and brute force, coverage of shifts, and false claims."""

from itertools import combinations

import numpy as np
import pytest
from scipy import stats

from analysis.estimates import FloatArray, NotEstimable
from analysis.statistics.groups import (
    GAIN,
    INTERACTION,
    LARGEST_EXACT,
    MOST_WAYS,
    SCORE,
    Compared,
    GroupInteraction,
    GroupStatistics,
    TwoGroups,
    compared,
    group_statistics,
    interaction,
    mean_scores,
    permuted,
    two_groups,
)


def of(a: FloatArray, b: FloatArray) -> TwoGroups:
    found = two_groups("a", "b", a, b)
    assert isinstance(found, TwoGroups)
    return found


@pytest.mark.parametrize("seed", range(50))
def test_two_groups_agree_with_scipy_without_ties(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=rng.integers(2, 14)), rng.normal(0.5, 1, rng.integers(2, 14))
    expected = stats.mannwhitneyu(a, b, method="exact")
    found = of(a, b)
    assert (found.u, found.error) == (expected.statistic, 0.0)
    assert found.p == pytest.approx(expected.pvalue, rel=1e-12)
    assert found.superiority == pytest.approx((a[:, None] > b).mean())
    assert found.shift == pytest.approx(np.median(a[:, None] - b))


@pytest.mark.parametrize("seed", range(50))
def test_two_tied_groups_agree_with_every_choice_of_people(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, m = rng.integers(2, 6, 2)
    a, b = rng.integers(0, 5, n).astype(float), rng.integers(1, 6, m).astype(float)
    ranks = stats.rankdata(np.concatenate([a, b]))
    middle = n * ranks.mean()
    sums = np.array([sum(chosen) for chosen in combinations(ranks, int(n))])
    expected = np.mean(np.abs(sums - middle) >= abs(ranks[:n].sum() - middle) - 1e-9)
    assert of(a, b).p == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("seed", range(50))
def test_three_groups_agree_with_scipys_permutations_of_kruskal_and_wallis(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sizes = rng.integers(2, 4, 3)
    values = rng.integers(0, 6, sizes.sum()).astype(float)
    groups = np.repeat([0, 1, 2], sizes)
    own = tuple(values[groups == group] for group in range(3))
    ranks = np.split(stats.rankdata(values), np.cumsum(sizes)[:-1])

    def between(*each: FloatArray, axis: int = -1) -> FloatArray:
        # Kruskal and Wallis' H rises with it; rounded, so that equal ones are equal.
        sums = (part.sum(axis=axis) ** 2 / part.shape[axis] for part in each)
        return np.asarray(np.round(np.sum(list(sums), axis=0), 9))

    expected = stats.permutation_test(
        ranks, between, alternative="greater", n_resamples=2_000, vectorized=True
    )
    found = compared(values, groups, ["a", "b", "c"])
    assert isinstance(found, Compared)
    assert found.error == 0.0
    assert found.statistic == pytest.approx(stats.kruskal(*own).statistic)
    assert found.p == pytest.approx(expected.pvalue, rel=1e-12)
    by_name = {(pair.a, pair.b): pair for pair in found.pairs}
    assert by_name["a", "c"].p == of(own[0], own[2]).p
    least = min(pair.p for pair in found.pairs)
    assert min(pair.p_holm for pair in found.pairs) == pytest.approx(min(1.0, 3 * least))


def test_random_ways_agree_with_the_exact_p_and_tell_their_error() -> None:
    rng = np.random.default_rng(2)
    a, b = rng.normal(size=40), rng.normal(0.6, 1, 45)
    ranks = stats.rankdata(np.concatenate([a, b]))
    drawn = permuted((ranks - ranks.mean())[:, None], np.repeat([0, 1], [40, 45]))
    assert 0 < drawn.error < 0.001
    assert abs(drawn.p - of(a, b).p) < 4 * drawn.error
    many = of(rng.normal(size=LARGEST_EXACT), rng.normal(size=9))
    assert many.error > 0


@pytest.mark.parametrize("scale", [0.0, 0.2])
def test_intervals_hold_the_shift_as_often_as_they_promise(scale: float) -> None:
    # With a scale the values tie, as mean scores do.
    rng, held, trials = np.random.default_rng(3), 0, 500
    for _ in range(trials):
        a, b = rng.normal(1, 1, 12), rng.normal(0, 1, 10)
        if scale:
            a, b = (np.round(values / scale) * scale for values in (a, b))
        low, high = of(a, b).shift_interval  # type: ignore[misc]
        held += low <= 1 <= high
    assert 0.93 <= held / trials <= 0.97


def test_an_interval_ends_on_the_differences_that_the_exact_test_rejects_next() -> None:
    rng = np.random.default_rng(4)
    a, b = rng.normal(size=7), rng.normal(size=8)
    low, high = of(a, b).shift_interval  # type: ignore[misc]
    for end, inwards in ((low, 1e-6), (high, -1e-6)):
        assert of(a - end - inwards, b).p > 0.05
        assert of(a - end + inwards, b).p < 0.05


def profiles(seed: int = 1, people: int = 10) -> FloatArray:
    return np.random.default_rng(seed).normal(6, 1, (people, 4))


def test_a_level_that_differs_is_no_interaction() -> None:
    groups = np.repeat([0, 1], 5)
    before = interaction(profiles(), groups)
    after = interaction(profiles() + 3.0 * groups[:, None], groups)
    assert isinstance(before, GroupInteraction)
    assert isinstance(after, GroupInteraction)
    assert after.p == before.p
    assert after.share == pytest.approx(before.share)


def test_an_interaction_counts_every_way_to_choose_people() -> None:
    scores, groups = profiles(people=8), np.repeat([0, 1], [3, 5])
    scores[0, 2] = scores[6, 0] = np.nan
    centred = scores - np.nanmean(scores, axis=0)
    centred -= np.nanmean(centred, axis=1, keepdims=True)

    def spread(first: list[int]) -> float:
        others = [row for row in range(8) if row not in first]
        parts = (centred[rows] for rows in (first, others))
        return float(
            sum(
                (np.nansum(part, axis=0) ** 2 / (~np.isnan(part)).sum(axis=0)).sum()
                for part in parts
            )
        )

    observed = spread([0, 1, 2])
    every = [spread(list(chosen)) for chosen in combinations(range(8), 3)]
    found = interaction(scores, groups)
    assert isinstance(found, GroupInteraction)
    assert found.people == 8
    assert found.p == pytest.approx(np.mean(np.array(every) >= observed * (1 - 1e-9)))
    assert found.share == pytest.approx(observed / np.nansum(centred**2))


def test_missing_scores_of_strong_conditions_do_not_lower_a_persons_mean() -> None:
    scores = np.array([[2.0, 8.0], [2.0, np.nan], [3.0, 9.0], [np.nan, np.nan]])
    means = mean_scores(scores)
    assert means[1] < means[2]
    assert abs(means[1] - means[0]) < 0.5
    assert np.isnan(means[3])
    assert mean_scores(scores[[0, 2]]) == pytest.approx([5.0, 6.0])


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ([1.0, 2.0, np.nan, np.nan], "only one group has values"),
        ([np.nan] * 4, "nobody has a value"),
        ([3.0, 3.0, 3.0, 3.0], "everybody has the same value"),
    ],
)
def test_what_cannot_be_compared_says_why(values: list[float], why: str) -> None:
    assert compared(np.array(values), np.array([0, 0, 1, 1]), ["a", "b"]) == NotEstimable(why)
    nothing = group_statistics(
        np.full((4, 2), np.nan), np.array(values), np.array([0, 0, 1, 1]), ["a", "b"], ["c", "d"]
    )
    assert nothing.p_holm == {}
    assert nothing.in_conditions == []


def null_study(rng: np.random.Generator, per_group: int, groups: int) -> GroupStatistics:
    """People of one population in groups, with scores of 12 conditions in whole points."""
    people, contrast = per_group * groups, np.linspace(0.1, 0.5, 12)
    gain, level = rng.normal(5, 2, (people, 1)), rng.normal(4, 1, (people, 1))
    scores = level + gain * contrast + rng.normal(0, 1, (people, 12))
    scores = np.clip(np.round(scores), 0, 10)
    scores[rng.random(scores.shape) < 0.1] = np.nan
    away = contrast - contrast.mean()
    gains = np.nansum(scores * away, axis=1) / (away**2).sum()
    return group_statistics(
        scores,
        gains,
        np.repeat(np.arange(groups), per_group),
        ["a", "b", "c"][:groups],
        [f"c{number}" for number in range(12)],
    )


@pytest.mark.parametrize(("per_group", "groups"), [(6, 2), (3, 3)])
def test_groups_of_one_population_are_seldom_said_to_differ(per_group: int, groups: int) -> None:
    rng, studies, claimed = np.random.default_rng(6), 300, 0
    for _ in range(studies):
        found = null_study(rng, per_group, groups)
        asked = (SCORE, GAIN, INTERACTION)
        claimed += any(map(found.holds, asked)) or bool(found.in_conditions)
    assert claimed / studies <= 0.05 + 2 * np.sqrt(0.05 * 0.95 / studies)


def test_the_ways_that_are_listed_are_all_and_few_enough() -> None:
    # 18 people in two groups of nine are the most that are listed.
    values = np.random.default_rng(1).normal(size=18)
    values -= values.mean()
    assert permuted(values[:, None], np.repeat([0, 1], 9)).error == 0.0
    assert MOST_WAYS < 184_756
