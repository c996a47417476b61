"""Constrained shuffles: what is left is uniform, and nothing breaks its constraint."""

from collections import Counter
from itertools import combinations, groupby, pairwise, permutations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chisquare

from protocol.shuffles import shuffle, spaced_places
from protocol.streams import Stream


def longest_run(items: tuple[int, ...]) -> int:
    return max(len(list(run)) for _, run in groupby(items))


def all_orders(kinds: int, repeats: int, max_run: int) -> set[tuple[int, ...]]:
    items = [kind for kind in range(kinds) for _ in range(repeats)]
    return {order for order in set(permutations(items)) if longest_run(order) <= max_run}


@pytest.mark.parametrize(
    ("kinds", "repeats", "max_run"), [(2, 3, 1), (3, 2, 1), (4, 2, 1), (2, 4, 2), (3, 2, 2)]
)
def test_every_allowed_order_is_equally_likely(kinds: int, repeats: int, max_run: int) -> None:
    stream = Stream(1, kinds, repeats, max_run)
    wanted = all_orders(kinds, repeats, max_run)
    drawn = Counter(tuple(shuffle(kinds, repeats, max_run, stream)) for _ in range(10_000))
    assert drawn.keys() == wanted
    assert len(wanted) < 3 or chisquare(list(drawn.values())).pvalue > 1e-3


@given(st.integers(1, 12), st.integers(1, 8), st.integers(1, 3), st.integers(0, 99))
def test_no_run_is_too_long(kinds: int, repeats: int, max_run: int, seed: int) -> None:
    if kinds == 1 and repeats > max_run:
        with pytest.raises(ValueError, match=f"one item {repeats} times"):
            shuffle(kinds, repeats, max_run, Stream(seed))
        return
    drawn = shuffle(kinds, repeats, max_run, Stream(seed))
    assert Counter(drawn) == dict.fromkeys(range(kinds), repeats)
    assert longest_run(tuple(drawn)) <= max_run


def test_spaced_places_are_uniform() -> None:
    allowed, stream = [1, 2, 4, 5, 6, 9], Stream(1, "places")
    wanted = [
        places
        for places in combinations(allowed, 3)
        if all(after - before >= 2 for before, after in pairwise(places))
    ]
    drawn = Counter(tuple(spaced_places(allowed, 3, 2, stream)) for _ in range(10_000))
    assert drawn.keys() == set(wanted)
    assert chisquare(list(drawn.values())).pvalue > 1e-3


def test_places_that_are_too_close_are_refused() -> None:
    with pytest.raises(ValueError, match=r"no 2 of the places are 3 apart, got \[1, 2, 3\]"):
        spaced_places([1, 2, 3], 2, 3, Stream(1))
