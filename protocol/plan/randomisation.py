"""Named random streams, one for each purpose, and constrained shuffles.

Python guarantees the same sequence on every platform and version for `random.random` only, not for
its shuffles. Here SHA-256 defines every draw, so that a seed gives the same plan everywhere.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from hashlib import sha256
from itertools import accumulate, chain, pairwise
from math import comb
from typing import TypeVar

T = TypeVar("T")
Name = tuple[int, *tuple[object, ...]]
"""A seed, and the words that name one of its streams."""


class Stream:
    """An endless sequence of independent uniform draws, given by a seed and a name."""

    def __init__(self, seed: int, *name: object) -> None:
        self._name = "/".join(map(str, (seed, *name))).encode()
        self._pool = 0
        self._bits = 0
        self._blocks = 0

    def below(self, limit: int) -> int:
        """Return a whole number, uniform in [0, limit).

        Bits are drawn until they form a number below `limit`, so that all values are equally
        likely (a remainder would favour small ones).

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
        return bisect_right(list(accumulate(weights)), self.below(sum(weights)))


def shuffle(kinds: int, repeats: int, max_run: int, stream: Stream) -> list[int]:
    """Return `kinds` items, each `repeats` times, in random order with short runs.

    Every order in which no item comes more than `max_run` times in a row is equally likely.

    Raises:
        ValueError: no such order exists.
    """
    if kinds == 1 and repeats > max_run:
        raise ValueError(f"one item {repeats} times cannot have runs of at most {max_run}")
    if max_run >= repeats:
        return stream.shuffled(item for item in range(kinds) for _ in range(repeats))
    if max_run == 1:
        return _without_neighbours_alike(kinds, repeats, stream)
    while (drawn := _attempt(kinds, repeats, max_run, stream)) is None:
        pass
    return drawn


def _attempt(kinds: int, repeats: int, max_run: int, stream: Stream) -> list[int] | None:
    """Return a shuffle, or None at the first run that is too long: rejection keeps it uniform."""
    left = [item for item in range(kinds) for _ in range(repeats)]
    drawn: list[int] = []
    run = 0
    while left:
        chosen = stream.below(len(left))
        item, left[chosen] = left[chosen], left[-1]
        left.pop()
        run = run + 1 if drawn and drawn[-1] == item else 1
        if run > max_run:
            return None
        drawn.append(item)
    return drawn


def _without_neighbours_alike(kinds: int, repeats: int, stream: Stream) -> list[int]:
    """Insert the kinds one by one, by exact counts; rejection would almost never succeed here.

    A gap between two equal neighbours is bad. Each kind is split into `parts` runs, of which
    `mending` go into bad gaps and the others elsewhere; a run of m items leaves m - 1 bad gaps.
    """
    drawn = [0] * repeats
    for kind in range(1, kinds):
        bad = [at for at in range(1, len(drawn)) if drawn[at] == drawn[at - 1]]
        choices = list(_choices(len(bad), kind, repeats))
        weights = [
            ways * _completions(kinds, repeats, kind + 1, len(bad) - mending + repeats - parts)
            for parts, mending, ways in choices
        ]
        parts, mending, _ = choices[stream.weighted(weights)]
        good = [at for at in range(len(drawn) + 1) if at not in bad]
        gaps = stream.shuffled(bad)[:mending] + stream.shuffled(good)[: parts - mending]
        # All lists of `parts` positive lengths with the sum `repeats` are equally likely.
        cuts = sorted(stream.shuffled(range(1, repeats))[: parts - 1])
        lengths = [end - begin for begin, end in pairwise([0, *cuts, repeats])]
        runs = dict(zip(sorted(gaps), lengths, strict=True))
        woven = ([kind] * runs.get(at, 0) + drawn[at : at + 1] for at in range(len(drawn) + 1))
        drawn = list(chain.from_iterable(woven))
    return drawn


def _choices(bad: int, kind: int, repeats: int) -> Iterator[tuple[int, int, int]]:
    """Yield (parts, mending, ways) of inserting the next kind among `kind` earlier ones."""
    good = kind * repeats + 1 - bad
    for parts in range(1, repeats + 1):
        for mending in range(min(parts, bad) + 1):
            ways = comb(repeats - 1, parts - 1) * comb(bad, mending) * comb(good, parts - mending)
            yield parts, mending, ways


@lru_cache(maxsize=65_536)
def _completions(kinds: int, repeats: int, kind: int, bad: int) -> int:
    """Return the number of ways to insert the kinds from `kind` on so that no bad gap is left."""
    if kind == kinds:
        return int(bad == 0)
    return sum(
        ways * _completions(kinds, repeats, kind + 1, bad - mending + repeats - parts)
        for parts, mending, ways in _choices(bad, kind, repeats)
        if ways
    )


def spaced_places(allowed: list[int], number: int, apart: int, stream: Stream) -> list[int]:
    """Return `number` of the ascending places `allowed`, each at least `apart` after the last.

    Every such choice is equally likely.

    Raises:
        ValueError: no such choice exists.
    """
    # ways[i][k]: the number of choices of k places among allowed[i:]
    after = [bisect_left(allowed, place + apart) for place in allowed]
    ways = [[1] + [0] * number for _ in range(len(allowed) + 1)]
    for i in reversed(range(len(allowed))):
        for wanted in range(1, number + 1):
            ways[i][wanted] = ways[i + 1][wanted] + ways[after[i]][wanted - 1]
    if not ways[0][number]:
        raise ValueError(f"cannot choose {number} places at least {apart} apart, got {allowed}")
    chosen: list[int] = []
    at = 0
    for wanted in range(number, 0, -1):
        while stream.below(ways[at][wanted]) >= ways[after[at]][wanted - 1]:
            at += 1
        chosen.append(allowed[at])
        at = after[at]
    return chosen
