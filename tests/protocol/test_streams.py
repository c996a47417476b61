"""Random streams: the same everywhere, independent by name, uniform."""

from collections import Counter
from hashlib import sha256

import pytest
from scipy.stats import chisquare

from protocol.streams import Stream


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


def test_nothing_cannot_be_drawn() -> None:
    with pytest.raises(ValueError, match="limit must be at least 1, got 0"):
        Stream(1).below(0)
