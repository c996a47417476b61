"""A recording while it grows: blocks in their order, at their rate, none lost and none doubled."""

from array import array
from dataclasses import dataclass, field

from device.errors import DeviceError, ProtocolError
from device.force_channel.blocks import Block, little_endian
from device.force_channel.clocks import ClockOffset, throughout
from device.force_channel.samples import (
    CHANNELS,
    FULL_SCALE,
    Forces,
    Samples,
    Scale,
    most_in_block,
)

SILENT_S = 0.5
"""How long a source that was started may give no samples."""
_CLOCK_REL_TOL = 1e-4
"""How far the rate of a source's samples may be from what was set, by its own clock."""
MISDATED_S = 0.1
"""How far samples may be dated from when they were taken, beyond what the round trips leave open.

It covers a source that starts slowly. Samples further off would put the wrong part of a touch into
the results.
"""


@dataclass
class Recorder:
    """The samples of one recording so far.

    Attributes:
        source: what measures: `board`, or the dialect of the gauge.
        rate_hz: samples per second and channel, as set.
        scale: size of one count of each channel.
        offset: the host's clock minus the source's, when the recording began.
        told_s: when the source was told to begin, on the host's clock.
        began_s: when it had confirmed that, on the host's clock.
    """

    source: str
    rate_hz: float
    scale: Scale
    offset: ClockOffset
    told_s: float
    began_s: float
    latest: Forces | None = None
    """Means of the newest block."""
    _channels: tuple["array[int]", ...] = field(
        default_factory=lambda: tuple(array("h") for _ in range(CHANNELS))
    )
    _first_s: float = 0.0
    _saturated: int = 0
    _heard_s: float = field(init=False)
    due_s: float = field(init=False)
    """When to ask for the next block, on the host's clock: once a whole one should be ready."""

    def __post_init__(self) -> None:
        self._heard_s = self.began_s
        self.due_s = self.began_s + self._block_s

    @property
    def count(self) -> int:
        """The number of samples so far, and so the number of the next one."""
        return len(self._channels[0])

    @property
    def _most(self) -> int:
        return most_in_block(self.rate_hz)

    @property
    def _block_s(self) -> float:
        return self._most / self.rate_hz

    def checked(self, block: Block) -> Block:
        """Return `block` if it is the next one.

        Raises:
            ProtocolError: its samples were given before, are too many, have another rate, or are
                not dated at the time at which they were taken.
            DeviceError: samples before it were lost.
        """
        if block.lost or block.first > self.count:
            raise DeviceError(
                f"samples of the force channel were lost: sample {self.count} is due, got "
                f"{block.first}"
            )
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

    def add(self, block: Block, now_s: float) -> None:
        """Add a block that is the next one, heard at `now_s` on the host's clock.

        Raises:
            DeviceError: the source has given no samples for `SILENT_S`.
        """
        if block.count:
            self._heard_s = now_s
            self._keep(block)
        elif now_s > self._heard_s + SILENT_S:
            raise DeviceError(f"the force channel gave no samples for {SILENT_S:g} s")
        ready_s = self.began_s + self.count / self.rate_hz + self._block_s
        is_short = 2 * block.count < self._most  # a line of a gauge may hold less than a block
        self.due_s = max(ready_s, now_s + self._block_s / 4) if is_short else ready_s

    def samples(self, offset: ClockOffset) -> Samples:
        """Return the recording; `offset` is that of the clocks at its end.

        Raises:
            DeviceError: one of the clocks was set or stood still since the beginning.
        """
        clocks = throughout((self.offset, offset))
        if clocks.error_s > MISDATED_S:
            raise DeviceError(
                "the clock of the force channel moved by "
                f"{offset.offset_s - self.offset.offset_s:+.3g} s against this computer's while it "
                f"recorded; {MISDATED_S:g} s are allowed"
            )
        return Samples(
            source=self.source,
            rate_hz=self.rate_hz,
            first_s=self._first_s,
            scale=self.scale,
            counts=b"".join(map(little_endian, self._channels)),
            saturated=self._saturated,
            clock_offset_s=clocks.offset_s,
            clock_error_s=clocks.error_s,
        )

    def require_until(self, source_s: float) -> None:
        """See that the samples reach to `source_s` on the source's clock.

        Raises:
            DeviceError: they end a block or more before it.
        """
        end_s = self._first_s + self.count / self.rate_hz
        missing = round((source_s - end_s) * self.rate_hz)
        if missing > self._most:
            raise DeviceError(f"the last {missing} samples of the force channel were lost")

    def _require_begin(self, block: Block) -> None:
        """See that the first sample was taken once the source was told to begin, and not later."""
        first_s = block.first_s + self.offset.offset_s
        off_s = first_s - min(max(first_s, self.told_s), self.began_s)
        if abs(off_s) > MISDATED_S + self.offset.error_s:
            raise ProtocolError(
                f"the first sample of the force channel is dated {off_s:+.3g} s from its time; "
                f"{MISDATED_S:g} s are allowed"
            )

    def _require_rate(self, block: Block) -> None:
        passed_s = self.count / self.rate_hz
        off_s = block.first_s - self._first_s - passed_s
        if abs(off_s) > 1 / self.rate_hz + _CLOCK_REL_TOL * passed_s:
            raise ProtocolError(
                f"sample {block.first} of the force channel is {1e3 * off_s:+.3g} ms from its time"
            )

    def _keep(self, block: Block) -> None:
        if not self.count:
            self._first_s = block.first_s
        parts = [block.counts[channel::CHANNELS] for channel in range(CHANNELS)]
        for channel, part in zip(self._channels, parts, strict=True):
            channel.extend(part)
        if max(map(abs, block.counts)) >= FULL_SCALE:
            rows = zip(*parts, strict=True)
            self._saturated += sum(max(map(abs, row)) >= FULL_SCALE for row in rows)
        self.latest = self._means(block, parts)

    def _means(self, block: Block, parts: list["array[int]"]) -> Forces:
        means = [sum(part) / len(part) * size for part, size in zip(parts, self.scale, strict=True)]
        end_s = block.first_s + block.count / self.rate_hz
        return Forces(
            at_s=end_s + self.offset.offset_s,
            tangential_n=means[0],
            normal_n=means[1],
            position_m=means[2],
        )
