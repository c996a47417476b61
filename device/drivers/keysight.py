"""The driver of the Keysight (Agilent) 33220A and 33500 generators, through an amplifier.

Source: Agilent 33220A User's Guide and 33500 Series Operating and Service Guide.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

from device.drivers.generator import ScpiGenerator, Words
from device.drivers.manual import UNIT, Model, Setting, function, limits

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

# What the manuals say, beside all that the driver sends.

_SETTINGS = (
    function(
        "SINusoid", "SQUare", "TRIangle", "RAMP", "PULSe", "PRBS", "NOISe", "ARB", "USER", "DC"
    ),
    UNIT,
    Setting("PHASe", default=0.0, lowest=-360, highest=360),
    Setting("FUNCtion:SQUare:DCYCle", default=50.0, lowest=0.01, highest=99.99),
    Setting("FUNCtion:RAMP:SYMMetry", default=100.0, lowest=0, highest=100),
    Setting("FUNCtion:PULSe:PERiod", default=1e-3, lowest=33e-9, highest=1e6, unit="s"),
    Setting("PULSe:PERiod", default=1e-3, lowest=200e-9, highest=2e3, unit="s"),
    Setting("FUNCtion:PULSe:HOLD", default="WIDT", words=("WIDTh", "DCYCle")),
    Setting("FUNCtion:PULSe:WIDTh", default=1e-4, lowest=16e-9, highest=1e6, unit="s"),
    Setting("FUNCtion:PULSe:DCYCle", default=10.0, lowest=0, highest=100),
    Setting("FUNCtion:PULSe:TRANsition[:BOTH]", default=1e-8, lowest=5e-9, highest=1e-6),
    Setting("FUNCtion:ARBitrary", default="EXP_RISE", words=("EXP_RISE",)),
    Setting("FUNCtion:ARBitrary:SRATe", default=4e4, lowest=1e-6, highest=250e6),
    Setting("FUNCtion:ARBitrary:ADVance", default="SRAT", words=("SRATe", "TRIGger")),
    Setting("FUNCtion:ARBitrary:FILTer", default="NORM", words=("NORMal", "STEP", "OFF")),
    Setting("FREQuency:MODE", default="CW", words=("CW", "LIST", "SWEep", "FIXed")),
    *map(Setting, ("SWEep:STATe", "BURSt:STATe", "AM:STATe", "FM:STATe", "PM:STATe", "PWM:STATe")),
    *map(Setting, ("FSKey:STATe", "OUTPut:TRIGger[:STATe]")),
    Setting("BURSt:MODE", default="TRIG", words=("TRIGgered", "GATed")),
    Setting("BURSt:NCYCles", default=1.0, lowest=1, highest=50_000),
    Setting("BURSt:INTernal:PERiod", default=1e-2, lowest=1e-6, highest=8e3, unit="s"),
    Setting(
        header="TRIGger#:SOURce", default="IMM", words=("IMMediate", "EXTernal", "BUS", "TIMer")
    ),
    Setting("SYSTem:BEEPer:STATe", default=True),
)
_SETTINGS_OF_33500 = (
    *limits("VOLTage:LIMit"),
    *map(Setting, ("BPSK:STATe", "SUM:STATe")),
    Setting("COMBine:FEED", default="NONE", words=("CH1", "CH2", "NONE")),
)
_33220A = Model(
    idn="Agilent Technologies,33220A,SIM,2.02-2.02-22-2",
    channels=1,
    digits=13,
    least_emf_vpp=20e-3,
    most_hz=20e6,
    settings=_SETTINGS,
    modulation=("FM:STATe", True),
    addition=("COMBine:FEED", "CH2"),
    plus="+",
    answers={"*OPT?": "0"},
)
MODELS = {
    "keysight": replace(
        _33220A,
        idn="Agilent Technologies,33522B,SIM,3.05-1.19-2.00-52-00",
        channels=2,
        digits=15,
        least_emf_vpp=2e-3,
        most_hz=30e6,
        settings=(*_SETTINGS, *_SETTINGS_OF_33500),
        limit_switch="[SOURce#:]VOLTage:LIMit:STATe",
    ),
    "keysight-33220A": _33220A,
}
