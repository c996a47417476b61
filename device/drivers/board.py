"""The driver of the board; docs/reference/wire-protocol.md lists its commands."""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import ClassVar

from device.drivers.driver import NO_TEMPERATURE, Driver
from device.drivers.limits import Setpoint
from device.errors import CannotRecord, DeviceError, LinkTimeout
from device.force_channel.recording import Block, Scale, decoded, scale_of
from device.link.codec import fields, number, number_text, switch, whole
from protocol.journal.records import Identity, ReadBack

# Both are in the documented wire protocol, so that whoever builds a board knows how exact its
# monitor must be. Near 0 V a share of the amplitude is nothing, so that a part of it is absolute.
MONITOR_REL_TOL = 0.05
MONITOR_ABS_TOL_V = 2.0
"""How far the independent monitor may be from the amplitude that the board means to give, and both
above what was asked of it."""
# A piezoelectric sheet is a capacitor: its voltage outlives the switch for a moment.
DISCHARGE_S = 0.5
"""How long the output may take to fall below `MONITOR_ABS_TOL_V` once it is off."""
# A board must trip between 90% and 100% of the time, so that 120% leaves no doubt.
_SILENCE = 1.2
"""How long to be silent for the watchdog to trip, relative to its time."""
_IDLE_HZ = 1_000.0
# Each of the following is one line, because its answers then describe one moment: asked one by one,
# a ramp would move between the target and the monitor that is compared with it.
_OFF = ("OUTP?", "MEAS:VOLT?")
_TRIPPED = "OUTP?;:OUTP:PROT:CAUS?"
_READ_BACK = "OUTP?;:VOLT:INST?;:VOLT?;:FREQ?;:MEAS:VOLT?;:MEAS:FORC?;:MEAS:POS?;:SYST:TIME?"
_HEALTH = "OUTP?;:OUTP:PROT:CAUS?;:SYST:BOOT?;:VOLT?;:VOLT:INST?;:FREQ?;:MEAS:VOLT?"
# SCPI's "Undefined header": a board without a sensor does not know the command for it.
_UNDEFINED = "-113 "
_FIRST_THAT_RECORDS = (1, 2)
"""The firmware from which on a board samples forces."""
_FIRMWARE = re.compile(r"(\d+)\.(\d+)")
_PROMISES = "OUTP:PROT:CAUS?;:SYST:BOOT?;:VOLT:LIM?;:SYST:WATC?"
_CAUSES = {
    "WATC": "its watchdog tripped: it says that it heard nothing for {watchdog_s:g} s (the program "
    "may have hung, the line been slow, or the computer slept)",
    "TEMP": "its protection tripped: over-temperature",
    "CURR": "its protection tripped: over-current",
}


