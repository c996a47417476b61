"""The driver of the Keysight (Agilent) 33220A and 33500 generators, through an amplifier.

Source: Agilent 33220A User's Guide and 33500 Series Operating and Service Guide. Their amplitudes
are peak-to-peak, and right only if the generator knows that its load is open.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from device.drivers.generator import (
    AMPLITUDE_REL_TOL,
    NO_LIMITS,
    NO_WATCHDOG,
    Generator,
    Off,
    Told,
    left_on,
)
from device.link.codec import impedance, number, number_text, switch


@dataclass(frozen=True, kw_only=True)
class Model:
    """What differs between the models, as `*IDN?` names them."""

    has_limits: bool
    channels: int

    @classmethod
    def of(cls, idn: str) -> "Model":
        """Return what the model is that answers `*IDN?` with `idn`.

        >>> Model.of("Agilent Technologies,33522B,MY52800123,3.05").channels
        2
        """
        number = idn.split(",")[1]
        has_limits = not number.startswith("33220")
        # 33510, 33512, 33520 and 33522 have two channels, 33509, 33511, 33519 and 33521 one.
        return cls(
            has_limits=has_limits, channels=2 if has_limits and number[4:5] in {"0", "2"} else 1
        )

    @property
    def off(self) -> Mapping[str, Off]:
        """What must not be on."""
        if not self.has_limits:
            return _OFF_33220A
        return _OFF_33500 if self.channels == 1 else {**_OFF_33500, **_OFF_TWO_CHANNELS}


_LIMITS = ("SOUR1:VOLT:LIM:STAT?", "SOUR1:VOLT:LIM:HIGH?", "SOUR1:VOLT:LIM:LOW?")
_OFF_33220A = {
    "AM": Off(header="AM:STAT"),
    "FM": Off(header="FM:STAT"),
    "PM": Off(header="PM:STAT"),
    "PWM": Off(header="PWM:STAT"),
    "FSK": Off(header="FSK:STAT"),
    "sweep": Off(header="SWE:STAT"),
    "burst": Off(header="BURS:STAT"),
}
_OFF_33500 = {
    **{name: Off(header=f"SOUR1:{off.header}") for name, off in _OFF_33220A.items()},
    "BPSK": Off(header="SOUR1:BPSK:STAT"),
    "sum": Off(header="SOUR1:SUM:STAT"),
    "frequency mode": Off(header="SOUR1:FREQ:MODE", word="CW"),
}
_OFF_TWO_CHANNELS = {
    "combined channel": Off(header="SOUR1:COMB:FEED", word="NONE"),
    "second channel": Off(header="OUTP2"),
}


class Keysight(Generator):
    """Control a 33220A, 33500 or 33600. Everything is asked for in one compound query."""

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
    _model = Model(has_limits=False, channels=1)
    _source = ""
    _output = "OUTP"

    def _set_up(self, idn: str) -> float:
        """Set up; the order matters: what comes later is counted in what came before.

        The smallest amplitude comes before the limits: they cannot be switched on while what is
        set exceeds them.
        """
        self._model = Model.of(idn)
        if self._model.has_limits:
            self._source, self._output, self.on_command = "SOUR1:", "OUTP1", "OUTP1 ON"
        source = self._source
        for setting in self._model.off.values():
            self.set_word(setting.header, setting.word)
        if self._model.has_limits:
            self.set_word(f"{source}VOLT:LIM:STAT", "0")
        self.set_word(f"{source}FUNC", "SIN")
        self.send(f"{self._output}:LOAD INF")
        self.set_word(f"{source}VOLT:UNIT", "VPP")
        self.send(f"{source}VOLT MIN")
        self.set_number(f"{source}VOLT:OFFS", 0.0)
        least_vpp = self.number(f"{source}VOLT? MIN")
        self._set_limits()
        return least_vpp

    def _set_limits(self) -> None:
        if self._model.has_limits:
            self.set_number(f"{self._source}VOLT:LIM:HIGH", self._most_v)
            self.set_number(f"{self._source}VOLT:LIM:LOW", -self._most_v)
            self.set_word(f"{self._source}VOLT:LIM:STAT", "1")

    @property
    def _most_v(self) -> float:
        return self.limits.amplifier.vpp(self.limits.max_voltage_v) / 2

    def _remarks(self) -> tuple[str, ...]:
        return (NO_WATCHDOG,) if self._model.has_limits else (NO_WATCHDOG, NO_LIMITS)

    def _set_vpp(self, vpp: float) -> None:
        self.set_number(f"{self._source}VOLT", vpp, AMPLITUDE_REL_TOL)

    def _set_frequency(self, frequency_hz: float) -> None:
        self.set_number(f"{self._source}FREQ", frequency_hz)

    def _told(self) -> Told:
        source, output = self._source, self._output
        queries = (
            *(f"{output}?", f"{source}VOLT?", f"{source}FREQ?"),
            *(f"{output}:LOAD?", f"{source}VOLT:UNIT?", f"{source}VOLT:OFFS?", f"{source}FUNC?"),
            *(_LIMITS if self._model.has_limits else ()),
            *(setting.query for setting in self._model.off.values()),
        )

        def parsed(answers: list[str]) -> Told:
            said = dict(zip(queries, answers, strict=True))
            return Told(
                output=switch(said[f"{output}?"]),
                vpp=number(said[f"{source}VOLT?"]),
                frequency_hz=number(said[f"{source}FREQ?"]),
                wrong=self._shape_wrong(said)
                or self._limits_wrong(said)
                or left_on(self._model.off, said),
            )

        return self.link.certain(queries, parsed)

    def _shape_wrong(self, said: Mapping[str, str]) -> str:
        load, volts = said[f"{self._output}:LOAD?"], f"{self._source}VOLT"
        if math.isfinite(impedance(load)):
            return f"load must be INF, got {load}: twice the voltage"
        unit, function = said[f"{volts}:UNIT?"], said[f"{self._source}FUNC?"]
        offset_v = number(said[f"{volts}:OFFS?"])
        if (unit, offset_v, function) == ("VPP", 0, "SIN"):
            return ""
        return (
            "unit, offset and function must be VPP, 0 and SIN, "
            f"got {unit}, {number_text(offset_v)} and {function}"
        )

    def _limits_wrong(self, said: Mapping[str, str]) -> str:
        if not self._model.has_limits:
            return ""
        on, (high_v, low_v) = (
            switch(said[_LIMITS[0]]),
            (number(said[asked]) for asked in _LIMITS[1:]),
        )
        most_v = self._most_v
        if on and math.isclose(high_v, most_v, rel_tol=1e-6) and math.isclose(low_v, -most_v):
            return ""
        return (
            f"limits must be on at {-most_v:g} and {most_v:g} V, got "
            f"{'on' if on else 'off'} at {low_v:g} and {high_v:g} V"
        )


DRIVER = Keysight
