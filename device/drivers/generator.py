"""Generators before an amplifier: amplitudes peak-to-peak, and ramps made by this program.

What somebody sets at the panel can double the amplitude, move the frequency or add a second signal.
All of that is set before a drive, and asked for in every read-back and poll.
"""

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from device.drivers.driver import NO_TEMPERATURE, Driver
from device.drivers.setpoints import Setpoint
from device.errors import DeviceError, LimitExceeded
from protocol.journal.records import Identity, ReadBack

AMPLITUDE_REL_TOL = 1e-3
"""They keep four digits of an amplitude (33220A User's Guide, "Output Amplitude")."""
NO_WATCHDOG = (
    "this generator has no watchdog: if this program or its cable dies, the output stays on; "
    "keep a hand on the amplifier's switch"
)
NO_LIMITS = "this model has no limits of its own: only the plan and this program keep them"
NO_ERRORS = (
    "this generator keeps no list of errors: whether it obeyed is known by reading back alone"
)


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


@dataclass(frozen=True, kw_only=True)
class Told:
    """What a generator tells of itself, all of one moment.

    `wrong` says what is not as every drive relies on, and is empty if all of it is.
    """

    output: bool
    vpp: float
    frequency_hz: float
    wrong: str


class Generator(Driver):
    """Control a generator. 0 V is its output switched off: it cannot give less than a little."""

    on_command = "OUTP ON"
    amplitude_abs_tol_vpp: ClassVar[float] = 0.0
    """The step of amplitudes that are too small for `AMPLITUDE_REL_TOL`."""
    _least_v = 0.0
    _ramp: Ramp | None = None
    _amplitude_v = 0.0

    @abstractmethod
    def _set_up(self, idn: str) -> float:
        """Set everything that an amplitude relies on; return the least amplitude, Vpp, now set.

        The order matters: what comes later is counted in what came before.
        """

    @abstractmethod
    def _remarks(self) -> tuple[str, ...]:
        """Return what the operator must know of what this generator cannot do."""

    @abstractmethod
    def _told(self) -> Told:
        """Ask for everything at once, so that no stray line answers for it."""

    @abstractmethod
    def _set_vpp(self, vpp: float) -> None:
        """Set the amplitude and compare what was kept."""

    @abstractmethod
    def _set_frequency(self, frequency_hz: float) -> None:
        """Set the frequency and compare what was kept."""

    def arm(self) -> Identity:
        """Set the generator up; refused before anything is sent where its gain is not known."""
        self.limits.amplifier.vpp(self.limits.max_voltage_v)
        return super().arm()

    def _prepared(self, idn: str, errors: tuple[str, ...]) -> Identity:
        self._ramp = None
        self._least_v = self.limits.amplifier.amplitude_v(self._set_up(idn))
        self._amplitude_v = self._least_v
        self.read_back()
        limited = self.limits.max_temperature_c is not None
        return Identity(
            idn=idn,
            boot=None,
            device_time_s=None,
            dialect=self.dialect,
            cleared_errors=errors,
            remarks=self._remarks() + (NO_TEMPERATURE,) * limited,
        )

    def drive(self, setpoint: Setpoint) -> ReadBack:
        """Set `setpoint`, switch the output on, and return what the device says of it.

        The amplitude starts at the smallest and moves on with `carry_on`. Where it is on its way
        there already, as fast, it goes on as it was.
        """
        self._checked(setpoint)
        if setpoint.voltage_v == 0 and self.driven is None:
            return self.read_back()
        self._set_frequency(setpoint.frequency_hz)
        if self.driven is None:
            self._set_amplitude(self._least_v)
            self.read_back()
            self.send(self.on_command)
        self.driven = setpoint
        to_v, v_per_s = max(setpoint.voltage_v, self._least_v), setpoint.ramp_v_per_s
        if self._ramp is None or (self._ramp.to_v, self._ramp.v_per_s) != (to_v, v_per_s):
            self._ramp = Ramp(
                from_v=self._amplitude_v, to_v=to_v, begin_s=self.monotonic(), v_per_s=v_per_s
            )
        return self.read_back()

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
            DeviceError: the output is not as it was switched, or something is not as it was set.
        """
        told = self._told()
        self._require(told, output=self.driven is not None)
        return ReadBack(
            output=told.output,
            voltage_v=self.limits.amplifier.amplitude_v(told.vpp),
            frequency_hz=told.frequency_hz,
        )

    def check(self) -> None:
        """See that the output is as it was switched, and that nobody turned a knob."""
        self.read_back()

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
        self._set_vpp(self.limits.amplifier.vpp(voltage_v))
        self._amplitude_v = voltage_v

    def _require(self, told: Told, *, output: bool) -> None:
        """Raise unless the generator is set up, switched and driven as it was told."""
        if told.output != output:
            state = "on" if told.output else "off"
            raise DeviceError(f"the generator's output is {state}, and nobody here switched it")
        if told.wrong:
            raise DeviceError(f"the generator's {told.wrong}")
        self._require_amplitude(self.limits.amplifier.amplitude_v(told.vpp))
        self.require_frequency(told.frequency_hz)

    def _require_amplitude(self, kept_v: float) -> None:
        """The amplitude is the last one set, for the ramp moves it step by step."""
        step_v = self.limits.amplifier.amplitude_v(self.amplitude_abs_tol_vpp)
        if not math.isclose(self._amplitude_v, kept_v, rel_tol=AMPLITUDE_REL_TOL, abs_tol=step_v):
            raise DeviceError(
                f"the amplitude was set to {self._amplitude_v:g} V and reads back as {kept_v:g}"
            )
