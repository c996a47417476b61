"""Generators that speak SCPI: they differ only in the names of commands and of states."""

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

from device.drivers.generator import AMPLITUDE_REL_TOL, NO_LIMITS, NO_WATCHDOG, Generator, Status
from device.link.codec import impedance, number, number_text, switch


@dataclass(frozen=True, kw_only=True)
class Words:
    """The names of commands and states of one model.

    Attributes:
        source: the prefix of commands for channel 1, such as `SOUR1:`, or nothing.
        output: the command for the output.
        limits: the command for the voltage limits; empty for a model without limits.
        off: settings that must be off: name → command, and the answer if it is off.
        switches: the answers for off and on.
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
        """Apply all settings. The smallest amplitude precedes the limits.

        Limits that the amplitude exceeds cannot be switched on.
        """
        words = self._words = self._words_of(idn)
        self.on_command = f"{words.output} ON"
        for header, word in words.off.values():
            self.set_word(header, word)
        if words.limits:
            self.set_word(f"{words.limits}:STAT", words.switches[False])
        self.set_word(f"{words.source}FUNC", "SIN")
        self.send(f"{words.output}:LOAD INF")
        self.set_word(f"{words.source}VOLT:UNIT", "VPP")
        self.send(f"{words.source}VOLT MIN")
        self.set_number(f"{words.source}VOLT:OFFS", 0.0)
        least_vpp = self.number(f"{words.source}VOLT? MIN")
        if words.limits:
            self.set_number(f"{words.limits}:HIGH", self._most_v)
            self.set_number(f"{words.limits}:LOW", -self._most_v)
            self.set_word(f"{words.limits}:STAT", words.switches[True])
        return least_vpp

    @property
    def _most_v(self) -> float:
        """Return the largest voltage allowed at the output, V, of either sign."""
        return self.limits.amplifier.vpp(self.limits.max_voltage_v) / 2

    def _remarks(self) -> tuple[str, ...]:
        return (NO_WATCHDOG,) if self._words.limits else (NO_WATCHDOG, NO_LIMITS)

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
        if on and math.isclose(high_v, most_v, rel_tol=1e-6) and math.isclose(low_v, -most_v):
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
