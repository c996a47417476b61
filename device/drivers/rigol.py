"""The driver of the Rigol DG800 and DG1000Z generators, through an amplifier.

Source: Rigol DG800 and DG1000Z Programming Guides. Each line holds one query, switches answer `ON`
or `OFF`, and numbers have seven digits.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

from device.drivers.generator import ScpiGenerator, Words
from device.drivers.manual import UNIT, Model, Setting, function, limits
from device.link.link import EVENT_ENABLE, Register

_ONE_CHANNEL = {
    "modulation": (":SOUR1:MOD", "OFF"),
    "sweep": (":SOUR1:SWE:STAT", "OFF"),
    "burst": (":SOUR1:BURS", "OFF"),
    "harmonics": (":SOUR1:HARM", "OFF"),
    "sum": (":SOUR1:SUM", "OFF"),
}
_TWO_CHANNELS = {**_ONE_CHANNEL, "second channel": (":OUTP2", "OFF")}


class Rigol(ScpiGenerator):
    """Control a DG800 or a DG1000Z."""

    dialect: ClassVar[str] = "rigol"
    idn: ClassVar["re.Pattern[str]"] = re.compile(
        r"Rigol Technologies,DG(8\d\d|10\d\dZ)", re.IGNORECASE
    )
    expected: ClassVar[str] = "a generator (Rigol DG800 or DG1000Z)"
    health: ClassVar[Mapping[str, str]] = {
        "output": ":OUTP1?",
        "amplitude": ":SOUR1:VOLT?",
        "unit": ":SOUR1:VOLT:UNIT?",
        "offset_v": ":SOUR1:VOLT:OFFS?",
        "frequency_hz": ":SOUR1:FREQ?",
        "function": ":SOUR1:FUNC?",
        "load_ohm": ":OUTP1:LOAD?",
        "modulation": ":SOUR1:MOD?",
    }
    off_command: ClassVar[str] = ":OUTP1 OFF"
    output_query: ClassVar[str] = ":OUTP1?"
    # The answers stand between two numbers, because one line holds one query.
    register: ClassVar[Register] = replace(EVENT_ENABLE, compound=False)
    amplitude_abs_tol_vpp: ClassVar[float] = 1e-3

    def _words_of(self, idn: str) -> Words:
        """Return the names; a DG1000Z has no limits, and a DG811, 821 or 831 has one channel."""
        model = idn.split(",")[1].upper()
        return Words(
            source=":SOUR1:",
            output=":OUTP1",
            limits="" if model.startswith("DG10") else ":OUTP1:VOLL",
            off=_ONE_CHANNEL if model.endswith("1") else _TWO_CHANNELS,
            switches=("OFF", "ON"),
        )


DRIVER = Rigol

# What the guides say, beside all that the driver sends. What is out of range is clipped, and
# complained about.

_SETTINGS = (
    function("SINusoid", "SQUare", "RAMP", "PULSe", "NOISe", "USER", "HARMonic", "DC"),
    UNIT,
    *map(Setting, ("MOD[:STATe]", "SWEep:STATe", "BURSt[:STATe]", "HARMonic[:STATe]")),
    Setting("SUM[:STATe]"),
    Setting("PHASe", default=0.0, lowest=0, highest=360),
    Setting("PULSe:DCYCle", default=50.0, lowest=0.001, highest=99.999),
    Setting("PULSe:WIDTh", default=5e-4, lowest=16e-9, highest=1e6, unit="s"),
    Setting("OUTPut#:SYNC[:STATe]", default=True),
)
_DG1062Z = Model(
    idn="Rigol Technologies,DG1062Z,SIM,03.01.12",
    channels=2,
    digits=6,
    least_emf_vpp=2e-3,
    most_hz=60e6,
    settings=_SETTINGS,
    modulation=("MOD[:STATe]", True),
    addition=("SUM[:STATe]", True),
    # The sum's second signal is as large as the first.
    added_channel=1,
    switches=("OFF", "ON"),
    load=("LOAD", "IMPedance"),
    applies=True,
)
MODELS = {
    "rigol": replace(
        _DG1062Z,
        idn="Rigol Technologies,DG832,SIM,00.02.05.00.00",
        least_emf_vpp=4e-3,
        most_hz=35e6,
        settings=(*_SETTINGS, *limits("OUTPut#:VOLLimit")),
        limit_switch="OUTPut#:VOLLimit[:STATe]",
    ),
    "rigol-DG1062Z": _DG1062Z,
}
