"""Williams sequences: balance of positions and of neighbours."""

from collections import Counter
from itertools import pairwise

import pytest

from protocol.williams import williams_sequences


@pytest.mark.parametrize("n", range(2, 13))
def test_every_condition_stands_at_every_position_equally_often(n: int) -> None:
    sequences = williams_sequences(n)
    for position in range(n):
        counts = Counter(sequence[position] for sequence in sequences)
        assert counts == dict.fromkeys(range(n), len(sequences) // n)


@pytest.mark.parametrize("n", range(2, 13))
def test_every_condition_follows_every_other_one_equally_often(n: int) -> None:
    sequences = williams_sequences(n)
    pairs = Counter(pair for sequence in sequences for pair in pairwise(sequence))
    wanted = {(a, b): len(sequences) // n for a in range(n) for b in range(n) if a != b}
    assert pairs == wanted


def test_five_conditions_need_ten_sequences() -> None:
    assert len(set(williams_sequences(5))) == 10


def test_no_condition_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 1 condition, got 0"):
        williams_sequences(0)
