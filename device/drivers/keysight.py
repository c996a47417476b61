"""The driver of the Keysight (Agilent) 33220A and 33500 generators, through an amplifier.

Source: Agilent 33220A User's Guide and 33500 Series Operating and Service Guide. Their amplitudes
are peak-to-peak, and right only if the generator knows that its load is open.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from device.drivers.driver import Driver
from device.drivers.setpoints import Setpoint
from device.errors import DeviceError, LimitExceeded
from device.link.codec import fields, impedance, number, number_text, switch
from protocol.journal.records import Identity, ReadBack

AMPLITUDE_REL_TOL = 1e-3
"""They keep four digits of an amplitude (33220A User's Guide, "Output Amplitude")."""
NO_WATCHDOG = (
    "this generator has no watchdog: if this program or its cable dies, the output stays on; "
    "keep a hand on the amplifier's switch"
)
NO_LIMITS = "this model has no limits of its own: only the plan and this program keep them"


@dataclass(frozen=True, kw_only=True)
class Ramp:
    """An amplitude that this program moves, for the generator cannot."""

    from_v: float
    to_v: float
    begin_s: float
    v_per_s: float

    def at(self, now_s: float) -> float:
        """Return the amplitude at a moment, V."""
        moved_v = self.v_per_s * (now_s - self.begin_s)
        if moved_v >= abs(self.to_v - self.from_v):
            return self.to_v
        return self.from_v + math.copysign(moved_v, self.to_v - self.from_v)


class Keysight(Driver):
    """Control a generator. 0 V is its output switched off: it cannot give less than a little."""

    dialect: ClassVar[str] = "keysight"
    idn: ClassVar["re.Pattern[str]"] = re.compile(
        r"(Agilent|Keysight) Technologies,33(220A|[56]\d\d[AB]?)", re.IGNORECASE
    )
    expected: ClassVar[str] = "a generator (Agilent or Keysight 33220A, 33500 or 33600)"
    health: ClassVar[Mapping[str, str]] = {
        "output": "OUTP?",
        "amplitude": "VOLT?",
        "unit": "VOLT:UNIT?",
        "offset_v": "VOLT:OFFS?",
        "frequency_hz": "FREQ?",
        "function": "FUNC?",
        "load_ohm": "OUTP:LOAD?",
        "events": "*ESR?",
    }
    _source = ""
    _output = "OUTP"
    _has_limits = False
    _least_v = 0.0
    _ramp: Ramp | None = None
    _amplitude_v = 0.0

    def arm(self) -> Identity:
        """Set the generator up; refused before anything is sent where its gain is not known."""
        self.limits.amplifier.vpp(self.limits.max_voltage_v)
        return super().arm()

    def _prepared(self, idn: str, errors: tuple[str, ...]) -> Identity:
        self._has_limits = ",33220A" not in idn.upper()
        if self._has_limits:
            self._source, self._output = "SOUR1:", "OUTP1"
        self._ramp = None
        self._set_up()
        return Identity(
            idn=idn,
            boot=None,
            device_time_s=None,
            dialect=self.dialect,
            cleared_errors=errors,
            remarks=(NO_WATCHDOG,) if self._has_limits else (NO_WATCHDOG, NO_LIMITS),
        )

    def _set_up(self) -> None:
        """The order matters: what comes later is counted in what came before.

        The smallest amplitude comes before the limits: they cannot be switched on while what is
        set exceeds them.
        """
        source = self._source
        if self._has_limits:
            self.set_word(f"{source}VOLT:LIM:STAT", "0")
        self.set_word(f"{source}FUNC", "SIN")
        for modulation in ("SWE", "BURS"):
            self.set_word(f"{source}{modulation}:STAT", "0")
        self.send(f"{self._output}:LOAD INF")
        self.set_word(f"{source}VOLT:UNIT", "VPP")
        self.send(f"{source}VOLT MIN")
        self.set_number(f"{source}VOLT:OFFS", 0.0)
        least_vpp = self.number(f"{source}VOLT? MIN")
        self._least_v = self.limits.amplifier.amplitude_v(least_vpp)
        self._set_limits()
        self._amplitude_v = self._least_v
        self._as_set_up()

    def _set_limits(self) -> None:
        most_v = self.limits.amplifier.vpp(self.limits.max_voltage_v) / 2
        if self._has_limits:
            self.set_number(f"{self._source}VOLT:LIM:HIGH", most_v)
            self.set_number(f"{self._source}VOLT:LIM:LOW", -most_v)
            self.set_word(f"{self._source}VOLT:LIM:STAT", "1")

    def drive(self, setpoint: Setpoint) -> ReadBack:
        """Set `setpoint`, switch the output on, and return what the device says of it.

        The amplitude starts at the smallest and moves on with `carry_on`. Where it is on its way
        there already, as fast, it goes on as it was.
        """
        self._checked(setpoint)
        if setpoint.voltage_v == 0 and self.driven is None:
            return self.read_back()
        self._as_set_up()
        self.set_word(f"{self._source}SWE:STAT", "0")
        self.set_number(f"{self._source}FREQ", setpoint.frequency_hz)
        if self.driven is None:
            self._set_amplitude(self._least_v)
            self.send(f"{self._output} ON")
        self.driven = setpoint
        to_v, v_per_s = max(setpoint.voltage_v, self._least_v), setpoint.ramp_v_per_s
        if self._ramp is None or (self._ramp.to_v, self._ramp.v_per_s) != (to_v, v_per_s):
            self._ramp = Ramp(
                from_v=self._amplitude_v, to_v=to_v, begin_s=self.monotonic(), v_per_s=v_per_s
            )
        read_back = self.read_back()
        if not read_back.output:
            raise DeviceError("the generator's output is off, and was to be on")
        return read_back

    def carry_on(self) -> bool:
        """Take the next step of the ramp; at 0 V the output goes off."""
        if self._ramp is None or self.driven is None:
            return False
        wanted_v = self._ramp.at(self.monotonic())
        self._set_amplitude(wanted_v)
        if wanted_v != self._ramp.to_v:
            return True
        self._ramp = None
        if self.driven.voltage_v == 0:
            self.off()
        return False

    def read_back(self) -> ReadBack:
        """Get the drive; a generator measures nothing.

        Raises:
            DeviceError: the output is on, and the drive is not what was set.
        """
        read_back = self._said()
        if self.driven is not None and read_back.output:
            self._as_set(read_back)
        return read_back

    def _said(self) -> ReadBack:
        query = f"{self._output}?;:{self._source}VOLT?;:{self._source}FREQ?"
        on, vpp, frequency_hz = self.link.query(query, _output_and_two)
        return ReadBack(
            output=on,
            voltage_v=self.limits.amplifier.amplitude_v(vpp),
            frequency_hz=frequency_hz,
        )

    def check(self) -> None:
        """See that the output is as it was switched, and that nobody turned a knob."""
        read_back = self._said()
        if read_back.output != (self.driven is not None):
            state = "on" if read_back.output else "off"
            raise DeviceError(f"the generator's output is {state}, and nobody here switched it")
        self._as_set_up()
        if self.driven is not None:
            self._as_set(read_back)

    def off(self) -> None:
        """Turn the output off and read it back."""
        self._ramp = None
        super().off()

    def _checked(self, setpoint: Setpoint) -> None:
        setpoint.checked(self.limits)
        if 0 < setpoint.voltage_v < self._least_v:
            raise LimitExceeded(
                f"voltage_v must be 0 or at least the generator's {self._least_v:g}, "
                f"got {setpoint.voltage_v:g}"
            )

    def _set_amplitude(self, voltage_v: float) -> None:
        vpp = self.limits.amplifier.vpp(voltage_v)
        self.set_number(f"{self._source}VOLT", vpp, AMPLITUDE_REL_TOL)
        self._amplitude_v = voltage_v

    def _as_set(self, read_back: ReadBack) -> None:
        """Raise unless the drive is what was last set, for the ramp moves it step by step."""
        told_v, kept_v = self._amplitude_v, read_back.voltage_v
        if not math.isclose(told_v, kept_v, rel_tol=AMPLITUDE_REL_TOL):
            raise DeviceError(f"the amplitude was set to {told_v:g} V and reads back as {kept_v:g}")
        self.require_frequency(read_back.frequency_hz)

    def _as_set_up(self) -> None:
        """Load, unit, offset and limits are what every amplitude relies on: see them again.

        Raises:
            DeviceError: one of them is not as it was set.
        """
        source = self._source
        query = f"{self._output}:LOAD?;:{source}VOLT:UNIT?;:{source}VOLT:OFFS?;:{source}FUNC?"
        load, unit, offset, function = self.link.query(query, lambda said: fields(said, 4))
        if math.isfinite(impedance(load)):
            raise DeviceError(f"the generator's load must be INF, got {load}: twice the voltage")
        if (unit, function) != ("VPP", "SIN") or number(offset) != 0:
            raise DeviceError(
                "the generator's unit, offset and function must be VPP, 0 and SIN, "
                f"got {unit}, {number_text(number(offset))} and {function}"
            )
        if self._has_limits:
            self._as_limited()

    def _as_limited(self) -> None:
        limit = f"{self._source}VOLT:LIM"
        query = f"{limit}:STAT?;:{limit}:HIGH?;:{limit}:LOW?"
        on, high_v, low_v = self.link.query(query, _output_and_two)
        most_v = self.limits.amplifier.vpp(self.limits.max_voltage_v) / 2
        kept = math.isclose(high_v, most_v, rel_tol=1e-6) and math.isclose(low_v, -most_v)
        if not (on and kept):
            raise DeviceError(
                f"the generator's limits must be on at {-most_v:g} and {most_v:g} V, got "
                f"{'on' if on else 'off'} at {low_v:g} and {high_v:g} V"
            )


def _output_and_two(reply: str) -> tuple[bool, float, float]:
    on, first, second = fields(reply, 3)
    return switch(on), number(first), number(second)


DRIVER = Keysight
