"""An instrument's error queue and status registers (IEEE 488.2-1992, chapter 11)."""

from collections import deque
from dataclasses import dataclass, field

from device.simulator.values import ScpiError

QUEUE_LENGTH = 20
POWER_ON = 128
OPERATION_COMPLETE = 1
_EVENT_BITS = {1: 32, 2: 16, 3: 8, 4: 4}
"""Hundreds of an error's code → its bit in the standard event register."""


@dataclass
class Status:
    """Errors wait until they are asked for; events until the register is read."""

    errors: deque[tuple[int, str]] = field(default_factory=deque)
    events: int = POWER_ON
    enabled_events: int = 0
    enabled_requests: int = 0
    always: tuple[int, str] | None = None
    """An error that every look at the queue finds: a queue without end."""

    def complain(self, error: ScpiError) -> None:
        """Put `error` into the queue; a full one ends in -350, as SCPI asks."""
        self.events |= _EVENT_BITS.get(abs(error.code) // 100, 8)
        if len(self.errors) < QUEUE_LENGTH:
            self.errors.append((error.code, error.text))
        else:
            self.errors[-1] = (-350, "Queue overflow")

    def next_error(self) -> tuple[int, str]:
        """Take the oldest error out of the queue."""
        if self.always is not None:
            return self.always
        return self.errors.popleft() if self.errors else (0, "No error")

    def taken_events(self) -> int:
        """Return the standard event register, and clear it."""
        events, self.events = self.events, 0
        return events

    def byte(self) -> int:
        """Return the status byte."""
        errors = 4 if self.errors else 0
        events = 32 if self.events & self.enabled_events else 0
        request = 64 if (errors | events) & self.enabled_requests else 0
        return errors | events | request

    def clear(self) -> None:
        """Forget errors and events."""
        self.errors.clear()
        self.events = 0

    def power_on(self) -> None:
        """Begin anew: nothing of before is known."""
        self.clear()
        self.events = POWER_ON
        self.enabled_events = self.enabled_requests = 0

    def complete(self) -> None:
        """Note that what was asked for is done: at once, here."""
        self.events |= OPERATION_COMPLETE
