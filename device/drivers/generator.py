"""What the drivers of generators share: peak-to-peak amplitudes and ramps made by touchbeam.

A setting at the front panel can double the amplitude, change the frequency or add a second signal.
The driver sets all of them when it arms the generator, and reads them in every read-back and poll.
"""

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from device.drivers.driver import NO_TEMPERATURE, REL_TOL, Driver
from device.drivers.limits import Setpoint
from device.drivers.pace import Pace
from device.errors import DeviceError, LimitExceeded
from device.link.codec import impedance, number, number_text, switch
from protocol.journal.records import Identity, ReadBack

AMPLITUDE_REL_TOL = 1e-3
"""They store four digits of an amplitude (33220A User's Guide, "Output Amplitude")."""
# The operator reads each of these once per session, because nothing else can keep what is missing.
NO_WATCHDOG = (
    "this generator has no watchdog, and on this system and port no other process can turn it off: "
    "if this program stops or the cable fails, the output stays on; keep a hand on the amplifier's "
    "switch"
)
GUARDED = (
    "this generator has no watchdog: its guardian, a process of touchbeam, turns it off if this "
    "program stops; if the computer, its power or the cable fails, the output stays on: keep a "
    "hand on the amplifier's switch"
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
        moved_v = self.v_per_s * (now_s - self.begin_s)
        # The end is returned as it is: `from + (to - from)` may differ from it in the last bit, and
        # the ramp is over only when its end is reached.
        if moved_v >= abs(self.to_v - self.from_v):
            return self.to_v
        return self.from_v + math.copysign(moved_v, self.to_v - self.from_v)


@dataclass(frozen=True, kw_only=True)
class Status:
    """What a generator says of itself; `fault` names a setting that no drive can have, else ''."""

    output: bool
    vpp: float
    frequency_hz: float
    fault: str


class Generator(Driver):
    """Control a generator. Its amplitude has a minimum, so 0 V means that its output is off."""

    on_command = "OUTP ON"
    amplitude_abs_tol_vpp: ClassVar[float] = 0.0
    """The resolution of the amplitude, where it is coarser than `AMPLITUDE_REL_TOL`."""
    lines_to_set: ClassVar[int] = 4
    """How many lines it takes to set a value and to see that it was kept."""
    least_v = 0.0
    _ramp: Ramp | None = None
    amplitude_v = 0.0

    @property
    def _watched(self) -> str:
        return GUARDED if self.is_guarded else NO_WATCHDOG

    @abstractmethod
    def _set_up(self, idn: str) -> float:
        """Apply all settings, first load and unit; return the smallest amplitude, Vpp."""

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
        # Asked for the error that it raises: without the gain no voltage at the beam is known.
        self.limits.amplifier.vpp(self.limits.max_voltage_v)
        return super().arm()

    def _prepared(self, idn: str, errors: tuple[str, ...]) -> Identity:
        # The model says what its smallest amplitude is, at the load and the unit now set.
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

    def pace(self) -> Pace:
        """As every driver; a poll, which reads all settings, is timed."""
        begin_s = self.monotonic()
        self.check()
        poll_s, answer_s = self.monotonic() - begin_s, self.link.answer_s
        step_s = self.lines_to_set * answer_s
        # A call may have to wait for a poll, and for a step of the ramp, that began before it.
        watch_s = poll_s + step_s
        return Pace(
            answer_s=answer_s,
            watch_s=watch_s,
            begin_s=watch_s + 2 * poll_s + 3 * step_s,
            end_s=watch_s + 6 * answer_s,
            late_s=1.2 * (watch_s + poll_s + 6 * answer_s),  # two looks and off; answers differ
            step_s=step_s,
        )

    def drive(self, setpoint: Setpoint) -> ReadBack:
        """As every driver, from the smallest amplitude on; `carry_on` makes the steps of the ramp.

        A ramp to the same amplitude at the same rate is continued.
        """
        setpoint.checked(self.limits)
        # A smaller amplitude would be raised to it, and the data would tell another voltage.
        if 0 < setpoint.voltage_v < self.least_v:
            raise LimitExceeded(
                f"voltage_v must be 0 or at least the generator's {self.least_v:g}, "
                f"got {setpoint.voltage_v:g}"
            )
        # The smallest amplitude is not 0 V: a touch at 0 V leaves the output off, and is read back.
        if setpoint.voltage_v == 0 and self.driven is None:
            return self.read_back()
        self._set_frequency(setpoint.frequency_hz)
        if self.driven is None:
            # It switches its amplitude on at once: a soft start begins at the smallest one.
            self._set_amplitude(self.least_v)
            self.read_back()
            self.switch_on(self.on_command)
        self.driven = setpoint
        to_v, v_per_s = max(setpoint.voltage_v, self.least_v), setpoint.ramp_v_per_s
        # A sweep drives often at one amplitude: the ramp to it must not begin anew each time.
        if self._ramp is None or (self._ramp.to_v, self._ramp.v_per_s) != (to_v, v_per_s):
            self._ramp = Ramp(
                from_v=self.amplitude_v, to_v=to_v, begin_s=self.monotonic(), v_per_s=v_per_s
            )
        return self.read_back()

    def carry_on(self) -> bool:
        """Make the next step of the ramp; at 0 V the output is switched off."""
        if self._ramp is None or self.driven is None:
            return False
        # By the time that has passed: slow answers make the steps larger and not the ramp longer.
        wanted_v = self._ramp.at(self.monotonic())
        self._set_amplitude(wanted_v)
        if wanted_v != self._ramp.to_v:
            return True
        self._ramp = None
        # The smallest amplitude is not 0 V: only the switch gives that.
        if self.driven.voltage_v == 0:
            self.off()
        return False

    def read_back(self) -> ReadBack:
        """Read the drive (there are no sensors); raise `DeviceError` if it is not as commanded."""
        status = self._status()
        amplitude_v = self.limits.amplifier.amplitude_v(status.vpp)
        said = ReadBack(
            output=status.output, voltage_v=amplitude_v, frequency_hz=status.frequency_hz
        )
        self._heard(said, amplitude_v)
        self._require(status, output=self.driven is not None)
        return said

    def check(self) -> None:
        self.read_back()

    def off(self) -> None:
        self._ramp = None
        super().off()

    def _set_amplitude(self, voltage_v: float) -> None:
        self._set_vpp(self.limits.amplifier.vpp(voltage_v))
        self.amplitude_v = voltage_v

    def _require(self, status: Status, *, output: bool) -> None:
        """Raise unless the output, the settings and the drive are as commanded."""
        # The switch comes first: it says whether anybody may touch the beam.
        if status.output != output:
            state = "on" if status.output else "off"
            raise DeviceError(f"the generator's output is {state}, and nobody here switched it")
        if status.fault:
            raise DeviceError(f"the generator's {status.fault}")
        kept_v = self.limits.amplifier.amplitude_v(status.vpp)
        # The resolution is one of the generator's setting, so that it is amplified too.
        step_v = self.limits.amplifier.amplitude_v(self.amplitude_abs_tol_vpp)
        if not math.isclose(self.amplitude_v, kept_v, rel_tol=AMPLITUDE_REL_TOL, abs_tol=step_v):
            raise DeviceError(
                f"the amplitude was set to {self.amplitude_v:g} V and reads back as {kept_v:g}"
            )
        self.require_frequency(status.frequency_hz)


# Generators that speak SCPI: they differ only in the names of commands and of states.


@dataclass(frozen=True, kw_only=True)
class Words:
    """The names of commands and states of one model.

    `source` is the prefix of channel 1's commands, such as `SOUR1:`; `limits` is empty for a model
    without voltage limits; `off` has settings that must be off, by name: the command, and the
    answer if it is off; `switches` are the answers for off and on.
    """

    source: str
    output: str
    limits: str
    off: Mapping[str, tuple[str, str]]
    switches: tuple[str, str]


class ScpiGenerator(Generator):
    """Control a generator that speaks SCPI."""

    _words: Words

    @abstractmethod
    def _words_of(self, idn: str) -> Words:
        """Return the names of the model that answers `*IDN?` with `idn`."""

    def _set_up(self, idn: str) -> float:
        """Apply all settings; limits come last, for they must not lie below the amplitude."""
        words = self._words = self._words_of(idn)
        self.on_command = f"{words.output} ON"
        # Whatever was set at the panel: a sine that is set with `FUNC` keeps its modulation.
        for header, word in words.off.values():
            self.set_word(header, word)
        # Old limits could be in the way of the amplitude and the offset that are set next.
        if words.limits:
            self.set_word(f"{words.limits}:STAT", words.switches[False])
        self.set_word(f"{words.source}FUNC", "SIN")
        # Not compared as a word, because models answer infinity in numbers of their own: `9.9E+37`.
        self.send(f"{words.output}:LOAD INF")
        self.set_word(f"{words.source}VOLT:UNIT", "VPP")
        self.send(f"{words.source}VOLT MIN")
        self.set_number(f"{words.source}VOLT:OFFS", 0.0)
        # Asked after load and unit, on which the answer depends.
        least_vpp = self.number(f"{words.source}VOLT? MIN")
        if words.limits:
            self.set_number(f"{words.limits}:HIGH", self._most_v)
            self.set_number(f"{words.limits}:LOW", -self._most_v)
            self.set_word(f"{words.limits}:STAT", words.switches[True])
        return least_vpp

    @property
    def _most_v(self) -> float:
        return self.limits.amplifier.vpp(self.limits.max_voltage_v) / 2

    def _remarks(self) -> tuple[str, ...]:
        return (self._watched,) if self._words.limits else (self._watched, NO_LIMITS)

    def _set_vpp(self, vpp: float) -> None:
        """Set the amplitude with its unit, which somebody may have changed at the panel."""
        header = f"{self._words.source}VOLT"
        self.set_number(header, vpp, AMPLITUDE_REL_TOL, self.amplitude_abs_tol_vpp, unit="VPP")

    def _set_frequency(self, frequency_hz: float) -> None:
        self.set_number(f"{self._words.source}FREQ", frequency_hz)

    def _status(self) -> Status:
        words = self._words
        volts, limits = f"{words.source}VOLT", words.limits
        headers = (
            *(words.output, volts, f"{words.source}FREQ"),
            *(f"{words.output}:LOAD", f"{volts}:UNIT", f"{volts}:OFFS", f"{words.source}FUNC"),
            *((f"{limits}:STAT", f"{limits}:HIGH", f"{limits}:LOW") if limits else ()),
            *(header for header, _ in words.off.values()),
        )

        def parsed(answers: list[str]) -> Status:
            answer_to = dict(zip(headers, answers, strict=True))
            return Status(
                output=switch(answer_to[words.output]),
                vpp=number(answer_to[volts]),
                frequency_hz=number(answer_to[f"{words.source}FREQ"]),
                # The load comes first, because it can double the voltage.
                fault=self._shape_fault(answer_to)
                or self._limits_fault(answer_to)
                or self._left_on(answer_to),
            )

        return self.link.certain([f"{header}?" for header in headers], parsed)

    def _shape_fault(self, answer_to: Mapping[str, str]) -> str:
        load, volts = answer_to[f"{self._words.output}:LOAD"], f"{self._words.source}VOLT"
        if math.isfinite(impedance(load)):
            return f"load must be INF, got {load}: twice the voltage"
        unit, function = answer_to[f"{volts}:UNIT"], answer_to[f"{self._words.source}FUNC"]
        offset_v = number(answer_to[f"{volts}:OFFS"])
        if (unit, offset_v, function) == ("VPP", 0, "SIN"):
            return ""
        return (
            "unit, offset and function must be VPP, 0 and SIN, "
            f"got {unit}, {number_text(offset_v)} and {function}"
        )

    def _limits_fault(self, answer_to: Mapping[str, str]) -> str:
        if not (limits := self._words.limits):
            return ""
        on, most_v = switch(answer_to[f"{limits}:STAT"]), self._most_v
        high_v, low_v = number(answer_to[f"{limits}:HIGH"]), number(answer_to[f"{limits}:LOW"])
        # Some answer with seven digits, so that neither limit need come back to the last one.
        high_agrees = math.isclose(high_v, most_v, rel_tol=REL_TOL)
        if on and high_agrees and math.isclose(low_v, -most_v, rel_tol=REL_TOL):
            return ""
        return (
            f"limits must be on at {-most_v:g} and {most_v:g} V, got "
            f"{'on' if on else 'off'} at {low_v:g} and {high_v:g} V"
        )

    def _left_on(self, answer_to: Mapping[str, str]) -> str:
        off_word = self._words.switches[False]
        for name, (header, word) in self._words.off.items():
            if answer_to[header] != word:
                return (
                    f"{name} must be {'off' if word == off_word else word}, got {answer_to[header]}"
                )
        return ""
