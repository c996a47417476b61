"""The owner of a gauge's port: it has a thread of its own, so that a slow one delays no stop."""

import re
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cache
from typing import ClassVar, TypeVar

from device.drivers.driver import defined_in
from device.errors import DeviceError
from device.force_channel.recording import Forces, ForceSource, Recorder, Samples
from device.link.link import Link, Register, open_link
from device.port_owner import PortOwner
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


_LOOK_S = 0.02
_Result = TypeVar("_Result")


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
            self._recording = Recorder(self._gauge, rate_hz, clock_s)

        self._owned(record)

    def recorded(self) -> Samples:
        return self._owned(self._recorded)

    def abandon(self) -> None:
        """Discard the recording; the gauge is not told."""
        self._recording = None

    def keep_up(self) -> None:
        """Wait for the owner until samples are not fetched too late."""
        while (recording := self._recording) is not None and recording.is_late():
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
