"""The interface of all drivers, and what they have in common.

Set, wait until it is done, drain the error queue, read back: the read-back is the contract.
A new dialect is one new file in `device/drivers`.
"""

import math
import re
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import Any, ClassVar

from device.drivers.limits import Limits, Setpoint
from device.drivers.pace import Pace
from device.errors import (
    CannotRecord,
    DeviceError,
    ForeignDevice,
    ForeignOutput,
    LinkTimeout,
    OutputLastOff,
    OutputUnknown,
)
from device.force_channel.recording import ForceSource
from device.link.codec import number, number_text, queued_error, switch
from device.link.link import ANSWER_TIMEOUT_S, EVENT_ENABLE, HANDSHAKE_S, Link, Register
from protocol.address import AddressError
from protocol.errors import page
from protocol.journal.records import Identity, ReadBack

# A board's queue has room for 20 errors: more than 32 is a queue that fills as it is read.
MOST_QUEUED_ERRORS = 32
"""An error queue that is longer than this does not end."""
NO_TEMPERATURE = "this device measures no temperature: nothing keeps rig.max_temperature_c"
# Numbers are sent with ten digits, and a Rigol answers with seven.
REL_TOL = 1e-6
"""How far what a device keeps may be from what it was told, where nothing else is said."""

_FINGER = ("force_n", "position_m", "finger_s")


# The console shows these between two polls, because only the port's owner may ask the device.
@dataclass(frozen=True, kw_only=True)
class Reading:
    """The last answers on drive and finger; `at_s` and `finger_s` are theirs on the driver's clock.

    `amplitude_v` is that moment's amplitude, below the commanded one during a ramp.
    """

    at_s: float
    output: bool
    amplitude_v: float
    frequency_hz: float
    monitor_v: float | None = None
    force_n: float | None = None
    position_m: float | None = None
    finger_s: float | None = None


