"""The two clocks of a session: wall time, and stepped time as fast as the machine allows."""

import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Literal, Protocol

Pace = Literal["wall", "stepped"]


class WallClock:
    """Real time."""

    def utc(self) -> datetime:
        return datetime.now(UTC)

    def monotonic_s(self) -> float:
        # Not the time of day, which the system may set back or forth in the middle of a touch.
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        time.sleep(seconds)


class SteppedClock:
    """Time that passes only by `sleep`; `advance` lets it pass in the simulated device as well.

    With the device's own time `device_s` it passes during a step, too: samples of forces that are
    fetched meanwhile are due by this clock.
    """

    def __init__(
        self,
        start: datetime,
        advance: Callable[[float], None],
        device_s: Callable[[], float] = lambda: 0.0,
    ) -> None:
        self._start = start
        self._advance = advance
        self._device_s = device_s
        self._passed_s = 0.0
        self._step = (0.0, 0.0)
        """The step that is being made: when it began on the device's time, and its length, s."""

    def utc(self) -> datetime:
        return self._start + timedelta(seconds=self.monotonic_s())

    def monotonic_s(self) -> float:
        began_s, seconds = self._step
        return self._passed_s + (min(self._device_s() - began_s, seconds) if seconds else 0.0)

    def sleep(self, seconds: float) -> None:
        """Advance this clock and the device by `seconds` without waiting."""
        over_s = self._passed_s + seconds
        self._step = (self._device_s(), seconds)
        try:
            self._advance(seconds)
        except BaseException:
            over_s = self.monotonic_s()  # broken off; time never goes back
            raise
        finally:
            self._step, self._passed_s = (0.0, 0.0), over_s


class Clock(Protocol):
    """The session's clock."""

    def utc(self) -> datetime:
        """Return the date and time, UTC."""

    def monotonic_s(self) -> float:
        """Return a time in seconds that never decreases."""

    def sleep(self, seconds: float) -> None:
        """Wait for `seconds` of this clock's time."""
