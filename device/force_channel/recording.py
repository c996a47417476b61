"""A recording in progress: what its source must do, and its start, its blocks and its end."""

from collections.abc import Callable
from typing import Protocol

from device.errors import DeviceError
from device.force_channel.blocks import Block
from device.force_channel.clocks import asked_offset
from device.force_channel.recorder import Recorder
from device.force_channel.samples import Forces, Samples, Scale

MOST_LEFT_S = 5.0
"""More than any source still has when it is stopped."""


class ForceSource(Protocol):
    """A board or gauge that samples forces. Every method raises `DeviceError` if it fails."""

    @property
    def dialect(self) -> str:
        """What the source speaks."""
        ...

    def start_sampling(self, rate_hz: float) -> Scale:
        """Set the rate and start; samples are numbered from 0. Return the size of one count."""
        ...

    def sampled(self, first: int, checked: Callable[[Block], Block]) -> Block:
        """Ask for the samples from number `first` on; ask once more if `checked` refuses them."""
        ...

    def stop_sampling(self) -> None:
        """Stop; what was sampled can still be asked for."""
        ...

    def device_time_s(self) -> float:
        """Get the source's own time, s."""
        ...


class Recording:
    """The recording that `source` makes from now on; `clock_s` is the session's clock."""

    def __init__(self, source: ForceSource, rate_hz: float, clock_s: Callable[[], float]) -> None:
        self._source = source
        self._clock_s = clock_s
        offset = asked_offset(source.device_time_s, clock_s)
        told_s = clock_s()
        scale = source.start_sampling(rate_hz)
        self._recorder = Recorder(
            source=source.dialect,
            rate_hz=rate_hz,
            scale=scale,
            offset=offset,
            told_s=told_s,
            began_s=clock_s(),
        )

    @property
    def latest(self) -> Forces | None:
        """Means of the newest block, None before the first."""
        return self._recorder.latest

    def wait_s(self) -> float:
        """Return how long to wait before asking for the next block; below 0 if that is late."""
        return self._recorder.due_s - self._clock_s()

    def fetch(self) -> int:
        """Ask for the next block; return how many samples came.

        Raises:
            DeviceError: samples were lost, or the source does not answer with what is due.
        """
        block = self._source.sampled(self._recorder.count, self._recorder.checked)
        self._recorder.add(block, self._clock_s())
        return block.count

    def finished(self) -> Samples:
        """Stop, and return everything up to this moment.

        Raises:
            DeviceError: as `fetch`, the source does not stop, or a clock was set meanwhile.
        """
        ended_s = self._source.device_time_s()
        self._source.stop_sampling()
        left = MOST_LEFT_S * self._recorder.rate_hz
        while came := self.fetch():
            left -= came
            if left < 0:
                raise DeviceError("the force channel does not stop")
        self._recorder.require_until(ended_s)
        return self._recorder.samples(asked_offset(self._source.device_time_s, self._clock_s))
