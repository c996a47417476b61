"""The rig in a session: one thread owns the port and keeps the device's watchdog quiet.

The watchdog is fed only while the session beats: a hang anywhere turns the output off.
"""

import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, TypeVar

from device.board import Board
from device.errors import DeviceError
from device.link import open_link
from device.records import Identity, Limits, ReadBack, Setpoint
from device.sweep import Resonance, resonance

FEEDS_PER_WATCHDOG = 5

_Result = TypeVar("_Result")


@dataclass(frozen=True, kw_only=True)
class _Job:
    work: Callable[[], Any]
    result: "Future[Any]"


class Rig:
    """A device whose calls are made one after the other by the thread that owns its port."""

    def __init__(self, board: Board, watchdog_s: float) -> None:
        self._board = board
        self._feed_s = watchdog_s / FEEDS_PER_WATCHDOG
        self._jobs: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._beats = 0
        self._fed_beats = 0
        self._driving = False
        self._fault: DeviceError | None = None
        self._owner = threading.Thread(target=self._serve, name="port owner", daemon=True)
        self._owner.start()

    def arm(self) -> Identity:
        """Turn the output off, check who answers, set limits and watchdog.

        Raises:
            DeviceError: the device is not what or as it must be.
        """
        return self._owned(self._board.arm)

    def resonance(self, near_hz: float, sleep: Callable[[float], None]) -> Resonance:
        """Find the beam's resonance near `near_hz`; the output is off afterwards."""

        def settled(seconds: float) -> None:
            self.beat()
            sleep(seconds)

        try:
            return resonance(self.drive, self._vibration_m, settled, near_hz)
        finally:
            self.off()

    def drive(self, setpoint: Setpoint) -> ReadBack:
        """Set `setpoint`, output on, and return what the device says of it."""
        self.beat()
        return self._owned(lambda: self._drive(setpoint))

    def read_back(self) -> ReadBack:
        """Get the drive and the sensors as the device reports them."""
        return self._owned(self._board.read_back)

    def off(self) -> None:
        """Turn the output off and read it back.

        Raises:
            OutputUnknown: the device does not confirm it.
        """
        self._owned(self._off)

    def beat(self) -> None:
        """Say that the session is alive.

        Raises:
            DeviceError: the device failed since the last beat.
        """
        if self._fault is not None:
            raise self._fault
        self._beats += 1

    def close(self) -> None:
        """End the thread and give the port back."""
        self._jobs.put(None)
        self._owner.join()
        self._board.close()

    def _vibration_m(self) -> float:
        return self._owned(self._board.vibration_m)

    def _drive(self, setpoint: Setpoint) -> ReadBack:
        read_back = self._board.drive(setpoint)
        self._driving = True
        return read_back

    def _off(self) -> None:
        self._driving = False
        self._board.off()

    def _owned(self, work: Callable[[], _Result]) -> _Result:
        result: Future[_Result] = Future()
        self._jobs.put(_Job(work=work, result=result))
        return result.result()

    def _serve(self) -> None:
        while True:
            try:
                job = self._jobs.get(timeout=self._feed_s)
            except queue.Empty:
                self._feed()
                continue
            if job is None:
                return
            _settle(job)

    def _feed(self) -> None:
        """See that the output is still on, which feeds the watchdog, if the session has moved."""
        if not self._driving or self._fault or self._beats == self._fed_beats:
            return
        self._fed_beats = self._beats
        try:
            if not self._board.output():
                self._fault = DeviceError("the device turned its output off by itself")
        except DeviceError as error:
            self._fault = error


def _settle(job: _Job) -> None:
    try:
        job.result.set_result(job.work())
    except Exception as error:
        job.result.set_exception(error)


def open_rig(url: str, limits: Limits) -> Rig:
    """Return the rig at `url`, not armed yet.

    Raises:
        AddressError: `url` is no address of a device.
        DeviceError: nothing can be opened there.
    """
    return Rig(Board(open_link(url), limits), limits.watchdog_s)
