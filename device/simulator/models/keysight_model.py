"""The dialect of the Keysight 33220A and 33500 generators, as far as a drive needs it.

Source: Agilent 33220A User's Guide and 33500 Series Operating and Service Guide.
"""

from device.simulator.hardware.power_stage import FrequencySweep, Instrument
from device.simulator.models.dialect import asked
from device.simulator.models.generator_channels import Channels, Model
from device.simulator.models.generator_model import GeneratorDialect, models
from device.simulator.models.keysight_settings import (
    DONE_AND_FORGOTTEN,
    SETTINGS,
    SETTINGS_33500,
    Kept,
)
from device.simulator.models.scpi import Call, Handler, ScpiError, boolean

_GENERATORS = {
    "keysight": Model(
        idn="Agilent Technologies,33522B,SIM,3.05-1.19-2.00-52-00",
        channels=2,
        digits=15,
        least_emf_vpp=2e-3,
        most_hz=30e6,
        limits=True,
        most_cycles=100_000_000,
    ),
    "keysight-33220A": Model(
        idn="Agilent Technologies,33220A,SIM,2.02-2.02-22-2",
        channels=1,
        digits=13,
        least_emf_vpp=20e-3,
        most_hz=20e6,
        limits=False,
        most_cycles=50_000,
    ),
}


class KeysightDialect(GeneratorDialect):
    """Answers the commands of a 33220A or 33522B."""

    plus = "+"

    def __init__(self, instrument: Instrument, model: Model) -> None:
        self.idn = model.idn
        self._burst_end_s: float | None = None
        settings = (*SETTINGS, *(SETTINGS_33500 if model.limits else ()), *_ranged(model))
        channels = Channels(instrument, model)
        handlers = {
            **self._system(),
            **channels.handlers(),
            **self._sweep_and_burst(),
            **dict.fromkeys(DONE_AND_FORGOTTEN, _done),
        }
        super().__init__(instrument, channels, settings, handlers)

    def modulate(self) -> None:
        """Switch frequency modulation on at the panel."""
        self.channels[0].settings["FM:STATe"] = 1.0

    def add_signal(self) -> None:
        """Add the second channel to the first; a 33220A has no other signal than its modulation."""
        if len(self.channels) == 1:
            self.modulate()
        else:
            self.channels[0].settings["COMBine:FEED"] = "CH2"

    def _added_emf_vpp(self) -> float:
        settings, added_vpp = self.channels[0].settings, 0.0
        if settings.get("SUM:STATe"):
            added_vpp += float(settings["SUM:AMPLitude"]) / 100 * self.channels[0].emf_vpp
        if settings.get("COMBine:FEED") == "CH2":
            added_vpp += self.channels[1].emf_vpp
        return added_vpp

    def _deviates(self) -> bool:
        return bool(self.channels[0].settings["FM:STATe"])

    def _sounding(self) -> bool:
        """A burst that waits for its trigger, or is over, gives nothing."""
        settings = self.channels[0].settings
        # With an immediate trigger bursts follow one another all the time.
        if not settings["BURSt"] or self._trigger_source() == "IMM":
            return True
        # Device time ends a burst, so that a stepped clock does, too.
        return self._burst_end_s is not None and self._instrument.time_s < self._burst_end_s

    def _preset(self) -> None:
        super()._preset()
        for channel in self.channels:
            channel.settings |= {"BURSt": 0.0, "SWEep": 0.0}

    def _system(self) -> dict[str, Handler]:
        return {
            "*IDN?": asked(lambda: self.idn),
            "*OPT?": asked(lambda: "0"),
            "*RST": asked(self._preset),
            "*TRG": asked(self._trigger),
            "TRIGger#[:IMMediate]": asked(self._trigger),
            "SYSTem:VERSion?": asked(lambda: "1999.0"),
            "SYSTem:COMMunicate:RLSTate?": asked(lambda: "REM"),
        }

    def _sweep_and_burst(self) -> dict[str, Handler]:
        return {
            "[SOURce#:]SWEep:STATe": self._switch_sweep,
            "[SOURce#:]SWEep:STATe?": lambda call: self._state(call, "SWEep"),
            "[SOURce#:]BURSt:STATe": self._switch_burst,
            "[SOURce#:]BURSt:STATe?": lambda call: self._state(call, "BURSt"),
        }

    def _state(self, call: Call, name: str) -> str:
        return self._channels.switch_word(call, on=bool(self._channels.of(call).settings[name]))

    def _switch_sweep(self, call: Call) -> None:
        self._channels.of(call).settings["SWEep"] = float(boolean(call.argument))
        if self._trigger_source(call.channel) == "IMM" or not boolean(call.argument):
            self._start_sweep(call.channel)

    def _start_sweep(self, channel: int) -> None:
        settings = self.channels[channel - 1].settings
        # The second channel does not drive the beam.
        if channel != 1:
            return
        self._instrument.sweep = (
            FrequencySweep(
                start_hz=float(settings["FREQuency:STARt"]),
                stop_hz=float(settings["FREQuency:STOP"]),
                begin_s=self._instrument.time_s,
                duration_s=float(settings["SWEep:TIME"]),
            )
            if settings["SWEep"]
            else None
        )

    def _switch_burst(self, call: Call) -> None:
        self._channels.of(call).settings["BURSt"] = float(boolean(call.argument))
        self._burst_end_s = None

    def _trigger_source(self, channel: int = 1) -> str:
        return str(self.channels[channel - 1].settings["TRIGger#:SOURce"])

    def _trigger(self) -> None:
        if self._trigger_source() != "BUS":
            raise ScpiError(-211, "Trigger ignored")
        first = self.channels[0]
        cycles = float(first.settings["BURSt:NCYCles"])
        self._burst_end_s = self._instrument.time_s + cycles / first.frequency_hz
        self._start_sweep(1)


def _ranged(model: Model) -> tuple[Kept, ...]:
    """The settings of sweep and burst that go as far as the model does."""
    top_hz, cycles = model.most_hz, model.most_cycles
    return (
        Kept(header="FREQuency:STARt", default=100.0, lowest=1e-6, highest=top_hz, unit="HZ"),
        Kept(header="FREQuency:STOP", default=1_000.0, lowest=1e-6, highest=top_hz, unit="HZ"),
        Kept(header="BURSt:NCYCles", default=1.0, lowest=1, highest=cycles),
    )


def _done(_: Call) -> None:
    """Accept a command that nothing here depends on."""


MODELS = models(KeysightDialect, _GENERATORS)
