"""The clock of a session in one thread with a simulated device and its rig."""

from datetime import datetime, timedelta

from device.rig import Rig
from device.simulator.in_process import InProcessDevice, InProcessHand


class InProcessClock:
    """The clock of a session in one thread; while it sleeps, the owner of the port works."""

    def __init__(self, start: datetime, device: InProcessDevice, rig: Rig) -> None:
        self._start = start
        self._device = device
        self._rig = rig

    def utc(self) -> datetime:
        """Return the date and time, UTC, from `start` at the device's beginning."""
        return self._start + timedelta(seconds=self._device.now_s())

    def monotonic_s(self) -> float:
        return self._device.now_s()

    def sleep(self, seconds: float) -> None:
        InProcessHand(self._device, self._rig).pass_time(seconds)
