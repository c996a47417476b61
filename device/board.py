"""The driver of the board: what a drive is in its words. docs/wire-protocol.md has them all."""

import math

from device.errors import DeviceError, OutputUnknown
from device.link import Link
from device.records import Identity, Limits, ReadBack, Setpoint
from device.wire import number, number_text, queued_error, switch

MOST_QUEUED_ERRORS = 32
"""An error queue that is longer than this does not end."""


class Board:
    """Control a touchbeam board over `link`. The read-back is the contract."""

    def __init__(self, link: Link, limits: Limits) -> None:
        self._link = link
        self._limits = limits

    def arm(self) -> Identity:
        """Turn the output off, see who answers, set limits and watchdog, and read them back.

        Raises:
            DeviceError: it is no board, reports an error, or does not keep what was set.
            OutputUnknown: its output cannot be read back as off.
        """
        self._link.tell("OUTP OFF")
        idn = self._link.ask("*IDN?")
        if not idn.upper().startswith("TOUCHBEAM,BOARD"):
            raise DeviceError(
                f"expected a board (TOUCHBEAM,BOARD,…), got {idn!r}; nothing else sent"
            )
        self.off()
        self._link.tell("OUTP:PROT:CLE")
        self._set("SYST:WATC", self._limits.watchdog_s)
        self._set("VOLT:LIM", self._limits.max_voltage_v)
        self._set("VOLT", 0.0)
        return Identity(
            idn=idn,
            boot=int(number(self._link.ask("SYST:BOOT?"))),
            device_time_s=self.device_time_s(),
        )

    def drive(self, setpoint: Setpoint) -> ReadBack:
        """Set `setpoint`, switch the output on, and return what the device says of it.

        Raises:
            ValueError: the setpoint exceeds the limits; nothing was sent.
            DeviceError: the device reports an error or something else than what was set.
        """
        setpoint.checked(self._limits)
        self._set("VOLT:RAMP", setpoint.ramp_v_per_s)
        self._set("FREQ", setpoint.frequency_hz)
        self._set("VOLT", setpoint.voltage_v)
        self._link.tell("OUTP ON")
        self._settle("OUTP ON")
        return self.read_back()

    def read_back(self) -> ReadBack:
        """Get the drive and the sensors as the device reports them."""
        return ReadBack(
            output=switch(self._link.ask("OUTP?")),
            voltage_v=self._number("VOLT?"),
            frequency_hz=self._number("FREQ?"),
            monitor_v=self._number("MEAS:VOLT?"),
            force_n=self._number("MEAS:FORC?"),
            position_m=self._number("MEAS:POS?"),
            device_time_s=self.device_time_s(),
        )

    def output(self) -> bool:
        """Get whether the output is on; any query keeps the watchdog quiet."""
        return switch(self._link.ask("OUTP?"))

    def device_time_s(self) -> float:
        """Get the device's own time, s."""
        return self._number("SYST:TIME?")

    def vibration_m(self) -> float:
        """Measure the amplitude of the beam's tip, m."""
        return self._number("MEAS:VIBR?")

    def off(self) -> None:
        """Turn the output off and read it back.

        Raises:
            OutputUnknown: the device does not confirm it.
        """
        try:
            self._link.tell("OUTP OFF")
            on = switch(self._link.ask("OUTP?"))
        except DeviceError as error:
            raise OutputUnknown(str(error)) from error
        if on:
            raise OutputUnknown("the device was told OUTP OFF and says that its output is on")

    def close(self) -> None:
        """Give the port back."""
        self._link.close()

    def _number(self, query: str) -> float:
        return number(self._link.ask(query))

    def _set(self, header: str, value: float) -> None:
        """Send a value, settle, and compare what the device kept."""
        self._link.tell(f"{header} {number_text(value)}")
        self._settle(header)
        kept = self._number(f"{header}?")
        if not math.isclose(kept, value, rel_tol=1e-6, abs_tol=1e-6):
            raise DeviceError(f"{header} was set to {value:g} and reads back as {kept:g}")

    def _settle(self, command: str) -> None:
        """Wait until the device has done it, and see whether it minded."""
        self._link.ask("*OPC?")
        errors = self._drained_errors()
        if errors:
            raise DeviceError(f"{command} was refused by the device: {'; '.join(errors)}")

    def _drained_errors(self) -> list[str]:
        errors: list[str] = []
        while (error := queued_error(self._link.ask("SYST:ERR?"))) is not None:
            errors.append(error)
            if len(errors) >= MOST_QUEUED_ERRORS:
                raise DeviceError(f"the device's error queue does not end: {error}")
        return errors
