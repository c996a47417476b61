"""Effects of factors within people: against enumeration and least squares; recovery of truth."""

from itertools import permutations, product
from math import prod

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import fdtrc, ncfdtr
from scipy.stats import rankdata

import analysis.statistics.factorial as module
from analysis.estimates import NotEstimable
from analysis.statistics.corrections import holm
from analysis.statistics.factorial import (
    SESSION,
    Crossed,
    Effect,
    Factorial,
    cell_intervals,
    factorial_p,
    factorial_tests,
    within_effect,
)

Array = NDArray[np.float64]


def scores_of(seed: int, people: int, *levels: int, effect: float = 0.0) -> Array:
    """Scores from 0 to 10 with an effect of the first factor, in whole points."""
    rng = np.random.default_rng(seed)
    level = rng.normal(5, 1, (people, *[1] * len(levels)))
    added = effect * np.arange(levels[0]).reshape(-1, *[1] * (len(levels) - 1))
    return np.clip(np.round(level + added + rng.normal(0, 1.5, (people, *levels))), 0, 10)


def crossed(scores: Array) -> Crossed:
    names = "abcd"
    factors = {
        names[at]: tuple(map(str, range(count))) for at, count in enumerate(scores.shape[1:])
    }
    return Crossed(factors=factors, responses=scores)


def effect_of(scores: Array, *factors: int) -> Effect:
    found = within_effect(scores, factors)
    assert isinstance(found, Effect)
    return found


def deviations(scores: Array, factors: tuple[int, ...]) -> Array:
    """By inclusion and exclusion of means, unlike the product."""
    total = np.zeros_like(scores)
    for kept in product((False, True), repeat=len(factors)):
        of = {factor + 1 for factor, keep in zip(factors, kept, strict=True) if keep}
        gone = tuple(axis for axis in range(1, scores.ndim) if axis not in of)
        means = scores.mean(axis=gone, keepdims=True)
        total = total + (-1) ** (len(factors) - len(of)) * means
    return np.asarray(total)


def share_of(scores: Array, factors: tuple[int, ...]) -> float:
    """Partial η², which rises with F and is known where F has no error."""
    own = deviations(scores, factors)
    return float((own.mean(axis=0) ** 2).sum() * len(own) / (own**2).sum())


@pytest.mark.parametrize("shape", [(4, 2), (3, 3), (3, 2, 2), (2, 3, 2), (3, 3, 2), (2, 2, 2, 2)])
@pytest.mark.parametrize("seed", range(4))
def test_p_is_the_share_of_all_arrangements(shape: tuple[int, ...], seed: int) -> None:
    """Each person's levels in every order, the first person's too; whole tables are shuffled."""
    scores = scores_of(seed, *shape)
    for factors in [(0,), *([(1,), (0, 1)] if len(shape) > 2 else [])]:
        found = within_effect(scores, factors)
        if isinstance(found, NotEstimable):
            continue
        others = tuple(axis for axis in range(1, scores.ndim) if axis - 1 not in factors)
        own = scores.mean(axis=others)
        orders = list(product(*(permutations(range(count)) for count in own.shape[1:])))
        tables = [[person[np.ix_(*order)] for order in orders] for person in own]
        own_factors = tuple(range(len(factors)))
        observed = share_of(own, own_factors)
        reached = [
            share_of(np.array(table), own_factors) >= observed * (1 - 1e-9)
            for table in product(*tables)
        ]
        assert found.p_permuted == pytest.approx(np.mean(reached), abs=1e-12)
        assert found.monte_carlo is None
        p_f = 0.0 if isinstance(found.p_f, NotEstimable) else found.p_f
        assert isinstance(found.p_f, NotEstimable) == (observed > 1 - 1e-9)
        assert found.p == max(found.p_permuted, p_f)


@pytest.mark.parametrize("seed", range(10))
def test_f_is_that_of_least_squares(seed: int) -> None:
    """The fall of the squares when the effect, and then its differences between people, go in."""
    rng = np.random.default_rng(seed)
    people, levels = int(rng.integers(3, 9)), tuple(rng.integers(2, 5, int(rng.integers(2, 4))))
    scores = scores_of(seed, people, *levels, effect=0.5)
    for factors in [(0,), (1,), (0, 1)]:
        found = effect_of(scores, *factors)
        own = deviations(scores, factors)
        effect = people * prod(levels) * (own.mean(axis=0) ** 2).mean()
        differences = (own**2).sum() * prod(levels) * people / own.size - effect
        of_effect = prod(levels[factor] - 1 for factor in factors)
        assert found.df == (of_effect, of_effect * (people - 1))
        assert isinstance(found.f, float)
        assert isinstance(found.epsilon, float)
        assert found.f == pytest.approx(effect * (people - 1) / differences, rel=1e-9)
        assert found.partial_eta2 == pytest.approx(effect / (effect + differences), rel=1e-9)
        ends = found.partial_eta2_interval
        assert not isinstance(ends, NotEstimable)
        for end, chance in zip(ends, (0.975, 0.025), strict=True):
            df, error_df = found.epsilon * found.df[0], found.epsilon * found.df[1]
            told = ncfdtr(df, error_df, end / (1 - end) * error_df, found.f)
            assert told == pytest.approx(chance, abs=1e-6) or (end == 0 and told < chance)