class Driver(ABC):
    """Control a device over `link` within `limits`. Not thread-safe: one owner."""

    dialect: ClassVar[str]
    idn: ClassVar["re.Pattern[str]"]
    """The pattern of these devices' answer to `*IDN?`."""
    expected: ClassVar[str]
    """These devices in words, for messages."""
    has_watchdog: ClassVar[bool] = False
    measures_vibration: ClassVar[bool] = False
    health: ClassVar[Mapping[str, str]]
    """Queries that show the state of the device, by name."""
    off_command: ClassVar[str] = "OUTP OFF"
    output_query: ClassVar[str] = "OUTP?"
    register: ClassVar[Register] = EVENT_ENABLE
    """The register by which the link gets into step."""

    def __init__(
        self, link: Link, limits: Limits, monotonic: Callable[[], float] = time.monotonic
    ) -> None:
        link.register = self.register
        self.link = link
        self.limits = limits
        self.monotonic = monotonic
        self.reading: Reading | None = None
        """The last answers of the device; reading them sends nothing."""
        self.driven: Setpoint | None = None
        """What is on, None while the output is to be off."""
        self.is_guarded = False
        """Whether a process of its own turns the output off when this program falls silent."""
        self.foreign: ForeignOutput | None = None
        """The error to raise if another device answered."""
        self._stayed_off = False
        """Whether off was read back when the device was armed, and nothing was on since."""

    def arm(self) -> Identity:
        """Turn the output off, see who answers, set limits and watchdog, and read them back.

        Raise `ForeignOutput` for another device, to which nothing else is sent, `DeviceError` for
        one that does not keep what was set, and `OutputUnknown` if it does not say that it is off.
        """
        self.driven, self.foreign, self._stayed_off = None, None, False
        # Off comes before the question who is there: what was left on goes off without delay.
        self.send_off()
        idn = self.link.identify()
        # A device that is not ours gets nothing else: a command could switch on what it drives.
        if self.idn.match(idn) is None:
            self.foreign = ForeignOutput(
                f"expected {self.expected}, got {idn!r}; nothing else was sent"
            )
            raise self.foreign
        self._meet()
        self.link.synchronise(HANDSHAKE_S)
        self.link.keep_pace()
        self.off()
        self._stayed_off = True
        # Taken before anything is set, or the first command would be blamed for earlier errors.
        errors = tuple(self.drained_errors())
        identity = self._prepared(idn, errors)
        self.link.keep_pace()
        return identity

    def pace(self) -> Pace:
        """Measure how fast the armed device is; changes nothing, raises as `check`."""
        answer_s = self.link.answer_s
        # A drive sets and reads back three values, and switches on.
        begin_s, end_s, late_s = 20 * answer_s, 6 * answer_s, 10 * answer_s
        # Twice as often as it must be heard, because answers differ.
        return Pace(
            answer_s=answer_s, watch_s=2 * answer_s, begin_s=begin_s, end_s=end_s, late_s=late_s
        )

    def _meet(self) -> None:  # noqa: B027 - most devices need nothing
        """Tell a device that is the expected one what the link needs to get into step."""

    @abstractmethod
    def _prepared(self, idn: str, errors: tuple[str, ...]) -> Identity:
        """Set everything that a drive relies on, and read it back; the output stays off."""

    @abstractmethod
    def drive(self, setpoint: Setpoint) -> ReadBack:
        """Set `setpoint`, switch the output on, and return what the device says of it.

        A device that was driven already and is found off is not switched on again. Raise
        `LimitExceeded`, with nothing sent, and `DeviceError` if it is not as it was set.
        """

    @abstractmethod
    def read_back(self) -> ReadBack:
        """Get the drive and the sensors as the device reports them."""

    @abstractmethod
    def check(self) -> None:
        """Raise `DeviceError` unless the device does what it was told; this feeds its watchdog."""

    def _heard(self, said: ReadBack, amplitude_v: float) -> None:
        """Keep what the device said; an answer without sensors keeps the last finger."""
        now_s = self.monotonic()
        self._stayed_off = self._stayed_off and not said.output
        new = Reading(
            at_s=now_s,
            output=said.output,
            amplitude_v=amplitude_v,
            frequency_hz=said.frequency_hz,
            monitor_v=said.monitor_v,
            force_n=said.force_n,
            position_m=said.position_m,
            finger_s=now_s,
        )
        # A poll asks for no sensors. The finger that was seen last stays, with its own time.
        if said.force_n is None and self.reading is not None:
            finger = {name: getattr(self.reading, name) for name in _FINGER}
            new = replace(new, **finger)
        self.reading = new

    def carry_on(self) -> bool:
        """Take the next step of a ramp that the device cannot make; False when it is done."""
        return False

    def force_source(self) -> ForceSource:
        """Return what samples forces; raise `CannotRecord` if the device does not."""
        raise CannotRecord(
            f"a {self.dialect} device records no forces: force_channel.rate_hz needs a board or a "
            "gauge"
        )

    def vibration_m(self) -> float:
        """Measure the amplitude of the beam's tip, m."""
        raise DeviceError(self.measures_none())

    @classmethod
    def measures_none(cls) -> str:
        """Return what a person does where the device measures no vibration."""
        return (
            f"a {cls.dialect} device measures no vibration: find the resonance another way and "
            "write it to calibration.json in the study's folder; see " + page("Set up the rig")
        )

    def watchdog_trips(self) -> bool:
        """Return whether the output goes off by itself when the device hears nothing for a while.

        The output is on at 0 V meanwhile, and off afterwards. Nobody should touch the beam. Raises
        as `drive`, `off`, and `DeviceError` without a watchdog.
        """
        raise DeviceError(f"a {self.dialect} device has no watchdog")

    def output(self) -> bool:
        """Get whether the output is on; no stray line answers for it."""
        return self.link.certain([self.output_query], lambda answers: switch(answers[0]))

    def switch_on(self, command: str) -> None:
        """Switch the output on, as `reading` shows at once; `DeviceError` if the device refuses."""
        self._stayed_off = False
        if self.reading is not None:
            self.reading = replace(self.reading, at_s=self.monotonic(), output=True)
        self.send(command)

    def send_off(self) -> None:
        """Send off once, without waiting; raise `DeviceError` if the port does not take it."""
        self.link.tell(self.off_command)

    def off(self) -> None:
        """Turn the output off and read it back; raise `OutputUnknown` if that is not confirmed.

        That is an `OutputLastOff` where nothing was on since the device was armed.
        """
        # Forgotten first: whatever fails below, nobody may take the output as meant to be on.
        self.driven = None
        if self.foreign is not None:
            raise self.foreign
        try:
            self.send_off()
        except DeviceError as error:
            raise self._unconfirmed(error) from error
        self.confirm_off()

    def confirm_off(self) -> None:
        """Check that the output is off; raise `OutputUnknown` as `off`."""
        try:
            still_on = self._asked_twice_whether_on()
        except DeviceError as error:
            raise self._unconfirmed(error) from error
        if still_on:
            self._stayed_off = False
            raise OutputUnknown(f"the device was told {self.off_command} and {still_on}")
        if self.reading is not None:
            self.reading = replace(
                self.reading, at_s=self.monotonic(), output=False, amplitude_v=0.0, monitor_v=None
            )

    def _unconfirmed(self, error: DeviceError) -> OutputUnknown:
        return (OutputLastOff if self._stayed_off else OutputUnknown)(str(error))

    def _asked_twice_whether_on(self) -> str:
        """Tell a device that missed its deadline again: one answer out of two is a confirmation."""
        try:
            return self.still_on()
        # Only a late answer is asked for again. A garbled one has been repeated by the link.
        except LinkTimeout:
            self.send_off()
            # With less patience than at the start: nobody knows yet whether the output is off.
            self.link.synchronise(ANSWER_TIMEOUT_S)
            return self.still_on()

    def still_on(self) -> str:
        """Return what shows that the output is still on, '' if it is off; raises `DeviceError`."""
        return "says that its output is on" if self.output() else ""

    def close(self) -> None:
        """Close the port."""
        self.link.close()

    def number(self, query: str) -> float:
        """Get a number."""
        return self.link.query(query, number)

    def set_number(
        self,
        header: str,
        value: float,
        rel_tol: float = REL_TOL,
        abs_tol: float = 1e-6,
        unit: str = "",
    ) -> None:
        """Set a value, settle, and compare what the device kept."""
        self.send(f"{header} {number_text(value)} {unit}".rstrip())
        kept = self.number(f"{header}?")
        # What a device clips or rounds away it may not report: the read-back alone is believed.
        if not math.isclose(kept, value, rel_tol=rel_tol, abs_tol=abs_tol):
            raise DeviceError(f"{header} was set to {value:g} and reads back as {kept:g}")

    def require_frequency(self, said_hz: float) -> None:
        """Raise `DeviceError` unless the drive has the frequency that was last set."""
        if self.driven is None:
            return
        set_hz = self.driven.frequency_hz
        if not set_hz * (1 - REL_TOL) <= said_hz <= set_hz * (1 + REL_TOL):
            raise DeviceError(
                f"FREQ was set to {number_text(set_hz)} and reads back as {number_text(said_hz)}"
            )

    def set_word(self, header: str, value: str) -> None:
        """Set a word, settle, and compare what the device kept."""
        self.send(f"{header} {value}")
        kept = self.link.ask(f"{header}?")
        if kept != value:
            raise DeviceError(f"{header} was set to {value} and reads back as {kept}")

    def send(self, command: str) -> None:
        """Send `command`, wait until it is done, and raise if the device reports an error."""
        self.link.tell(command)
        # The answer says that the command was carried out: an error it causes is in the queue.
        self.link.ask("*OPC?")
        errors = self.drained_errors()
        if errors:
            raise DeviceError(
                f"{command.split(maxsplit=1)[0]} was refused by the device: {'; '.join(errors)}"
            )

    def drained_errors(self) -> list[str]:
        """Empty and return the error queue; a garbled answer has lost its error and raises one."""
        errors: list[str] = []
        while (error := queued_error(self.link.ask("SYST:ERR?"))) is not None:
            errors.append(error)
            if len(errors) >= MOST_QUEUED_ERRORS:
                raise DeviceError(f"the device's error queue does not end: {error}")
        return errors


