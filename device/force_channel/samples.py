"""What the force channel gives: the samples of one recording, and the newest forces."""

from collections.abc import Sequence
from dataclasses import dataclass

from device.errors import ProtocolError
from protocol.journal import recordings

CHANNELS = len(recordings.CHANNELS)
FULL_SCALE = recordings.FULL_SCALE
BLOCKS_PER_S = 20
"""A block holds at most 50 ms, so that nothing waits longer than that for the port."""

Scale = tuple[float, float, float]
"""Size of one count: tangential force (N), normal force (N), position (m)."""
_RANGES = ((0.01, 1000.0), (0.01, 1000.0), (1e-3, 10.0))
"""Least and most that a channel may measure: no sensor of a finger on a beam lies outside."""


@dataclass(frozen=True, kw_only=True)
class Samples:
    """The samples of one recording, none lost and none doubled.

    Attributes:
        source: what measured: `board`, or the dialect of the gauge.
        rate_hz: samples per second and channel.
        first_s: time of the first sample on the source's own clock, s.
        scale: size of one count of each channel.
        counts: 16-bit counts, least byte first: all of tangential force, of normal force, of
            position.
        saturated: samples in which a channel was at its limit.
        clock_offset_s: the host's monotonic clock minus the source's, s.
        clock_error_s: largest error of that, s.
    """

    source: str
    rate_hz: float
    first_s: float
    scale: Scale
    counts: bytes
    saturated: int
    clock_offset_s: float
    clock_error_s: float


@dataclass(frozen=True, kw_only=True)
class Forces:
    """Means of the newest block, which ends at `at_s` on the host's monotonic clock."""

    at_s: float
    tangential_n: float
    normal_n: float
    position_m: float


def scale_of(sizes: Sequence[float]) -> Scale:
    """Return the `sizes` of one count as a scale: N, N, m.

    Raises:
        ProtocolError: no such sensor is on a rig, so that its forces cannot be believed.
    """
    largest = [size * FULL_SCALE for size in sizes]
    within = [low <= value <= high for value, (low, high) in zip(largest, _RANGES, strict=False)]
    if len(sizes) != CHANNELS or not all(within):
        raise ProtocolError(
            "the force channel must measure up to 0.01 to 1000 N, twice, and 0.001 to 10 m, got "
            f"{', '.join(f'{value:g}' for value in largest)}"
        )
    tangential_n, normal_n, position_m = sizes
    return tangential_n, normal_n, position_m


def most_in_block(rate_hz: float) -> int:
    """Return the most samples that one block may hold.

    >>> most_in_block(1000), most_in_block(50)
    (50, 2)
    """
    return max(int(rate_hz) // BLOCKS_PER_S, 1)
