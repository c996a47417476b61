"""The source's clock on the host's: the offset by the shortest of several round trips."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

QUERIES = 5
"""How often the clock is asked at either end of a recording."""


@dataclass(frozen=True, kw_only=True)
class ClockOffset:
    """The host's clock minus the source's lies in [`low_s`, `high_s`]."""

    low_s: float
    high_s: float

    @property
    def offset_s(self) -> float:
        """The middle of the range, s."""
        return (self.low_s + self.high_s) / 2

    @property
    def error_s(self) -> float:
        """The largest error of that, s."""
        return (self.high_s - self.low_s) / 2


def asked_offset(source_s: Callable[[], float], host_s: Callable[[], float]) -> ClockOffset:
    """Return the offset by the shortest round trip of `QUERIES`: the answer lies inside it."""
    trips = []
    for _ in range(QUERIES):
        sent_s = host_s()
        told_s = source_s()
        trips.append(ClockOffset(low_s=sent_s - told_s, high_s=host_s() - told_s))
    return min(trips, key=lambda trip: trip.error_s)


def throughout(offsets: Sequence[ClockOffset]) -> ClockOffset:
    """Return the range that holds all of `offsets`; it is wider if the clocks drift."""
    return ClockOffset(
        low_s=min(offset.low_s for offset in offsets),
        high_s=max(offset.high_s for offset in offsets),
    )