# The drivers, one dialect a file. A module here that defines `DRIVER` is found by being here.


def defined_in(package: str, name: str) -> list[Any]:
    """Return what the modules of `package` define as `name`; not every one does."""
    folder = import_module(package).__path__
    # A new dialect is a new file and nothing else: no list of drivers has to be kept.
    modules = [import_module(f"{package}.{entry.name}") for entry in iter_modules(folder)]
    return [getattr(module, name) for module in modules if hasattr(module, name)]


@cache
def drivers() -> dict[str, type[Driver]]:
    """Return the drivers by dialect."""
    return {driver.dialect: driver for driver in defined_in("device.drivers", "DRIVER")}


def driver_of(dialect: str) -> type[Driver]:
    """Return the driver of `dialect`; raise `AddressError` if there is none."""
    if dialect not in drivers():
        known = ", ".join(drivers())
        raise AddressError(f"the dialect must be one of {known}, got {dialect!r}")
    return drivers()[dialect]


def driver_for(idn: str) -> type[Driver]:
    """Return the driver for what answers `*IDN?` with `idn`; raise `ForeignDevice` without one."""
    for driver in drivers().values():
        if driver.idn.match(idn):
            return driver
    known = "; ".join(driver.expected for driver in drivers().values())
    raise ForeignDevice(f"expected one of: {known}; got {idn!r}; nothing else was sent")
