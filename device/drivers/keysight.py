"""The driver of the Keysight (Agilent) 33220A and 33500 generators, through an amplifier.

Source: Agilent 33220A User's Guide and 33500 Series Operating and Service Guide.
"""

import re
from collections.abc import Mapping
from typing import ClassVar

from device.drivers.generator import ScpiGenerator, Words

_SWITCHES = ("0", "1")
_MODULATIONS = {
    "AM": ("AM:STAT", "0"),
    "FM": ("FM:STAT", "0"),
    "PM": ("PM:STAT", "0"),
    "PWM": ("PWM:STAT", "0"),
    "FSK": ("FSK:STAT", "0"),
    "sweep": ("SWE:STAT", "0"),
    "burst": ("BURS:STAT", "0"),
}
_OF_33500 = {
    **{name: (f"SOUR1:{header}", word) for name, (header, word) in _MODULATIONS.items()},
    "BPSK": ("SOUR1:BPSK:STAT", "0"),
    "sum": ("SOUR1:SUM:STAT", "0"),
    # In the mode LIST a generator steps through frequencies by itself.
    "frequency mode": ("SOUR1:FREQ:MODE", "CW"),
}
_OF_TWO_CHANNELS = {
    **_OF_33500,
    "combined channel": ("SOUR1:COMB:FEED", "NONE"),
    "second channel": ("OUTP2", "0"),
}


class Keysight(ScpiGenerator):
    """Control a 33220A, 33500 or 33600."""

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

    def _words_of(self, idn: str) -> Words:
        """Return the names; a 33220A has no limits, and 33510, 12, 20 and 22 have two channels."""
        model = idn.split(",")[1]
        if model.startswith("33220"):
            return Words(source="", output="OUTP", limits="", off=_MODULATIONS, switches=_SWITCHES)
        return Words(
            source="SOUR1:",
            output="OUTP1",
            limits="SOUR1:VOLT:LIM",
            # A model with one channel would refuse the commands of a second one.
            off=_OF_TWO_CHANNELS if model[4] in "02" else _OF_33500,
            switches=_SWITCHES,
        )


DRIVER = Keysight
