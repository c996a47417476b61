"""The board's inside: output, amplitude on its slew, watchdog, protection, errors, boot counter.

No clock of its own: device time and wall time are handed in.
"""

from collections import deque
from dataclasses import dataclass, field

MAX_VOLTAGE_V = 200.0
MAX_FREQUENCY_HZ = 100_000.0
MAX_RAMP_V_PER_S = 2_000.0
DEFAULT_RAMP_V_PER_S = 400.0
WATCHDOG_RANGE_S = (0.05, 10.0)
ERROR_QUEUE_LENGTH = 20


@dataclass
class Instrument:
    """The state of the board. `time_s` is the device's own clock."""

    boot: int = 1
    time_s: float = 0.0
    output: bool = False
    target_v: float = 0.0
    voltage_v: float = 0.0
    frequency_hz: float = 1_000.0
    ramp_v_per_s: float = DEFAULT_RAMP_V_PER_S
    limit_v: float = MAX_VOLTAGE_V
    watchdog_s: float | None = None
    tripped: bool = False
    errors: deque[str] = field(default_factory=lambda: deque(maxlen=ERROR_QUEUE_LENGTH))
    _heard_wall_s: float = 0.0

    def advance_to(self, time_s: float) -> None:
        """Let device time pass: the amplitude moves on its slew."""
        step_v = self.ramp_v_per_s * max(time_s - self.time_s, 0.0)
        self.time_s = max(time_s, self.time_s)
        if self.output:
            change_v = self.target_v - self.voltage_v
            self.voltage_v += max(-step_v, min(step_v, change_v))

    def switch(self, on: bool) -> None:
        """Control the output; off is immediate, on starts from 0 V."""
        if on != self.output:
            self.voltage_v = 0.0
        self.output = on

    def hear(self, wall_s: float) -> None:
        """Take note that a command came."""
        self._heard_wall_s = wall_s

    def watch(self, wall_s: float) -> None:
        """Trip if the host was silent for longer than it promised."""
        silent_s = wall_s - self._heard_wall_s
        if self.output and self.watchdog_s is not None and silent_s > self.watchdog_s:
            self.switch(on=False)
            self.tripped = True

    def reset(self) -> None:
        """Go back to what `*RST` gives: off, 0 V, no watchdog; the boot counter stays."""
        self.switch(on=False)
        self.target_v, self.frequency_hz = 0.0, 1_000.0
        self.ramp_v_per_s, self.limit_v = DEFAULT_RAMP_V_PER_S, MAX_VOLTAGE_V
        self.watchdog_s = None
        self.errors.clear()
