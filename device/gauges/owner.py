"""The owner of a gauge's port: a thread of its own, so that a slow gauge delays no stop."""

import contextlib
import queue
import re
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from functools import cache
from typing import Any, ClassVar, TypeVar

from device.drivers.driver import defined_in
from device.errors import DeviceError
from device.force_channel.recording import Block, Forces, Recording, Samples, Scale
from device.link.link import Link, Register, open_link
from protocol.address import AddressError

# What a gauge's driver is: a source of samples behind a link of its own.


class GaugeDriver(ABC):
    """Samples forces over `link`. Not thread-safe: one owner."""

    dialect: ClassVar[str]
    idn: ClassVar["re.Pattern[str]"]
    """The pattern of these gauges' answer to `*IDN?`."""
    expected: ClassVar[str]
    """These gauges in words, for messages."""
    register: ClassVar[Register]
    """The register by which the link gets into step."""

    def __init__(self, link: Link) -> None:
        link.register = self.register
        self.link = link

    def meet(self) -> str:
        """Check that the expected gauge answers, in the expected unit; return its identity.

        Raise `DeviceError` if something else does; nothing was set.
        """
        idn = self.link.identify()
        if self.idn.match(idn) is None:
            raise DeviceError(f"expected {self.expected}, got {idn!r}")
        self.link.synchronise()
        self._require_unit()
        return idn

    @abstractmethod
    def _require_unit(self) -> None:
        """Check that forces are in newtons; raise `DeviceError` if they are in something else."""

    @abstractmethod
    def start_sampling(self, rate_hz: float) -> Scale:
        """Set the rate and start; samples are numbered from 0. Return the size of one count."""

    @abstractmethod
    def sampled(self, first: int, checked: Callable[[Block], Block]) -> Block:
        """Ask for the samples from number `first` on; ask once more if `checked` refuses them."""

    @abstractmethod
    def stop_sampling(self) -> None:
        """Stop; what was sampled can still be asked for."""

    @abstractmethod
    def device_time_s(self) -> float:
        """Get the gauge's own time, s."""

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


class GaugeOwner:
    """A gauge whose calls are made one after the other. Its methods may be called from any thread.

    An error of the gauge begins with `gauge: `.
    """

    def __init__(self, gauge: GaugeDriver) -> None:
        self._gauge = gauge
        self._jobs: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._recording: Recording | None = None
        self._fault: DeviceError | None = None
        self._on_fault: Callable[[], object] = lambda: None
        self._thread: threading.Thread | None = None

    def start(self, on_fault: Callable[[], object]) -> None:
        """Give the port to a thread of its own, which calls `on_fault` when the gauge fails."""
        self._on_fault = on_fault
        # A daemon, so that a gauge that hangs does not keep the program from ending.
        self._thread = threading.Thread(target=self._serve, name="gauge owner", daemon=True)
        self._thread.start()

    @property
    def latest(self) -> Forces | None:
        recording = self._recording
        return None if recording is None else recording.latest

    def meet(self) -> str:
        """Identify the gauge and forget a fault; return its identity.

        Raise `DeviceError` if it is another device, or measures in another unit.
        """
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
        self._jobs.put(None)
        if self._thread is not None:
            self._thread.join()
        self._gauge.close()

    def step(self, wait_s: float = 0.0) -> bool:
        """Make the next call, if one comes within `wait_s`, and fetch what is due; for the owner.

        Returns False once the gauge is closed.
        """
        with contextlib.suppress(queue.Empty):
            job = self._jobs.get(timeout=wait_s)
            if job is None:
                return False
            job.settle()
        self._fetch()
        return True

    def _owned(self, work: Callable[[], _Result]) -> _Result:
        job = Job(work=work)
        self._jobs.put(job)
        # Without a thread, as on a stepped clock, the caller does the owner's work.
        if self._thread is None:
            self.step()
        # Asked for and not caught: a stop that comes while we wait is no error of the gauge.
        if isinstance(error := job.result.exception(), Exception):
            raise _of_gauge(error) from error
        result: _Result = job.result.result()
        return result

    # What follows is the owner's work.

    def _serve(self) -> None:
        while self.step(self._wait_s()):
            pass

    def _wait_s(self) -> float:
        recording = self._recording
        # Looked at often, because another thread may begin or abandon a recording.
        return _LOOK_S if recording is None else min(max(recording.wait_s(), 0.0), _LOOK_S)

    def _recorded(self) -> Samples:
        if self._recording is None:
            # The fault that ended the recording says more.
            raise self._fault or DeviceError("nothing is recorded")
        try:
            return self._recording.finished()
        finally:
            self._recording = None

    def _fetch(self) -> None:
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

    Raises:
        AddressError: `url` is no address of a gauge, or there is no such dialect.
        DeviceError: nothing can be opened there.
    """
    if dialect not in gauges():
        known = ", ".join(gauges())
        raise AddressError(f"the dialect of a gauge must be one of {known}, got {dialect!r}")
    return GaugeOwner(gauges()[dialect](open_link(url)))
