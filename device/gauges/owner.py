"""Owners of ports: a gauge has a thread of its own, so that a slow one delays no stop."""

import contextlib
import queue
import re
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from functools import cache
from typing import Any, ClassVar, TypeVar

from device.drivers.driver import defined_in
from device.errors import DeviceError
from device.force_channel.recording import Forces, ForceSource, Recording, Samples
from device.link.link import Link, Register, open_link
from protocol.address import AddressError

# What a gauge's driver is: a source of samples behind a link of its own.


class GaugeDriver(ForceSource, ABC):
    """Samples forces over `link`. Not thread-safe: one owner."""

    dialect: ClassVar[str]
    idn: ClassVar["re.Pattern[str]"]
    """The pattern of these gauges' answer to `*IDN?`."""
    expected: ClassVar[str]
    """These gauges in words, for messages."""
    register: ClassVar[Register]

    def __init__(self, link: Link) -> None:
        link.register = self.register
        self.link = link

    def meet(self) -> str:
        """Return the identity; `DeviceError`, with nothing set, for another device or unit."""
        idn = self.link.identify()
        if self.idn.match(idn) is None:
            raise DeviceError(f"expected {self.expected}, got {idn!r}")
        self.link.synchronise()
        self._require_unit()
        return idn

    @abstractmethod
    def _require_unit(self) -> None:
        """Check that forces are in newtons; raise `DeviceError` if they are in something else."""

    def close(self) -> None:
        self.link.close()


# A source keeps the samples of the last second at least.
MOST_LATE_S = 0.3
"""How late samples may be fetched before the session waits for them."""
_LOOK_S = 0.02
_Result = TypeVar("_Result")


@dataclass(frozen=True, kw_only=True)
class Job:
    """A call to make, and its result."""

    work: Callable[[], Any]
    result: "Future[Any]" = field(default_factory=Future)

    def settle(self) -> None:
        """Make the call; an error is its result, too."""
        try:
            self.result.set_result(self.work())
        except Exception as error:
            self.result.set_exception(error)


class PortOwner(ABC):
    """Makes the calls to a port one by one: in a thread once it has one, else in the caller's."""

    unbroken: Callable[[], AbstractContextManager[None]] = nullcontext
    """Surrounds each step: where the caller works, no signal may leave half a command behind."""

    def __init__(self) -> None:
        self._jobs: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._owner: threading.Thread | None = None
        self._recording: Recording | None = None
        self._fault: DeviceError | None = None

    def step(self, wait_s: float | None = 0.0) -> bool:
        """As the owner, make the next call within `wait_s` and what is due; False once closed."""
        with self.unbroken():
            with contextlib.suppress(queue.Empty):
                job = self._jobs.get(timeout=wait_s)
                if job is None:
                    return False
                self._make(job)
            self._go_on()
        return True

    @abstractmethod
    def idle_s(self) -> float | None:
        """Return how long the owner may wait for a call; None if only a call gives it work."""

    @abstractmethod
    def _go_on(self) -> None:
        """Do what is due; no error may leave it."""

    def _make(self, job: Job) -> None:
        job.settle()

    def _begin(self, name: str) -> None:
        # A daemon, so that a device that hangs does not keep the program from ending.
        self._owner = threading.Thread(target=self._serve, name=name, daemon=True)
        self._owner.start()

    def _serve(self) -> None:
        while self.step(self.idle_s()):
            pass

    def _put(self, work: Callable[[], _Result]) -> "Future[_Result]":
        job = Job(work=work)
        self._jobs.put(job)
        # Without a thread, as on a stepped clock, the caller does the owner's work.
        if self._owner is None:
            self.step()
        return job.result

    def _recorded(self) -> Samples:
        if self._recording is None:
            # The fault that ended the recording says more.
            raise self._fault or DeviceError("nothing is recorded")
        try:
            return self._recording.finished()
        finally:
            self._recording = None

    def _end(self) -> None:
        self._jobs.put(None)
        if self._owner is not None:
            self._owner.join()


class GaugeOwner(PortOwner):
    """A gauge whose calls are made one by one, from any thread; its errors begin with `gauge: `."""

    def __init__(self, gauge: GaugeDriver) -> None:
        super().__init__()
        self._gauge = gauge
        self._on_fault: Callable[[], object] = lambda: None

    def start(self, on_fault: Callable[[], object]) -> None:
        """Give the port to a thread of its own, which calls `on_fault` when the gauge fails."""
        self._on_fault = on_fault
        self._begin("gauge owner")

    @property
    def latest(self) -> Forces | None:
        recording = self._recording
        return None if recording is None else recording.latest

    def meet(self) -> str:
        """Forget a fault, return the identity; raise `DeviceError` for another device or unit."""
        self._recording = self._fault = None
        return self._owned(self._gauge.meet)

    def record(self, rate_hz: float, clock_s: Callable[[], float]) -> None:

        def record() -> None:
            self._recording = Recording(self._gauge, rate_hz, clock_s)

        self._owned(record)

    def recorded(self) -> Samples:
        return self._owned(self._recorded)

    def abandon(self) -> None:
        """Discard the recording; the gauge is not told."""
        self._recording = None

    def keep_up(self) -> None:
        """Wait for the owner until samples are not fetched too late."""
        while (recording := self._recording) is not None and recording.wait_s() < -MOST_LATE_S:
            self._owned(lambda: None)

    def require_sound(self) -> None:
        if self._fault is not None:
            raise self._fault

    def close(self) -> None:
        self._end()
        self._gauge.close()

    def _owned(self, work: Callable[[], _Result]) -> _Result:
        given = self._put(work)
        # Asked for and not caught: a stop that comes while we wait is no error of the gauge.
        if isinstance(error := given.exception(), Exception):
            raise _of_gauge(error) from error
        return given.result()

    # What follows is the owner's work.

    def idle_s(self) -> float:
        recording = self._recording
        # Looked at often, because another thread may begin or abandon a recording.
        return _LOOK_S if recording is None else min(max(recording.wait_s(), 0.0), _LOOK_S)

    def _go_on(self) -> None:
        """Ask for the block that is due, if there is one; a gauge that fails is asked no more."""
        try:
            if (recording := self._recording) is not None and recording.wait_s() <= 0:
                recording.fetch()
        except Exception as error:
            # Any error, not only the device's: this thread must not die unnoticed.
            self._recording, self._fault = None, _of_gauge(error)
            self._on_fault()


def _of_gauge(error: Exception) -> DeviceError:
    if not isinstance(error, DeviceError):
        return DeviceError(f"gauge: {type(error).__name__}: {error}")
    said = str(error)
    return error if said.startswith("gauge: ") else DeviceError(f"gauge: {said}")


# The gauges, one dialect a file. A module here that defines `GAUGE` is found by being here.


@cache
def gauges() -> dict[str, type[GaugeDriver]]:
    """Return the drivers of gauges by dialect."""
    return {driver.dialect: driver for driver in defined_in("device.gauges", "GAUGE")}


def open_gauge(url: str, dialect: str) -> GaugeOwner:
    """Return the gauge at `url`; a rig that is armed asks who it is.

    Raise `AddressError` for no such address or dialect, `DeviceError` if it cannot be opened.
    """
    if dialect not in gauges():
        known = ", ".join(gauges())
        raise AddressError(f"the dialect of a gauge must be one of {known}, got {dialect!r}")
    return GaugeOwner(gauges()[dialect](open_link(url)))
