"""Which beams a trial needs, and how often the operator swaps them."""

from collections.abc import Iterable
from itertools import pairwise

from protocol.touch import Touch

Beams = tuple[str | None, ...]


def beams_of(touches: Iterable[Touch], mounted: str | None) -> Beams:
    """Return the beams that the touches need, in order, without immediate repetition.

    `mounted` is the study's own, taken where a touch names none.
    """
    needed: list[str | None] = []
    for touch in touches:
        beam = touch.beam or mounted
        if not needed or needed[-1] != beam:
            needed.append(beam)
    return tuple(needed)


def swap_count(beams: Iterable[str | None]) -> int:
    """Return how often one beam is taken off for another.

    >>> swap_count(["1 mm", "1 mm", "none", "1 mm"])
    2
    """
    return sum(before != after for before, after in pairwise(beams))
