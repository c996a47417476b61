"""Named random streams: each purpose draws from its own, so that changing one leaves the others.

Python promises the same sequence on every platform and version for `random.random` alone, not for
its shuffles. Here every draw is defined by SHA-256, so that a seed gives the same plan anywhere.
"""

from collections.abc import Iterable, Sequence
from hashlib import sha256
from typing import TypeVar

T = TypeVar("T")
Name = tuple[int, *tuple[object, ...]]
"""A seed, and the words that name a stream of its own."""


class Stream:
    """An endless sequence of independent uniform draws, given by a seed and a name."""

    def __init__(self, seed: int, *name: object) -> None:
        self._name = "/".join(map(str, (seed, *name))).encode()
        self._pool = 0
        self._bits = 0
        self._blocks = 0

    def below(self, limit: int) -> int:
        """Return a whole number, uniform in [0, limit).

        Bits are drawn until they form a number below `limit`: no value is favoured.

        Raises:
            ValueError: `limit` is below 1.
        """
        if limit < 1:
            raise ValueError(f"limit must be at least 1, got {limit}")
        wanted = (limit - 1).bit_length()
        while (drawn := self._drawn(wanted)) >= limit:
            pass
        return drawn

    def _drawn(self, bits: int) -> int:
        while self._bits < bits:
            block = sha256(self._name + b"#%d" % self._blocks).digest()
            self._pool |= int.from_bytes(block, "little") << self._bits
            self._bits += 256
            self._blocks += 1
        drawn = self._pool & ((1 << bits) - 1)
        self._pool >>= bits
        self._bits -= bits
        return drawn

    def shuffled(self, items: Iterable[T]) -> list[T]:
        """Return the items in a uniformly random order (Fisher-Yates)."""
        left = list(items)
        for last in range(len(left) - 1, 0, -1):
            chosen = self.below(last + 1)
            left[last], left[chosen] = left[chosen], left[last]
        return left

    def one_of(self, items: Sequence[T]) -> T:
        """Return one of the items, each equally likely."""
        return items[self.below(len(items))]

    def weighted(self, weights: Sequence[int]) -> int:
        """Return an index, drawn in proportion to the whole numbers `weights`."""
        drawn = self.below(sum(weights))
        for index, weight in enumerate(weights):
            if drawn < weight:
                return index
            drawn -= weight
        raise AssertionError("unreachable: the draw is below the sum")
