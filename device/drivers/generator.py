"""What the drivers of generators share: peak-to-peak amplitudes and ramps made by touchbeam.

A setting at the front panel can double the amplitude, change the frequency or add a second signal.
The driver sets all of them when it arms the generator, and reads them in every read-back and poll.
"""

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from device.drivers.driver import NO_TEMPERATURE, Driver
from device.drivers.limits import Setpoint
from device.errors import DeviceError, LimitExceeded
from protocol.journal.records import Identity, ReadBack

AMPLITUDE_REL_TOL = 1e-3
"""They store four digits of an amplitude (33220A User's Guide, "Output Amplitude")."""
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
    """A linear change of the amplitude, which touchbeam makes in steps."""

    from_v: float
    to_v: float
    begin_s: float
    v_per_s: float

    def at(self, now_s: float) -> float:
        """Return the amplitude at `now_s`, V."""
        moved_v = self.v_per_s * (now_s - self.begin_s)
        if moved_v >= abs(self.to_v - self.from_v):
            return self.to_v
        return self.from_v + math.copysign(moved_v, self.to_v - self.from_v)


@dataclass(frozen=True, kw_only=True)
class Status:
    """What a generator reports about itself at one moment.

    `fault` names a setting that is not as every drive needs it; it is empty if there is none.
    """

    output: bool
    vpp: float
    frequency_hz: float
    fault: str


class Generator(Driver):
    """Control a generator. Its amplitude has a minimum, so 0 V means that its output is off."""

    on_command = "OUTP ON"
    amplitude_abs_tol_vpp: ClassVar[float] = 0.0
    """The resolution of the amplitude, where it is coarser than `AMPLITUDE_REL_TOL`."""
    least_v = 0.0
    _ramp: Ramp | None = None
    amplitude_v = 0.0

    @abstractmethod
    def _set_up(self, idn: str) -> float:
        """Apply all settings, and the smallest amplitude; return it, Vpp.

        The order matters: an amplitude depends on the load and the unit that are set.
        """

    @abstractmethod
    def _remarks(self) -> tuple[str, ...]:
        """Return what the operator must know about the limitations of this generator."""

    @abstractmethod
    def _status(self) -> Status:
        """Read all settings together, so that no unsolicited line is taken for an answer."""

    @abstractmethod
    def _set_vpp(self, vpp: float) -> None:
        """Set the amplitude and compare the value that the generator stored."""

    @abstractmethod
    def _set_frequency(self, frequency_hz: float) -> None:
        """Set the frequency and compare the value that the generator stored."""

    def arm(self) -> Identity:
        """Set the generator up; refused before anything is sent where its gain is not known."""
        self.limits.amplifier.vpp(self.limits.max_voltage_v)
        return super().arm()

    def _prepared(self, idn: str, errors: tuple[str, ...]) -> Identity:
        self.least_v = self.limits.amplifier.amplitude_v(self._set_up(idn))
        self.amplitude_v = self.least_v
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
        """Apply `setpoint`, switch the output on, and return the values read back.

        The amplitude starts at the smallest one; `carry_on` makes the steps of the ramp. A ramp to
        the same amplitude at the same rate is continued.
        """
        setpoint.checked(self.limits)
        if 0 < setpoint.voltage_v < self.least_v:
            raise LimitExceeded(
                f"voltage_v must be 0 or at least the generator's {self.least_v:g}, "
                f"got {setpoint.voltage_v:g}"
            )
        if setpoint.voltage_v == 0 and self.driven is None:
            return self.read_back()
        self._set_frequency(setpoint.frequency_hz)
        if self.driven is None:
            self._set_amplitude(self.least_v)
            self.read_back()
            self.switch_on(self.on_command)
        self.driven = setpoint
        to_v, v_per_s = max(setpoint.voltage_v, self.least_v), setpoint.ramp_v_per_s
        if self._ramp is None or (self._ramp.to_v, self._ramp.v_per_s) != (to_v, v_per_s):
            self._ramp = Ramp(
                from_v=self.amplitude_v, to_v=to_v, begin_s=self.monotonic(), v_per_s=v_per_s
            )
        return self.read_back()

    def carry_on(self) -> bool:
        """Make the next step of the ramp; at 0 V the output is switched off."""
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
        """Read the drive; a generator has no sensors.

        Raises:
            DeviceError: the output or a setting differs from what was commanded.
        """
        status = self._status()
        amplitude_v = self.limits.amplifier.amplitude_v(status.vpp)
        said = ReadBack(
            output=status.output, voltage_v=amplitude_v, frequency_hz=status.frequency_hz
        )
        self._heard(said, amplitude_v)
        self._require(status, output=self.driven is not None)
        return said

    def check(self) -> None:
        """Check that the output and all settings are as commanded."""
        self.read_back()

    def off(self) -> None:
        """Turn the output off and read it back."""
        self._ramp = None
        super().off()

    def _set_amplitude(self, voltage_v: float) -> None:
        self._set_vpp(self.limits.amplifier.vpp(voltage_v))
        self.amplitude_v = voltage_v

    def _require(self, status: Status, *, output: bool) -> None:
        """Raise unless the output, the settings and the drive are as commanded."""
        if status.output != output:
            state = "on" if status.output else "off"
            raise DeviceError(f"the generator's output is {state}, and nobody here switched it")
        if status.fault:
            raise DeviceError(f"the generator's {status.fault}")
        kept_v = self.limits.amplifier.amplitude_v(status.vpp)
        step_v = self.limits.amplifier.amplitude_v(self.amplitude_abs_tol_vpp)
        if not math.isclose(self.amplitude_v, kept_v, rel_tol=AMPLITUDE_REL_TOL, abs_tol=step_v):
            raise DeviceError(
                f"the amplitude was set to {self.amplitude_v:g} V and reads back as {kept_v:g}"
            )
        self.require_frequency(status.frequency_hz)
