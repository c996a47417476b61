"""The two clocks of a session: wall time, and stepped time as fast as the machine allows."""

import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Literal, Protocol

Pace = Literal["wall", "stepped"]


class WallClock:
    """Real time."""

    def utc(self) -> datetime:
        """Return the date and time, UTC."""
        return datetime.now(UTC)

    def monotonic_s(self) -> float:
        """Return seconds since an arbitrary moment."""
        # Not the time of day, which the system may set back or forth in the middle of a touch.
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Wait."""
        time.sleep(seconds)


class SteppedClock:
    """Time that passes only by `sleep`; `advance` lets it pass in the simulated device as well."""

    def __init__(self, start: datetime, advance: Callable[[float], None]) -> None:
        self._start = start
        self._advance = advance
        self._passed_s = 0.0

    def utc(self) -> datetime:
        """Return the stepped date and time, UTC."""
        return self._start + timedelta(seconds=self._passed_s)

    def monotonic_s(self) -> float:
        """Return the seconds stepped so far."""
        return self._passed_s

    def sleep(self, seconds: float) -> None:
        """Advance this clock and the device by `seconds` without waiting."""
        self._advance(seconds)
        self._passed_s += seconds


class Clock(Protocol):
    """The session's clock."""

    def utc(self) -> datetime:
        """Return the date and time, UTC."""
        ...

    def monotonic_s(self) -> float:
        """Return a time in seconds that never decreases."""
        ...

    def sleep(self, seconds: float) -> None:
        """Wait for `seconds` of this clock's time."""
        ...
