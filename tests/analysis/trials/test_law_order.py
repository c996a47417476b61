"""How laws order the conditions, against the order of the mean ratings."""

import math
from itertools import permutations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy import stats

from analysis.estimates import FloatArray, NotEstimable
from analysis.trials.law_likelihood import (
    LawOrder,
    critical_correlation,
    critical_rank_correlation,
    law_order,
)

CONDITIONS = ("frequency", "structure", "voltage", "direction", "pressure")
# Column means of the paper's Table 4.
MEANS = np.array([76.0, 80.0, 87.0, 75.0, 56.0]) / 9


def order_of(predicted: FloatArray, observed: FloatArray) -> LawOrder:
    names = tuple(f"c{number}" for number in range(len(predicted)))
    result = law_order(names, predicted, observed)
    assert isinstance(result, LawOrder)
    return result


def test_five_conditions_are_no_evidence_for_the_consistent_law() -> None:
    # Changes of friction at the smooth place, and of places along the path.
    predicted = np.array([0.050, 0.041, 0.133, 0.326, 0.015])
    result = law_order(CONDITIONS, predicted, MEANS)
    assert isinstance(result, LawOrder)
    assert result.order == ("direction", "voltage", "frequency", "structure", "pressure")
    assert result.spearman == pytest.approx(0.30, abs=1e-12)
    assert result.needed == pytest.approx(0.878, abs=5e-4)
    assert isinstance(result.p, float)
    assert result.p > 0.6
    assert (result.rank_needed, result.rated) == (1.0, 5)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=3, max_size=6))
def test_correlations_agree_with_scipy_and_every_order(pairs: list[tuple[int, int]]) -> None:
    predicted, observed = np.array(pairs, dtype=np.float64).T
    assume(np.ptp(predicted) > 0 and np.ptp(observed) > 0)
    result = order_of(predicted, observed)
    assert result.spearman == pytest.approx(stats.spearmanr(predicted, observed)[0], abs=1e-12)

    one, other = stats.rankdata(predicted), stats.rankdata(observed)
    products = [np.dot(np.array(order) - one.mean(), other) for order in permutations(one)]
    reached = np.abs(products) >= abs(np.dot(one - one.mean(), other)) - 1e-9
    assert result.p == pytest.approx(float(reached.mean()), abs=1e-12)

    length = np.sqrt(((one - one.mean()) ** 2).sum() * ((other - other.mean()) ** 2).sum())
    rare = [value for value in np.abs(products) if np.mean(np.abs(products) >= value - 1e-9) < 0.05]
    if rare:
        assert result.rank_needed == pytest.approx(min(rare) / length, abs=1e-12)
    else:
        assert isinstance(result.rank_needed, NotEstimable)


@pytest.mark.parametrize(
    ("pairs", "needed"),
    [(5, 1.0), (6, 0.886), (7, 0.786), (8, 0.738), (9, 0.700), (10, 0.648), (11, 0.618)],
)
def test_what_a_rank_correlation_must_reach(pairs: int, needed: float) -> None:
    """As in the tables of Zar (Biostatistical Analysis, B.20)."""
    assert critical_rank_correlation(pairs) == pytest.approx(needed, abs=5e-4)


@pytest.mark.parametrize("pairs", [3, 4])
def test_no_order_of_four_conditions_is_evidence(pairs: int) -> None:
    assert critical_rank_correlation(pairs) == NotEstimable(
        f"no order of these {pairs} conditions has p < .05"
    )


def test_ties_leave_five_conditions_no_order_that_is_evidence() -> None:
    claimed = order_of(np.array([0.0, 0.0, 1.0, 0.0, -1.0]), MEANS)
    assert isinstance(claimed.rank_needed, NotEstimable)


def test_many_conditions_have_the_t_approximation() -> None:
    rng = np.random.default_rng(1)
    predicted = rng.normal(size=12)
    observed = predicted + rng.normal(size=12)
    expected = stats.spearmanr(predicted, observed)
    assert order_of(predicted, observed).p == pytest.approx(expected.pvalue, rel=1e-9)


def test_a_perfect_order_of_nine_conditions_has_the_share_that_it_is_of_all_orders() -> None:
    """2 of 9! orders, 2 * 3! with three tied in the middle; with two at an end none mirrors it."""
    plain, middle, end = (np.arange(9, dtype=np.float64) for _ in range(3))
    middle[3:6], end[:2] = 4, 1
    shares = [order_of(ranks, ranks).p for ranks in (plain, middle, end)]
    assert np.array(shares) * math.factorial(9) == pytest.approx([2, 12, 2])


@pytest.mark.parametrize("count", [9, 10, 11])
def test_a_nearly_perfect_order_is_one_of_as_many_as_there_are_neighbours_to_swap(
    count: int,
) -> None:
    plain = np.arange(count, dtype=np.float64)
    swapped = np.array([1, 0, *range(2, count)], dtype=np.float64)
    assert order_of(plain, swapped).p == pytest.approx(2 * count / math.factorial(count))


def test_conditions_nobody_rated_are_left_out_of_the_correlation() -> None:
    result = order_of(np.array([0.1, 0.3, 0.2, 0.9]), np.array([1.0, 3.0, 2.0, np.nan]))
    assert (result.spearman, result.order[0], result.rated) == (1.0, "c3", 3)


def test_equal_contrasts_are_tied_in_the_order() -> None:
    result = law_order(CONDITIONS, np.array([-0.1, 0.0, -0.2, 0.6, 1e-12]), MEANS)
    assert isinstance(result, LawOrder)
    assert result.tied == (("direction",), ("structure", "pressure"), ("frequency",), ("voltage",))
    assert result.order == ("direction", "structure", "pressure", "frequency", "voltage")


def test_laws_without_an_order_say_why() -> None:
    flat = order_of(np.array([0.2, 0.2, 0.2]), np.array([1.0, 2.0, 3.0]))
    assert isinstance(flat.spearman, NotEstimable)
    assert "contrasts, or all mean ratings, are equal" in flat.spearman.reason
    few = law_order(("a", "b"), np.array([0.1, 0.2]), np.array([1.0, 2.0]))
    assert few == NotEstimable(
        "an order needs at least 3 conditions with a score and a predicted contrast, got 2"
    )
    assert critical_correlation(2) == NotEstimable(
        "a correlation is tested with at least 3 pairs, got 2"
    )
    with pytest.raises(ValueError, match="2 conditions need as many values, got 1"):
        law_order(("a", "b"), np.array([0.1]), np.array([1.0, 2.0]))
