"""Frame intervals while a screen stood, and which frames came late."""

from dataclasses import dataclass, field
from itertools import pairwise
from statistics import median
from typing import Any

LATE = 1.5
"""A frame counts as dropped when its interval is longer than this many refresh intervals."""


@dataclass
class FrameTimes:
    """When each frame of one screen was shown, seconds on the session's monotonic clock."""

    interval_s: float
    shown_s: list[float] = field(default_factory=list, init=False)

    def add(self, t_s: float) -> None:
        """Take note of a frame."""
        self.shown_s.append(t_s)

    def record(self) -> dict[str, Any]:
        """Return the intervals' statistics in milliseconds and each dropped frame, for the journal.

        A dropped frame is given as its time since the first frame, s, and its interval, ms.
        """
        intervals = [later - earlier for earlier, later in pairwise(self.shown_s)]
        dropped = [
            [round(end - self.shown_s[0], 4), round(interval * 1000, 2)]
            for end, interval in zip(self.shown_s[1:], intervals, strict=True)
            if interval > LATE * self.interval_s
        ]
        return {"frames": len(self.shown_s), "dropped": dropped, **_statistics(intervals)}


def _statistics(intervals: list[float]) -> dict[str, float]:
    if not intervals:
        return {}
    ordered = sorted(intervals)
    p99 = ordered[min(int(0.99 * len(ordered)), len(ordered) - 1)]
    milliseconds = {"median_ms": median(ordered), "p99_ms": p99, "max_ms": ordered[-1]}
    return {name: round(value * 1000, 2) for name, value in milliseconds.items()}
