"""A recording in progress: what its source must do, and its start, its blocks and its end."""

import math
import struct
import sys
import zlib
from array import array
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from device.errors import DeviceError, ProtocolError
from protocol.journal import records as recordings

QUERIES = 5
"""How often the clock is asked at either end of a recording."""


@dataclass(frozen=True, kw_only=True)
class ClockOffset:
    """The host's clock minus the source's lies in [`low_s`, `high_s`]."""

    low_s: float
    high_s: float

    @property
    def offset_s(self) -> float:
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
    # A busy computer or line lengthens a trip and never shortens one: the shortest says most.
    return min(trips, key=lambda trip: trip.error_s)


def throughout(offsets: Sequence[ClockOffset]) -> ClockOffset:
    """Return the range that holds all of `offsets`; it is wider if the clocks drift."""
    return ClockOffset(
        low_s=min(offset.low_s for offset in offsets),
        high_s=max(offset.high_s for offset in offsets),
    )


CHANNELS = len(recordings.CHANNELS)
FULL_SCALE = recordings.FULL_SCALE
BLOCKS_PER_S = 20
"""A block holds at most 50 ms, so that nothing waits longer than that for the port."""

Scale = tuple[float, ...]
"""Size of one count: tangential force (N), normal force (N), position (m)."""
_RANGES = ((0.01, 1000.0), (0.01, 1000.0), (1e-3, 10.0))
"""Least and most that a channel may measure: no sensor of a finger on a beam lies outside."""


@dataclass(frozen=True, kw_only=True)
class Samples:
    """The samples of one recording by a board or gauge, none lost and none doubled.

    Attributes:
        rate_hz: samples per second and channel.
        first_s: time of the first sample on the source's own clock, s.
        scale: size of one count of each channel.
        counts: 16 bits, least byte first: all of tangential force, of normal force, of position.
        saturated: samples in which a channel was at its limit.
        clock_offset_s: the host's monotonic clock minus the source's, s; `clock_error_s` at most.
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
    """Return the `sizes` of one count: N, N, m; `ProtocolError` if no such sensor is on a rig."""
    largest = [size * FULL_SCALE for size in sizes]
    # Not strict: that there is a size of each channel is tested beside it.
    within = [low <= value <= high for value, (low, high) in zip(largest, _RANGES, strict=False)]
    if len(sizes) != CHANNELS or not all(within):
        raise ProtocolError(
            "the force channel must measure up to 0.01 to 1000 N, twice, and 0.001 to 10 m, got "
            f"{', '.join(f'{value:g}' for value in largest)}"
        )
    return tuple(sizes)


def most_in_block(rate_hz: float) -> int:
    """Return the most samples that one block may hold.

    >>> most_in_block(1000), most_in_block(50)
    (50, 2)
    """
    return max(int(rate_hz) // BLOCKS_PER_S, 1)


# The content of a block of samples. docs/reference/wire-protocol.md says the same.
#
# Little-endian: number of the first sample, count, flags, device time of the first sample, the
# samples with their channels side by side, and the CRC-32 of everything before it.

SAMPLES_LOST = 1
"""The flag of a block before which samples were lost."""
_HEADER = struct.Struct("<IHHd")
_CRC = struct.Struct("<I")


@dataclass(frozen=True, kw_only=True)
class Block:
    """Consecutive samples; `counts` holds one of each channel, one sample after the other."""

    first: int
    first_s: float
    counts: "array[int]"
    lost: bool = False

    @property
    def count(self) -> int:
        return len(self.counts) // CHANNELS


def encoded(block: Block) -> bytes:
    """Return `block` as bytes, its digest at the end."""
    flags = SAMPLES_LOST if block.lost else 0
    header = _HEADER.pack(block.first, block.count, flags, block.first_s)
    body = header + little_endian(block.counts)
    return body + _CRC.pack(zlib.crc32(body))


def decoded(content: bytes) -> Block:
    """Return the block in `content`; raise `ProtocolError` if it is damaged or contradictory."""
    body, digest = content[: -_CRC.size], content[-_CRC.size :]
    if len(body) < _HEADER.size:
        raise ProtocolError(f"a block of samples must have 20 bytes or more, got {len(content)}")
    # The digest comes before all else: what was changed on its way says nothing about the device.
    if _CRC.unpack(digest)[0] != zlib.crc32(body):
        raise ProtocolError("a block of samples differs from its digest")
    first, count, flags, first_s = _HEADER.unpack_from(body)
    counts = array("h")
    if len(body) != _HEADER.size + CHANNELS * counts.itemsize * count:
        raise ProtocolError(f"a block must hold its {count} samples, got {len(content)} bytes")
    # All other bits are 0 in this protocol: one that is set may mean that the samples are no good.
    if flags & ~SAMPLES_LOST or not math.isfinite(first_s):
        raise ProtocolError(f"a block must have known flags and a time, got {flags}, {first_s}")
    counts.frombytes(body[_HEADER.size :])
    if sys.byteorder == "big":
        counts.byteswap()
    return Block(first=first, first_s=first_s, counts=counts, lost=bool(flags))


def little_endian(counts: "array[int]") -> bytes:
    """Return `counts` as bytes, least byte first."""
    if sys.byteorder == "big":
        counts = counts[:]
        counts.byteswap()
    return counts.tobytes()


SILENT_S = 0.5
"""How long a source that was started may give no samples."""
_CLOCK_REL_TOL = 1e-4
"""How far the rate of a source's samples may be from what was set, by its own clock."""
MISDATED_S = 0.1
"""How far samples may be dated from when they were taken, beyond what the round trips leave open.

It covers a source that starts slowly. Samples further off would put the wrong part of a touch into
the results.
"""
MOST_LATE_S = 0.3
"""How late samples may be fetched before the session waits for them; a source keeps a second."""
MOST_LEFT_S = 5.0
"""More than any source still has when it is stopped."""


