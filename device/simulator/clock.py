"""The simulated device's clock: runs with the wall until it is stepped, then only when stepped."""

from collections.abc import Callable


class DeviceClock:
    """Seconds since the device started."""

    def __init__(self, wall_s: Callable[[], float]) -> None:
        self._wall_s = wall_s
        self._started_s = wall_s()
        self._stepped_s: float | None = None

    def now_s(self) -> float:
        """Return the device's time."""
        if self._stepped_s is not None:
            return self._stepped_s
        return self._wall_s() - self._started_s

    def step(self, seconds: float) -> None:
        """Let `seconds` pass at once; from the first step on no other time passes."""
        if not 0 <= seconds < float("inf"):
            raise ValueError(f"a step must be 0 s or more, got {seconds}")
        self._stepped_s = self.now_s() + seconds
