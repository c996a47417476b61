"""Random streams and constrained shuffles: uniform, and within their constraints."""

from collections import Counter
from hashlib import sha256
from itertools import combinations, groupby, pairwise, permutations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chisquare

from protocol.plan.orders import Stream, shuffle, spaced_places


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
    with pytest.raises(
        ValueError, match=r"cannot choose 2 places at least 3 apart, got \[1, 2, 3\]"
    ):
        spaced_places([1, 2, 3], 2, 3, Stream(1))


def test_draws_are_the_bits_of_sha256() -> None:
    digest = sha256(b"7/order/1#0").digest()
    stream = Stream(7, "order", 1)
    assert [stream.below(256) for _ in range(32)] == list(digest)
    assert stream.below(1) == 0


def test_a_published_seed_gives_the_published_order_on_every_platform() -> None:
    """Regression: our own numbers, the same on every platform and version of Python."""
    assert Stream(1, "order").shuffled(range(10)) == [8, 5, 3, 4, 6, 9, 0, 2, 7, 1]


def test_another_name_or_seed_gives_other_draws() -> None:
    firsts = {
        stream.below(2**64)
        for stream in [Stream(1), Stream(2), Stream(1, "a"), Stream(1, "b"), Stream(1, "a", 0)]
    }
    assert len(firsts) == 5


def test_shuffles_and_weights_are_uniform() -> None:
    stream = Stream(1, "uniform")
    shuffles = Counter(tuple(stream.shuffled("abcd")) for _ in range(12_000))
    assert len(shuffles) == 24
    assert chisquare(list(shuffles.values())).pvalue > 1e-3
    drawn = Counter(stream.weighted([1, 0, 3]) for _ in range(4_000))
    assert chisquare([drawn[0], drawn[2]], [1_000, 3_000]).pvalue > 1e-3
    assert 1 not in drawn


def test_a_limit_of_zero_is_refused() -> None:
    with pytest.raises(ValueError, match="limit must be at least 1, got 0"):
        Stream(1).below(0)