class ForceSource(Protocol):
    """A board or gauge that samples forces. Every method raises `DeviceError` if it fails."""

    @property
    def dialect(self) -> str:
        """What the source speaks."""

    def start_sampling(self, rate_hz: float) -> Scale:
        """Set the rate and start; samples are numbered from 0. Return the size of one count."""

    def sampled(self, first: int, checked: Callable[[Block], Block]) -> Block:
        """Ask for the samples from number `first` on; ask once more if `checked` refuses them."""

    def stop_sampling(self) -> None:
        """Stop; what was sampled can still be asked for."""

    def device_time_s(self) -> float:
        """Get the source's own time, s."""


class Recorder:
    """Records what `source` samples from now on; `clock_s` is the session's clock."""

    def __init__(self, source: ForceSource, rate_hz: float, clock_s: Callable[[], float]) -> None:
        self._source = source
        self._rate_hz = rate_hz
        self._clock_s = clock_s
        self._most = most_in_block(rate_hz)
        self._block_s = self._most / rate_hz
        self._channels = [array("h") for _ in range(CHANNELS)]
        self._first_s = 0.0
        self._saturated = 0
        self.latest: Forces | None = None
        """Means of the newest block."""
        # The clock is asked before the start and after the stop: no question delays a block.
        self._offset = asked_offset(source.device_time_s, clock_s)
        self._told_s = clock_s()
        self._scale = source.start_sampling(rate_hz)
        self._began_s = self._heard_s = clock_s()
        self._due_s = self._began_s + self._block_s

    def wait_s(self) -> float:
        """Return how long to wait before asking for the next block; below 0 if that is late."""
        return self._due_s - self._clock_s()

    def is_late(self) -> bool:
        """Return whether the next block is due for so long that the session must wait for it."""
        return self.wait_s() < -MOST_LATE_S

    def fetch(self) -> int:
        """Ask for the next block, return its count; raise `DeviceError` if another one comes."""
        block = self._source.sampled(self.count, self._checked)
        self._add(block, self._clock_s())
        return block.count

    def finished(self) -> Samples:
        """Stop, and return everything up to this moment; raise `DeviceError` as `fetch` does."""
        # Asked before the stop, so that samples that are missing at the end are noticed.
        ended_s = self._source.device_time_s()
        self._source.stop_sampling()
        # A source that went on sampling would give blocks without end.
        left = MOST_LEFT_S * self._rate_hz
        while came := self.fetch():
            left -= came
            if left < 0:
                raise DeviceError("the force channel does not stop")
        self._require_until(ended_s)
        clocks = self._clocks(asked_offset(self._source.device_time_s, self._clock_s))
        return Samples(
            source=self._source.dialect,
            rate_hz=self._rate_hz,
            first_s=self._first_s,
            scale=self._scale,
            counts=b"".join(map(little_endian, self._channels)),
            saturated=self._saturated,
            clock_offset_s=clocks.offset_s,
            clock_error_s=clocks.error_s,
        )

    @property
    def count(self) -> int:
        """The number of samples so far, and so the number of the next one."""
        return len(self._channels[0])

    def _checked(self, block: Block) -> Block:
        """Return `block` if it is the next one.

        Raise `ProtocolError` for samples that were given before, are too many, or have another rate
        or date than they should, and `DeviceError` if samples before it were lost.
        """
        # Not a `ProtocolError`, which would ask again for what the source no longer keeps.
        if block.lost or block.first > self.count:
            raise DeviceError(
                f"samples of the force channel were lost: sample {self.count} is due, got "
                f"{block.first}"
            )
        # The answer to an earlier question, which a line can deliver twice.
        if block.first < self.count:
            raise ProtocolError(
                f"sample {self.count} of the force channel is due, got {block.first} again"
            )
        if block.count > self._most:
            raise ProtocolError(
                f"a block must hold at most {self._most} samples, got {block.count}"
            )
        if block.count and self.count:
            self._require_rate(block)
        elif block.count:
            self._require_begin(block)
        return block

    def _add(self, block: Block, now_s: float) -> None:
        """Add the next block, heard at `now_s`; raise `DeviceError` if none came for `SILENT_S`."""
        if block.count:
            self._heard_s = now_s
            self._keep(block)
        elif now_s > self._heard_s + SILENT_S:
            raise DeviceError(f"the force channel gave no samples for {SILENT_S:g} s")
        # Counted from the beginning, so that late blocks do not add up.
        ready_s = self._began_s + self.count / self._rate_hz + self._block_s
        is_short = 2 * block.count < self._most  # a line of a gauge may hold less than a block
        self._due_s = max(ready_s, now_s + self._block_s / 4) if is_short else ready_s

    def _clocks(self, offset: ClockOffset) -> ClockOffset:
        """Return the offset of the whole recording; `DeviceError` if a clock was set meanwhile."""
        clocks = throughout((self._offset, offset))
        # The error is half of the range, so that clocks may move by twice as much.
        if clocks.error_s > MISDATED_S:
            moved_s = offset.offset_s - self._offset.offset_s
            raise DeviceError(
                f"the clock of the force channel moved by {moved_s:+.3g} s against this computer's "
                f"while it recorded; {MISDATED_S:g} s are allowed"
            )
        return clocks

    def _require_until(self, source_s: float) -> None:
        """Raise `DeviceError` if samples end a block before `source_s`, on the source's clock."""
        end_s = self._first_s + self.count / self._rate_hz
        missing = round((source_s - end_s) * self._rate_hz)
        # Up to a block may lie between the question for the time and the stop.
        if missing > self._most:
            raise DeviceError(f"the last {missing} samples of the force channel were lost")

    def _require_begin(self, block: Block) -> None:
        """Check that the first sample was taken when the source was told to begin."""
        first_s = block.first_s + self._offset.offset_s
        # 0 between the command and its answer: nothing tells when within that time it began.
        off_s = first_s - min(max(first_s, self._told_s), self._began_s)
        if abs(off_s) > MISDATED_S + self._offset.error_s:
            raise ProtocolError(
                f"the first sample of the force channel is dated {off_s:+.3g} s from its time; "
                f"{MISDATED_S:g} s are allowed"
            )

    def _require_rate(self, block: Block) -> None:
        passed_s = self.count / self._rate_hz
        off_s = block.first_s - self._first_s - passed_s
        if abs(off_s) > 1 / self._rate_hz + _CLOCK_REL_TOL * passed_s:
            raise ProtocolError(
                f"sample {block.first} of the force channel is {1e3 * off_s:+.3g} ms from its time"
            )

    def _keep(self, block: Block) -> None:
        if not self.count:
            self._first_s = block.first_s
        parts = [block.counts[channel::CHANNELS] for channel in range(CHANNELS)]
        for channel, part in zip(self._channels, parts, strict=True):
            channel.extend(part)
        # The cheap test first: saturated samples are rare, and counting them takes a loop.
        if max(map(abs, block.counts)) >= FULL_SCALE:
            rows = zip(*parts, strict=True)
            self._saturated += sum(max(map(abs, row)) >= FULL_SCALE for row in rows)
        sizes = zip(parts, self._scale, strict=True)
        means = [sum(part) / len(part) * size for part, size in sizes]
        at_s = block.first_s + block.count / self._rate_hz + self._offset.offset_s
        self.latest = Forces(at_s=at_s, **dict(zip(recordings.CHANNELS, means, strict=True)))
