"""Generators that speak SCPI: one order of set-up and one question, with each maker's words."""

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

from device.drivers.generator import (
    AMPLITUDE_REL_TOL,
    NO_LIMITS,
    NO_WATCHDOG,
    Generator,
    Told,
)
from device.link.codec import impedance, number, number_text, switch


@dataclass(frozen=True, kw_only=True)
class Words:
    """What a model calls things.

    Attributes:
        source: what its headers for channel 1 begin with, `SOUR1:` or nothing.
        output: the header of its output.
        limits: the header of its voltage limits; empty where it has none.
        off: what must not be on while the beam is driven: name → header, and the answer then.
        switches: how it says off, and on.
    """

    source: str
    output: str
    limits: str
    off: Mapping[str, tuple[str, str]]
    switches: tuple[str, str]


class ScpiGenerator(Generator):
    """Control a generator whose commands differ from those of others by their words alone."""

    _words: Words

    @abstractmethod
    def _words_of(self, idn: str) -> Words:
        """Return the words of the model that answers `*IDN?` with `idn`."""

    def _set_up(self, idn: str) -> float:
        """Set up; the order matters: what comes later is counted in what came before.

        The smallest amplitude comes before the limits: they cannot be switched on while what is
        set exceeds them.
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
        """What the generator must not exceed, V, on either side of 0."""
        return self.limits.amplifier.vpp(self.limits.max_voltage_v) / 2

    def _remarks(self) -> tuple[str, ...]:
        return (NO_WATCHDOG,) if self._words.limits else (NO_WATCHDOG, NO_LIMITS)

    def _set_vpp(self, vpp: float) -> None:
        header = f"{self._words.source}VOLT"
        self.set_number(header, vpp, AMPLITUDE_REL_TOL, self.amplitude_abs_tol_vpp)

    def _set_frequency(self, frequency_hz: float) -> None:
        self.set_number(f"{self._words.source}FREQ", frequency_hz)

    def _told(self) -> Told:
        words = self._words
        volts, limits = f"{words.source}VOLT", words.limits
        headers = (
            *(words.output, volts, f"{words.source}FREQ"),
            *(f"{words.output}:LOAD", f"{volts}:UNIT", f"{volts}:OFFS", f"{words.source}FUNC"),
            *((f"{limits}:STAT", f"{limits}:HIGH", f"{limits}:LOW") if limits else ()),
            *(header for header, _ in words.off.values()),
        )

        def parsed(answers: list[str]) -> Told:
            said = dict(zip(headers, answers, strict=True))
            return Told(
                output=switch(said[words.output]),
                vpp=number(said[volts]),
                frequency_hz=number(said[f"{words.source}FREQ"]),
                wrong=self._shape_wrong(said) or self._limits_wrong(said) or self._left_on(said),
            )

        return self.link.certain([f"{header}?" for header in headers], parsed)

    def _shape_wrong(self, said: Mapping[str, str]) -> str:
        load, volts = said[f"{self._words.output}:LOAD"], f"{self._words.source}VOLT"
        if math.isfinite(impedance(load)):
            return f"load must be INF, got {load}: twice the voltage"
        unit, function = said[f"{volts}:UNIT"], said[f"{self._words.source}FUNC"]
        offset_v = number(said[f"{volts}:OFFS"])
        if (unit, offset_v, function) == ("VPP", 0, "SIN"):
            return ""
        return (
            "unit, offset and function must be VPP, 0 and SIN, "
            f"got {unit}, {number_text(offset_v)} and {function}"
        )

    def _limits_wrong(self, said: Mapping[str, str]) -> str:
        if not (limits := self._words.limits):
            return ""
        on, most_v = switch(said[f"{limits}:STAT"]), self._most_v
        high_v, low_v = number(said[f"{limits}:HIGH"]), number(said[f"{limits}:LOW"])
        if on and math.isclose(high_v, most_v, rel_tol=1e-6) and math.isclose(low_v, -most_v):
            return ""
        return (
            f"limits must be on at {-most_v:g} and {most_v:g} V, got "
            f"{'on' if on else 'off'} at {low_v:g} and {high_v:g} V"
        )

    def _left_on(self, said: Mapping[str, str]) -> str:
        off_word = self._words.switches[False]
        for name, (header, word) in self._words.off.items():
            if said[header] != word:
                return f"{name} must be {'off' if word == off_word else word}, got {said[header]}"
        return ""
