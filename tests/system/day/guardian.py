"""The guardian of a laboratory's generator: what a process of its own does, on simulated time."""

from contextlib import suppress

from device.guardian import Guardian
from device.simulator.in_process import InProcessDevice, InProcessPort


class LabGuardian(Guardian):
    """Shares the port of a process that may die or stand still, and outlives it."""

    def __init__(self, device: InProcessDevice, port: InProcessPort, off: bytes, limit_s: float):
        super().__init__(-1, off, limit_s)
        self._now_s = device.now_s
        self._port = port
        self._on, self._last_s, self._tripped = False, 0.0, False

    def start(self) -> None:
        pass

    def hears(self, at_s: float, *, on: bool) -> None:
        self._require_beat(at_s)
        self._on, self._last_s = on, at_s

    def has_tripped(self) -> bool:
        tripped, self._tripped = self._tripped, False
        return tripped

    def look(self) -> None:
        """See whether the program was silent for too long."""
        self._require_beat(self._now_s())

    def close(self) -> None:
        """The program is gone, or has turned the output off before."""
        if self._on:
            self._send_off()
            self._on = False

    def _require_beat(self, at_s: float) -> None:
        if self._on and at_s - self._last_s > self._limit_s:
            self._last_s, self._tripped = at_s, True
            self._send_off()

    def _send_off(self) -> None:
        with suppress(OSError):  # the port has vanished
            self._port.send(self._off)
