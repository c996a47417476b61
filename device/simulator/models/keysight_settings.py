"""What a Keysight generator keeps and tells without the drive depending on it: a table.

Source: Agilent 33220A User's Guide and 33500 Series Operating and Service Guide.
"""

from dataclasses import dataclass

Unit = str


@dataclass(frozen=True, kw_only=True)
class Kept:
    """A number with unit and range, one of `words`, free text, or, with none of these, a switch."""

    header: str
    default: float | str = 0.0
    lowest: float = 0.0
    highest: float = 0.0
    unit: Unit = ""
    words: tuple[str, ...] = ()
    text: bool = False
    per_channel: bool = True

    @property
    def is_switch(self) -> bool:
        """Whether this is on or off."""
        return not (self.words or self.text) and self.highest == self.lowest


_TRIGGERS = ("IMMediate", "EXTernal", "BUS", "TIMer")
SETTINGS = (
    Kept(header="PHASe", lowest=-360, highest=360, unit="DEG"),
    Kept(header="FUNCtion:SQUare:DCYCle", default=50.0, lowest=0.01, highest=99.99),
    Kept(header="FUNCtion:SQUare:PERiod", default=1e-3, lowest=33e-9, highest=1e6, unit="S"),
    Kept(header="FUNCtion:RAMP:SYMMetry", default=100.0, lowest=0, highest=100),
    Kept(header="FUNCtion:PULSe:PERiod", default=1e-3, lowest=33e-9, highest=1e6, unit="S"),
    Kept(header="PULSe:PERiod", default=1e-3, lowest=200e-9, highest=2e3, unit="S"),
    Kept(header="FUNCtion:PULSe:HOLD", default="WIDT", words=("WIDTh", "DCYCle")),
    Kept(header="FUNCtion:PULSe:WIDTh", default=1e-4, lowest=16e-9, highest=1e6, unit="S"),
    Kept(header="FUNCtion:PULSe:DCYCle", default=10.0, lowest=0, highest=100),
    Kept(
        header="FUNCtion:PULSe:TRANsition[:BOTH]",
        default=10e-9,
        lowest=5e-9,
        highest=1e-6,
        unit="S",
    ),
    Kept(header="FUNCtion:NOISe:BANDwidth", default=1e5, lowest=1e-3, highest=3e7, unit="HZ"),
    Kept(header="FUNCtion:ARBitrary", default="EXP_RISE", text=True),
    Kept(header="FUNCtion:USER", default="EXP_RISE", text=True),
    Kept(header="FUNCtion:ARBitrary:SRATe", default=4e4, lowest=1e-6, highest=250e6),
    Kept(header="FUNCtion:ARBitrary:ADVance", default="SRAT", words=("SRATe", "TRIGger")),
    Kept(header="FUNCtion:ARBitrary:FILTer", default="NORM", words=("NORMal", "STEP", "OFF")),
    Kept(header="FREQuency:MODE", default="CW", words=("CW", "LIST", "SWEep", "FIXed")),
    Kept(header="SWEep:TIME", default=1.0, lowest=1e-3, highest=500.0, unit="S"),
    Kept(header="SWEep:SPACing", default="LIN", words=("LINear", "LOGarithmic")),
    Kept(header="BURSt:MODE", default="TRIG", words=("TRIGgered", "GATed")),
    Kept(header="BURSt:INTernal:PERiod", default=1e-2, lowest=1e-6, highest=8e3, unit="S"),
    Kept(header="BURSt:PHASe", lowest=-360, highest=360, unit="DEG"),
    Kept(header="BURSt:GATE:POLarity", default="NORM", words=("NORMal", "INVerted")),
    Kept(header="VOLTage:RANGe:AUTO"),
    Kept(header="AM:STATe"),
    Kept(header="FM:STATe"),
    Kept(header="PM:STATe"),
    Kept(header="PWM:STATe"),
    Kept(header="FSKey:STATe"),
    Kept(header="OUTPut#:POLarity", default="NORM", words=("NORMal", "INVerted")),
    Kept(header="OUTPut#:SYNC[:STATe]", default=1.0),
    Kept(header="OUTPut:SYNC:SOURce", default="CH1", words=("CH1", "CH2"), per_channel=False),
    Kept(header="OUTPut:TRIGger[:STATe]", per_channel=False),
    Kept(header="OUTPut:TRIGger:SLOPe", default="POS", words=("POSitive", "NEGative")),
    Kept(header="OUTPut:TRIGger:SOURce", default="CH1", words=("CH1", "CH2"), per_channel=False),
    Kept(header="TRIGger#:SOURce", default="IMM", words=_TRIGGERS),
    Kept(header="TRIGger#:SLOPe", default="POS", words=("POSitive", "NEGative")),
    Kept(header="TRIGger#:DELay", lowest=0, highest=1e3, unit="S"),
    Kept(header="TRIGger#:COUNt", default=1.0, lowest=1, highest=1e6),
    Kept(header="TRIGger#:TIMer", default=1.0, lowest=1e-6, highest=8e3, unit="S"),
    Kept(header="UNIT:ANGLe", default="DEG", words=("DEGree", "RADian", "SECond")),
    Kept(header="DISPlay[:STATe]", default=1.0, per_channel=False),
    Kept(header="FORMat:BORDer", default="NORM", words=("NORMal", "SWAPped"), per_channel=False),
    Kept(header="SYSTem:BEEPer:STATe", default=1.0, per_channel=False),
)

SETTINGS_33500 = (
    Kept(header="BPSK:STATe"),
    Kept(header="SUM:STATe"),
    Kept(header="SUM:AMPLitude", default=0.1, lowest=0, highest=100),
    Kept(header="COMBine:FEED", default="NONE", words=("CH1", "CH2", "NONE")),
)
"""What the 33220A does not have."""

FUNCTIONS = (
    "SINusoid", "SQUare", "TRIangle", "RAMP", "PULSe", "PRBS", "NOISe", "ARB", "USER", "DC",
)  # fmt: skip
DONE_AND_FORGOTTEN = (
    "SYSTem:BEEPer[:IMMediate]",
    "SYSTem:LOCal",
    "SYSTem:REMote",
    "SYSTem:RWLock",
    "SYSTem:COMMunicate:RLSTate",
    "DISPlay:TEXT",
    "DISPlay:TEXT:CLEar",
    "PHASe:SYNChronize",
    "[SOURce#:]PHASe:SYNChronize",
    "[SOURce#:]DATA:VOLatile:CLEar",
    "[SOURce#:]DATA:ARBitrary[:DAC]",
    "[SOURce#:]DATA:ARBitrary#[:DAC]",
)
"""Accepted without anything in the simulation that depends on them."""