class Board(Driver):
    """Control a touchbeam board: it ramps, measures and guards by itself."""

    dialect: ClassVar[str] = "board"
    idn: ClassVar["re.Pattern[str]"] = re.compile("touchbeam,BOARD,", re.IGNORECASE)
    expected: ClassVar[str] = "a board (TOUCHBEAM,BOARD,…)"
    has_watchdog: ClassVar[bool] = True
    measures_vibration: ClassVar[bool] = True
    health: ClassVar[Mapping[str, str]] = {
        "output": "OUTP?",
        "amplitude_v": "VOLT?",
        "frequency_hz": "FREQ?",
        "monitor_v": "MEAS:VOLT?",
        "force_n": "MEAS:FORC?",
        "position_m": "MEAS:POS?",
        "temperature_c": "MEAS:TEMP?",
        "protection": "OUTP:PROT:CAUS?",
        "limit_v": "VOLT:LIM?",
        "watchdog_s": "SYST:WATC?",
        "boot": "SYST:BOOT?",
        "time_s": "SYST:TIME?",
        "errors_queued": "SYST:ERR:COUN?",
    }
    _boot = 0
    _firmware = ""
    _measures_temperature = False
    # Going down, a board may still be above the new amplitude. What is allowed falls with the ramp
    # that was told, so that an output that does not come down is noticed.
    _most_v = 0.0
    """What the output might have at most at `_known_s`: the drive, or what it comes down from."""
    _known_s = 0.0

    def _prepared(self, idn: str, errors: tuple[str, ...]) -> Identity:
        self._firmware = idn.rpartition(",")[2]
        # The boot counter is read before anything is set, so that any later restart is noticed.
        self._boot = self.link.query("SYST:BOOT?", whole)
        # A trip is cleared first, because a tripped board refuses `OUTP ON`.
        self.send("OUTP:PROT:CLE")
        # The amplitude goes first, because a board refuses a limit below its amplitude.
        self.set_number("VOLT", 0.0)
        self.set_number("VOLT:LIM", self.limits.max_voltage_v)
        self.set_number("SYST:WATC", self.limits.watchdog_s)
        self._keeps_its_promises()
        # Without a limit nobody asks for the temperature: a board without a sensor is no fault.
        limited = self.limits.max_temperature_c is not None
        self._measures_temperature = limited and self._has_thermometer()
        return Identity(
            idn=idn,
            boot=self._boot,
            device_time_s=self.device_time_s(),
            dialect=self.dialect,
            cleared_errors=errors,
            remarks=(NO_TEMPERATURE,) if limited and not self._measures_temperature else (),
        )

    def _has_thermometer(self) -> bool:
        """Whether the board measures its temperature; one that does must be cool enough."""
        try:
            self._require_cool(self.number("MEAS:TEMP?"))
        except LinkTimeout:
            # Only the error queue tells a board without this command from one that fell silent.
            if not any(error.startswith(_UNDEFINED) for error in self.drained_errors()):
                raise
            return False
        return True

    def drive(self, setpoint: Setpoint) -> ReadBack:
        """As every driver; an amplitude that stays is not set again: a sweep's steps are short."""
        setpoint.checked(self.limits)
        # A restart since the board was armed, for one, has lost the limit and the watchdog.
        if self.driven is None:
            self._keeps_its_promises()
        driven, before_v = self.driven, self._allowed_v(self.monotonic())
        moves = driven is None or replace(setpoint, frequency_hz=driven.frequency_hz) != driven
        if moves:
            # The slope goes first, or the new amplitude would be approached at the old one.
            self.set_number("VOLT:RAMP", setpoint.ramp_v_per_s)
        self.set_number("FREQ", setpoint.frequency_hz)
        if moves:
            self.set_number("VOLT", setpoint.voltage_v)
            # The ramp counts from the answer to `VOLT?`, before which it may not have begun.
            self._know(max(before_v, setpoint.voltage_v))
        if self.driven is None:
            self.switch_on("OUTP ON")
        self.driven = setpoint
        return self.read_back()

    def read_back(self) -> ReadBack:
        """Get drive and sensors, all of one moment; `DeviceError` if they are not as driven."""
        asked_s = self.monotonic()
        read_back, instant_v = self.link.query(_READ_BACK, _read_back)
        self._heard(read_back, instant_v)
        if read_back.output != (self.driven is not None):
            # The health query knows the cause, such as a trip, which says more than "off".
            self.check()
        self._require_driven(asked_s, read_back, instant_v)
        return read_back

    def check(self) -> None:
        measured = self._measures_temperature
        query = f"{_HEALTH};:MEAS:TEMP?" if measured else _HEALTH
        asked_s = self.monotonic()
        cause, boot, drive, instant_v, temperature_c = self.link.query(
            query, lambda reply: _health(reply, with_temperature=measured)
        )
        self._heard(drive, instant_v)
        self._require_untripped(boot, cause)
        self._require_driven(asked_s, drive, instant_v)
        if temperature_c is not None:
            self._require_cool(temperature_c)

    def still_on(self) -> str:
        """Wait until the output has discharged, because the switch alone proves nothing."""
        deadline_s = self.monotonic() + DISCHARGE_S
        while True:
            on, monitor_v = self.link.certain(
                _OFF, lambda answers: (switch(answers[0]), number(answers[1]))
            )
            if on:
                return "says that its output is on"
            if abs(monitor_v) < MONITOR_ABS_TOL_V:
                return ""
            # The deadline is looked at after an answer: a slow one that says "off" still counts.
            if self.monotonic() >= deadline_s:
                return f"its monitor still shows {monitor_v:.1f} V after {DISCHARGE_S:g} s"

    def watchdog_trips(self) -> bool:
        """As every driver; the voltage must be gone too, and the trip is cleared."""
        self.drive(
            # The watchdog runs only while the output is on. At 0 V nobody can feel the test.
            Setpoint(voltage_v=0.0, frequency_hz=_IDLE_HZ, ramp_v_per_s=self.limits.ramp_v_per_s)
        )
        self.link.stay_silent(_SILENCE * self.limits.watchdog_s)
        tripped = self.link.query(_TRIPPED, _tripped)
        # Off and read back even if it tripped, so that its voltage is known to be gone.
        self.off()
        self.send("OUTP:PROT:CLE")
        return tripped

    def device_time_s(self) -> float:
        return self.number("SYST:TIME?")

    def vibration_m(self) -> float:
        return self.number("MEAS:VIBR?")

    def force_source(self) -> "Board":
        """Return this board; raise `CannotRecord` if its firmware samples no forces."""
        version = _FIRMWARE.match(self._firmware)
        if version is None or (int(version[1]), int(version[2])) < _FIRST_THAT_RECORDS:
            raise CannotRecord(
                f"this board (firmware {self._firmware}) records no forces: "
                "force_channel.rate_hz needs firmware 1.2 or a gauge"
            )
        return self

    def start_sampling(self, rate_hz: float) -> Scale:
        self.send("TRAC:STAT OFF")  # a session that was killed, or broken off, left it on
        self.set_number("TRAC:RATE", rate_hz)
        scale = self.link.query(
            "TRAC:SCAL?", lambda said: scale_of([number(size) for size in said.split(",")])
        )
        self.send("TRAC:STAT ON")
        return scale

    def sampled(self, first: int, checked: Callable[[Block], Block]) -> Block:
        # The check is part of the parsing, so that a block that is not due is asked for again.
        return self.link.block(f"TRAC:DATA? {first}", lambda content: checked(decoded(content)))

    def stop_sampling(self) -> None:
        self.send("TRAC:STAT OFF")

    def _keeps_its_promises(self) -> None:
        cause, boot, limit_v, watchdog_s = self.link.query(_PROMISES, lambda said: fields(said, 4))
        self._require_untripped(whole(boot), cause)
        _kept("VOLT:LIM", self.limits.max_voltage_v, number(limit_v))
        _kept("SYST:WATC", self.limits.watchdog_s, number(watchdog_s))

    def _require_untripped(self, boot: int, cause: str) -> None:
        # The restart comes before what it causes: output off, limits lost.
        if boot != self._boot:
            raise DeviceError(f"the device restarted (boot {self._boot}, now {boot}): brown-out?")
        if cause != "NONE":
            known = _CAUSES.get(cause, "{cause}")
            why = known.format(watchdog_s=self.limits.watchdog_s, cause=cause)
            raise DeviceError(f"the device: {why}")

    def _require_cool(self, temperature_c: float) -> None:
        most_c = self.limits.max_temperature_c
        if most_c is not None and temperature_c > most_c:
            raise DeviceError(
                f"the power stage must not be hotter than {most_c:g} °C, got {temperature_c:.1f} °C"
            )

    def _require_driven(self, asked_s: float, said: ReadBack, instant_v: float) -> None:
        """Raise unless switch and frequency are as driven, and the amplitude, which may still fall.

        It falls as fast as it was told. No drive exceeds the limits, so nothing here may exceed
        them by more than the tolerance.
        """
        monitor_v = said.monitor_v
        assert monitor_v is not None
        if said.output != (self.driven is not None):
            on = "the device's output is on, and nobody here switched it on"
            raise DeviceError(on if said.output else "the device turned its output off by itself")
        if self.driven is not None:
            _kept("VOLT", self.driven.voltage_v, said.voltage_v)
        # The moment before the query counts: what is allowed falls with time, and the board may
        # have measured as soon as it was asked.
        most_v = self._allowed_v(asked_s)
        _not_above(most_v, "the amplitude", instant_v)
        if abs(monitor_v - instant_v) > _tolerance_v(instant_v):
            raise DeviceError(f"the monitor must show {instant_v:.1f} V, got {monitor_v:.1f} V")
        _not_above(most_v, "the monitor", monitor_v)
        if self.driven is not None:
            self._know(max(self.driven.voltage_v, min(most_v, instant_v)))
        self.require_frequency(said.frequency_hz)

    def _allowed_v(self, at_s: float) -> float:
        if self.driven is None:
            return 0.0
        fallen_v = self.driven.ramp_v_per_s * (at_s - self._known_s)
        return max(self.driven.voltage_v, self._most_v - fallen_v)

    def _know(self, most_v: float) -> None:
        self._most_v, self._known_s = most_v, self.monotonic()