ANOVA_RM = [
    (1, (6, 3, 4), (0,), 0.8620689655, 10, 0.4514351841),
    (1, (6, 3, 4), (1,), 0.9250739402, 15, 0.4526491519),
    (1, (6, 3, 4), (0, 1), 1.1445783133, 30, 0.3613826770),
    (2, (9, 2, 3, 2), (0, 2), 4.9230769231, 8, 0.0572891734),
    (2, (9, 2, 3, 2), (0, 1), 2.8588410104, 16, 0.0867864852),
]
"""F, the error's df and p without correction, by AnovaRM of statsmodels 0.15."""


@pytest.mark.parametrize(("seed", "shape", "factors", "f", "df", "p"), ANOVA_RM)
def test_f_is_that_of_statsmodels(
    seed: int, shape: tuple[int, ...], factors: tuple[int, ...], f: float, df: int, p: float
) -> None:
    found = effect_of(scores_of(seed, *shape, effect=0.5), *factors)
    assert isinstance(found.f, float)
    assert isinstance(found.epsilon, float)
    assert (found.f, found.df[1]) == pytest.approx((f, df))
    assert fdtrc(*found.df, found.f) == pytest.approx(p)
    corrected = [found.epsilon * each for each in found.df]
    assert found.p_f == pytest.approx(fdtrc(corrected[0], corrected[1], found.f))


def test_the_interval_of_partial_eta2_excludes_0_where_its_p_is_below_a_fortieth() -> None:
    """It has the correction that p has: people here differ more at some levels than at others."""
    rng = np.random.default_rng(2)
    decided = []
    for _ in range(200):
        slopes = rng.normal(0.6, 1.0, (10, 1))
        found = effect_of(slopes * np.arange(4) + rng.normal(0, 0.5, (10, 4)), 0)
        assert not isinstance(found.partial_eta2_interval, NotEstimable)
        assert isinstance(found.p_f, float)
        low, high = found.partial_eta2_interval
        assert (low > 0) == (found.p_f < 0.025)
        assert low <= found.partial_eta2 <= high or low == 0
        decided.append(low > 0)
    assert 20 < sum(decided) < 180


def test_random_shufflings_agree_with_all_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    for factors in [(0,), (1,), (0, 1)]:
        scores = scores_of(3, 4, 3, 2, effect=0.4)
        exact = effect_of(scores, *factors).p_permuted
        with monkeypatch.context() as patched:
            patched.setattr(module, "MOST_ARRANGEMENTS", 0)
            shuffled = effect_of(scores, *factors).monte_carlo
        assert shuffled is not None
        assert abs(shuffled.p - exact) < 4 * shuffled.error


def test_an_effect_is_found_and_others_are_not() -> None:
    found = factorial_tests(crossed(scores_of(1, 12, 3, 4, effect=1.0)))
    assert [it.name for it in found.effects] == ["a", "b", "a × b"]
    assert [it.found for it in found.effects] == [True, False, False]
    effects = [it.effect for it in found.effects]
    p = holm([each.p for each in effects if isinstance(each, Effect)])
    assert [it.p_holm for it in found.effects] == p
    differences = [it.difference for it in found.levels if it.factor == "a"]
    assert differences == sorted(differences), "of means, though ranks are tested"
    assert sum(differences) == pytest.approx(0, abs=1e-12)
    assert found.of("b", "a") is found.effects[2]
    assert found.of("c") is None


def test_who_has_an_empty_cell_is_left_out_but_a_missed_session_is_no_empty_cell() -> None:
    scores = scores_of(2, 7, 2, 3)
    both = np.stack([scores, scores + 1.0], axis=-1)
    both[0, ..., 1] = np.nan
    averaged = crossed(scores)
    wide = Crossed(factors={**averaged.factors, SESSION: ("1", "2")}, responses=both)
    found = factorial_tests(averaged, wide)
    people = {it.name: getattr(it.effect, "people", None) for it in found.effects}
    assert (people["a"], people["a × b"]) == (7, 7)
    assert people[SESSION] == 6
    scores[1:, 0, 0] = np.nan
    (first, *_) = factorial_tests(crossed(scores)).effects
    assert isinstance(first.effect, NotEstimable)
    assert "at least 2 people with an answer in each of 6 cells, got 1" in first.effect.reason


def test_equal_scores_have_no_effect_to_test() -> None:
    found = within_effect(np.full((5, 2, 3), 4.0), (0,))
    assert found == NotEstimable("nobody's responses differ in this way")


