"""The dialect of the Keysight 33220A and 33500 generators, as far as it is spoken to.

Source: Agilent 33220A User's Guide and 33500 Series Operating and Service Guide.
"""

from functools import partial

from device.simulator.models.dialect import asked
from device.simulator.models.generator_model import (
    UNIT,
    Command,
    GeneratorDialect,
    Model,
    function,
    limits,
)
from device.simulator.models.scpi import SECONDS, Handler, ScpiError

_SETTINGS = (
    function(
        "SINusoid", "SQUare", "TRIangle", "RAMP", "PULSe", "PRBS", "NOISe", "ARB", "USER", "DC"
    ),
    UNIT,
    Command(header="PHASe", default=0.0, lowest=-360, highest=360),
    Command(header="FUNCtion:SQUare:DCYCle", default=50.0, lowest=0.01, highest=99.99),
    Command(header="FUNCtion:RAMP:SYMMetry", default=100.0, lowest=0, highest=100),
    Command(header="FUNCtion:PULSe:PERiod", default=1e-3, lowest=33e-9, highest=1e6, units=SECONDS),
    Command(header="PULSe:PERiod", default=1e-3, lowest=200e-9, highest=2e3, units=SECONDS),
    Command(header="FUNCtion:PULSe:HOLD", default="WIDT", words=("WIDTh", "DCYCle")),
    Command(header="FUNCtion:PULSe:WIDTh", default=1e-4, lowest=16e-9, highest=1e6, units=SECONDS),
    Command(header="FUNCtion:PULSe:DCYCle", default=10.0, lowest=0, highest=100),
    Command(header="FUNCtion:PULSe:TRANsition[:BOTH]", default=1e-8, lowest=5e-9, highest=1e-6),
    Command(header="FUNCtion:ARBitrary", default="EXP_RISE", words=("EXP_RISE",)),
    Command(header="FUNCtion:ARBitrary:SRATe", default=4e4, lowest=1e-6, highest=250e6),
    Command(header="FUNCtion:ARBitrary:ADVance", default="SRAT", words=("SRATe", "TRIGger")),
    Command(header="FUNCtion:ARBitrary:FILTer", default="NORM", words=("NORMal", "STEP", "OFF")),
    Command(header="FREQuency:MODE", default="CW", words=("CW", "LIST", "SWEep", "FIXed")),
    Command(header="SWEep:STATe"),
    Command(header="BURSt:STATe"),
    Command(header="BURSt:MODE", default="TRIG", words=("TRIGgered", "GATed")),
    Command(header="BURSt:NCYCles", default=1.0, lowest=1, highest=50_000),
    Command(header="BURSt:INTernal:PERiod", default=1e-2, lowest=1e-6, highest=8e3, units=SECONDS),
    Command(header="AM:STATe"),
    Command(header="FM:STATe"),
    Command(header="PM:STATe"),
    Command(header="PWM:STATe"),
    Command(header="FSKey:STATe"),
    Command(header="OUTPut:TRIGger[:STATe]"),
    Command(
        header="TRIGger#:SOURce", default="IMM", words=("IMMediate", "EXTernal", "BUS", "TIMer")
    ),
    Command(header="SYSTem:BEEPer:STATe", default=True),
)
_OF_33500 = (
    *limits("VOLTage:LIMit"),
    Command(header="BPSK:STATe"),
    Command(header="SUM:STATe"),
    Command(header="COMBine:FEED", default="NONE", words=("CH1", "CH2", "NONE")),
)
_GENERATORS = {
    "keysight": Model(
        idn="Agilent Technologies,33522B,SIM,3.05-1.19-2.00-52-00",
        channels=2,
        digits=15,
        least_emf_vpp=2e-3,
        most_hz=30e6,
        settings=(*_SETTINGS, *_OF_33500),
        limit_switch="[SOURce#:]VOLTage:LIMit:STATe",
    ),
    "keysight-33220A": Model(
        idn="Agilent Technologies,33220A,SIM,2.02-2.02-22-2",
        channels=1,
        digits=13,
        least_emf_vpp=20e-3,
        most_hz=20e6,
        settings=_SETTINGS,
    ),
}


class KeysightDialect(GeneratorDialect):
    """Answers the commands of a 33220A or 33522B."""

    plus = "+"
    modulation = ("FM:STATe", True)
    addition = ("COMBine:FEED", "CH2")
    _burst_end_s = 0.0

    def _sounding(self) -> bool:
        """A burst that waits for its trigger, or is over, gives nothing."""
        settings = self.channels[0].settings
        # With an immediate trigger bursts follow one another all the time.
        if not settings["BURSt:STATe"] or settings["TRIGger#:SOURce"] == "IMM":
            return True
        # Device time ends a burst, so that a stepped clock does, too.
        return self._instrument.time_s < self._burst_end_s

    def _handlers(self) -> dict[str, Handler]:
        own = {"*OPT?": asked(lambda: "0"), "*TRG": asked(self._trigger)}
        return {**super()._handlers(), **own}

    def _trigger(self) -> None:
        first = self.channels[0]
        if first.settings["TRIGger#:SOURce"] != "BUS":
            raise ScpiError(-211, "Trigger ignored")
        cycles = float(first.settings["BURSt:NCYCles"])
        self._burst_end_s = self._instrument.time_s + cycles / first.frequency_hz


MODELS = {name: partial(KeysightDialect, model) for name, model in _GENERATORS.items()}
