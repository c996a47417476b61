"""Effects of factors within people: against enumeration and least squares; recovery of truth."""

from itertools import permutations, product
from math import prod

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import fdtrc, ncfdtr

import analysis.statistics.factorial as module
from analysis.estimates import NotEstimable
from analysis.statistics.corrections import holm
from analysis.statistics.factorial import (
    SESSION,
    Crossed,
    Effect,
    LatentFactorial,
    cell_intervals,
    factorial_tests,
    latent_factorial,
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
    return Crossed(factors=factors, scores=scores)


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
        assert found.p == max(found.p_permuted, found.p_f)


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
    assert differences == sorted(differences)
    assert sum(differences) == pytest.approx(0, abs=1e-12)
    assert found.of("b", "a") is found.effects[2]
    assert found.of("c") is None


def test_who_has_an_empty_cell_is_left_out_but_a_missed_session_is_no_empty_cell() -> None:
    scores = scores_of(2, 7, 2, 3)
    both = np.stack([scores, scores + 1.0], axis=-1)
    both[0, ..., 1] = np.nan
    averaged = crossed(scores)
    wide = Crossed(factors={**averaged.factors, SESSION: ("1", "2")}, scores=both)
    found = factorial_tests(averaged, wide)
    people = {it.name: getattr(it.effect, "people", None) for it in found.effects}
    assert (people["a"], people["a × b"]) == (7, 7)
    session = found.of(SESSION)
    assert session is not None
    # Everybody changes by one point: there is no difference between people to compare it with.
    assert isinstance(session.effect, NotEstimable)
    assert "alike" in session.effect.reason
    scores[1:, 0, 0] = np.nan
    (first, *_) = factorial_tests(crossed(scores)).effects
    assert isinstance(first.effect, NotEstimable)
    assert "at least 2 people with a score in each of 6 cells, got 1" in first.effect.reason


def test_equal_scores_have_no_effect_to_test() -> None:
    found = within_effect(np.full((5, 2, 3), 4.0), (0,))
    assert found == NotEstimable("nobody's scores differ in this way")


def test_intervals_of_cells_leave_out_the_levels_of_people() -> None:
    scores = scores_of(5, 9, 3, 2)
    shifted = scores + 4.0 * np.arange(9).reshape(-1, 1, 1)
    (means, halves), (moved, same) = (
        cell_intervals(crossed(each), "b", "a") for each in (scores, shifted)
    )
    assert means.shape == halves.shape == (2, 3)
    assert same == pytest.approx(halves)
    assert moved - means == pytest.approx(16.0)


def test_the_ordinal_model_recovers_latent_effects_of_levels() -> None:
    rng = np.random.default_rng(4)
    people, repeats = 150, 2
    slopes, other = np.array([-0.8, 0.0, 0.8]), np.array([0.3, -0.3])
    cell = np.tile(np.arange(6), people * repeats)
    subject = np.repeat(np.arange(people), 6 * repeats)
    latent = rng.normal(0, 1, people)[subject] + slopes[cell // 2] + other[cell % 2]
    scores = np.digitize(latent + rng.normal(size=len(cell)), [-1.5, -0.5, 0.5, 1.5]) * 1.0
    factors = {"a": ("1", "2", "3"), "b": ("x", "y")}
    found = latent_factorial(scores, subject, cell, factors)
    assert isinstance(found, LatentFactorial)
    for it, truth in zip(found.levels, [*slopes, *other], strict=True):
        assert abs(it.effect - truth) < 4 * it.standard_error < 0.5
    p = {it.factors: it.p for it in found.effects}
    assert max(p["a",], p["b",]) < 1e-6
    assert p["a", "b"] > 0.01
    assert found.subject_sd == pytest.approx(1, abs=0.25)