def _kept(header: str, told: float, kept: float) -> None:
    if not math.isclose(told, kept, rel_tol=1e-6, abs_tol=1e-6):
        raise DeviceError(
            f"{header} was set to {number_text(told)} and reads back as {number_text(kept)}"
        )


def _not_above(most_v: float, what: str, shown_v: float) -> None:
    if shown_v < -MONITOR_ABS_TOL_V:
        raise DeviceError(f"{what} must not be below 0 V, got {shown_v:.1f} V")
    if shown_v > most_v + _tolerance_v(most_v):
        raise DeviceError(f"{what} must not exceed {most_v:.1f} V, got {shown_v:.1f} V")


def _tolerance_v(amplitude_v: float) -> float:
    return MONITOR_ABS_TOL_V + MONITOR_REL_TOL * amplitude_v


def _read_back(reply: str) -> tuple[ReadBack, float]:
    on, *numbers = fields(reply, 8)
    instant_v, voltage_v, frequency_hz, monitor_v, force_n, position_m, time_s = map(
        number, numbers
    )
    read_back = ReadBack(
        output=switch(on),
        voltage_v=voltage_v,
        frequency_hz=frequency_hz,
        monitor_v=monitor_v,
        force_n=force_n,
        position_m=position_m,
        device_time_s=time_s,
    )
    return read_back, instant_v


def _tripped(reply: str) -> bool:
    on, cause = fields(reply, 2)
    return not switch(on) and cause == "WATC"


def _health(
    reply: str, *, with_temperature: bool
) -> tuple[str, int, ReadBack, float, float | None]:
    """Return cause of a trip, boot, drive with its monitor, present amplitude and temperature."""
    on, cause, boot, *numbers = fields(reply, 8 if with_temperature else 7)
    target_v, instant_v, frequency_hz, monitor_v, *temperature_c = map(number, numbers)
    drive = ReadBack(
        output=switch(on), voltage_v=target_v, frequency_hz=frequency_hz, monitor_v=monitor_v
    )
    return cause, whole(boot), drive, instant_v, temperature_c[0] if temperature_c else None


DRIVER = Board