def test_intervals_of_cells_leave_out_the_levels_of_people() -> None:
    scores = scores_of(5, 9, 3, 2)
    shifted = scores + 4.0 * np.arange(9).reshape(-1, 1, 1)
    (means, halves), (moved, same) = (
        cell_intervals(crossed(each), "b", "a") for each in (scores, shifted)
    )
    assert means.shape == halves.shape == (2, 3)
    assert same == pytest.approx(halves)
    assert moved - means == pytest.approx(16.0)


def ranked(scores: Array) -> Array:
    """Each person's ranks over all cells, as scipy has them."""
    ranks = [rankdata(person.ravel()) for person in scores]
    return np.reshape(ranks, scores.shape)


@pytest.mark.parametrize("seed", range(6))
def test_main_effects_are_those_of_ranks_over_all_cells_and_interactions_those_of_means(
    seed: int,
) -> None:
    scores = scores_of(seed, 6, 2, 3, effect=0.7)
    found = {it.factors: it.effect for it in factorial_tests(crossed(scores)).effects}
    ranks = ranked(scores)
    assert found["a",] == within_effect(ranks, (0,))
    assert found["b",] == within_effect(ranks, (1,))
    assert found["a", "b"] == within_effect(scores, (0, 1))
    np.testing.assert_array_equal(crossed(scores).tested("a"), ranks)
    np.testing.assert_array_equal(crossed(scores).tested("a", "b"), scores)


def test_a_rare_answer_of_no_change_counts_no_more_than_its_place() -> None:
    """However far below the others a cell of a person is, the main effects stay."""
    scores = scores_of(1, 8, 2, 3, effect=1.0)
    scores[0, 0, 0] = scores[0].min() - 1
    low = scores.copy()
    low[0, 0, 0] = -1000.0
    (first, second, both), (again, same, other) = (
        factorial_tests(crossed(each)).effects for each in (scores, low)
    )
    assert (first.effect, second.effect) == (again.effect, same.effect)
    assert both.effect != other.effect


def test_a_study_and_its_mirror_image_have_the_same_p() -> None:
    scores = scores_of(3, 7, 2, 3, effect=0.6)
    made, turned = (factorial_tests(crossed(each)) for each in (scores, 10 - scores))
    for one, other in zip(made.effects, turned.effects, strict=True):
        assert isinstance(one.effect, Effect)
        assert isinstance(other.effect, Effect)
        assert one.effect.p == pytest.approx(other.effect.p, rel=1e-9)
        assert one.effect.f == pytest.approx(other.effect.f, rel=1e-9)
    differences = [[it.difference for it in each.levels] for each in (made, turned)]
    assert differences[0] == pytest.approx([-it for it in differences[1]])


@pytest.mark.parametrize("people", [3, 6, 9])
def test_where_everybody_differs_alike_shuffles_alone_decide(people: int) -> None:
    """Of 2 levels each person has 2 orders, and the observed sum is reached in 2 of all."""
    level = np.arange(float(people)).reshape(-1, 1, 1)
    scores = level + np.array([[0.0, 1.0, 2.0], [4.0, 5.0, 6.0]])
    found = effect_of(scores, 0)
    assert found.f == found.p_f == found.epsilon == NotEstimable("everybody differs alike")
    assert found.partial_eta2_interval == NotEstimable("everybody differs alike")
    assert found.partial_eta2 == pytest.approx(1.0)
    assert found.p == found.p_permuted == pytest.approx(2.0 ** (1 - people))
    assert within_effect(scores, (0, 1)) == NotEstimable("nobody's responses differ in this way")


def found_by(tests: Factorial) -> list[bool]:
    return [isinstance(it.effect, Effect) and it.effect.p < 0.05 for it in tests.effects]


@pytest.mark.parametrize("effect", [0.0, 1.5])
def test_simulations_find_the_effects_that_reports_find(effect: float) -> None:
    decided = []
    for seed in range(12):
        of = crossed(scores_of(seed, 10, 2, 3, effect=effect))
        tests, p = factorial_tests(of), factorial_p(of)
        near = [
            isinstance(it.effect, Effect) and abs(it.effect.p_permuted - 0.05) < 0.02
            for it in tests.effects
        ]
        told = zip(found_by(tests), p, near, strict=True)
        assert all(close or was == (each < 0.05) for was, each, close in told)
        decided += found_by(tests)
    assert (sum(decided) > 6) == (effect > 0)


def test_the_share_as_expected_and_its_score_stand_beside_a_level() -> None:
    answers = {("a", "0"): (0.25, 6.5), ("b", "2"): (1.0, float("nan"))}
    levels = factorial_tests(crossed(scores_of(1, 5, 2, 3)), answers=answers).levels
    told = {(it.factor, it.level): (it.expected, it.score) for it in levels}
    assert told["a", "0"] == (0.25, 6.5)
    assert told["b", "2"][0] == 1.0
    assert np.isnan([*told["a", "1"], told["b", "2"][1]]).all()
