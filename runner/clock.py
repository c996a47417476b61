"""The two paces of a session: a person's, and as fast as the machine can."""

import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Protocol


class WallClock:
    """Real time."""

    def utc(self) -> datetime:
        """Return the date and time, UTC."""
        return datetime.now(UTC)

    def monotonic_s(self) -> float:
        """Return seconds since some moment."""
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Wait."""
        time.sleep(seconds)


class SteppedClock:
    """Time that passes only when somebody sleeps; `advance` takes the simulated device along."""

    def __init__(self, start: datetime, advance: Callable[[float], None]) -> None:
        self._start = start
        self._advance = advance
        self._passed_s = 0.0

    def utc(self) -> datetime:
        """Return the date and time, UTC, as stepped."""
        return self._start + timedelta(seconds=self._passed_s)

    def monotonic_s(self) -> float:
        """Return the seconds stepped so far."""
        return self._passed_s

    def sleep(self, seconds: float) -> None:
        """Let `seconds` pass at once, here and in the device."""
        self._advance(seconds)
        self._passed_s += seconds


class Clock(Protocol):
    """Time as the session sees it."""

    def utc(self) -> datetime:
        """Return the date and time, UTC."""
        ...

    def monotonic_s(self) -> float:
        """Return seconds that never run backwards."""
        ...

    def sleep(self, seconds: float) -> None:
        """Let time pass."""
        ...
