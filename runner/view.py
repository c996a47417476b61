"""What the operator sees of a session at a glance."""

from dataclasses import dataclass

from device.errors import UNKNOWN
from device.records import ReadBack


@dataclass(frozen=True, kw_only=True)
class View:
    """Where the session stands and what the device really does, as it was last read back.

    Without a `device` the output was read back as off, unless it is `unknown` or the session is
    idle: then nobody has asked yet.
    """

    session: str
    kind: str
    state: str
    trial: str
    next_trial: str
    done: int
    total: int
    left_s: float
    device: ReadBack | None
    searching: bool
    watchdog_s: float
    last_answer: str
    warning: str
    unknown: bool = False

    def progress(self) -> str:
        """Return how far the session is, such as `3 of 7 trials, about 2 min left`."""
        return f"{self.done} of {self.total} trials, about {max(self.left_s, 0) / 60:.0f} min left"

    def output(self) -> str:
        """Return what is on the device, in words."""
        if self.unknown:
            return UNKNOWN.removeprefix("output ")
        if self.searching:
            return "ON, 10 V at most, searching"
        if self.device is None and self.state == "idle":
            return "not known yet"
        if self.device is None or not self.device.output:
            return "off"
        device = self.device
        return f"ON {device.voltage_v:.0f} V {device.frequency_hz:.0f} Hz" + (
            "" if device.monitor_v is None else f" (monitor {device.monitor_v:.0f} V)"
        )
