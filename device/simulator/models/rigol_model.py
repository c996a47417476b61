"""The dialect of the Rigol DG800 and DG1000Z generators, as far as a drive needs it.

Source: Rigol DG800 and DG1000Z Programming Guides. Numbers have seven digits, switches say `ON` and
`OFF`.
"""

from typing import ClassVar

from device.simulator.hardware.power_stage import Instrument
from device.simulator.models import scpi
from device.simulator.models.dialect import asked
from device.simulator.models.generator_channels import Channels, Model
from device.simulator.models.generator_model import GeneratorDialect, models
from device.simulator.models.keysight_settings import Kept
from device.simulator.models.scpi import Call, Handler

_GENERATORS = {
    "rigol": Model(
        idn="Rigol Technologies,DG832,SIM,00.02.05.00.00",
        channels=2,
        digits=6,
        least_emf_vpp=4e-3,
        most_hz=35e6,
        limits=True,
        most_cycles=1_000_000,
    ),
    "rigol-DG1062Z": Model(
        idn="Rigol Technologies,DG1062Z,SIM,03.01.12",
        channels=2,
        digits=6,
        least_emf_vpp=2e-3,
        most_hz=60e6,
        limits=False,
        most_cycles=1_000_000,
    ),
}
_MODULATION, _SUM = "MOD[:STATe]", "SUM[:STATe]"
_TYPES = ("AM", "FM", "PM", "ASKey", "FSKey", "PSKey", "PWM")
SETTINGS = (
    Kept(header=_MODULATION),
    Kept(header="MOD:TYPe", default="AM", words=_TYPES),
    Kept(header="SWEep:STATe"),
    Kept(header="BURSt[:STATe]"),
    Kept(header="HARMonic[:STATe]"),
    Kept(header=_SUM),
    Kept(header="SUM:AMPLitude", default=100.0, lowest=0, highest=100),
    Kept(header="PHASe", lowest=0, highest=360, unit="DEG"),
    Kept(header="PULSe:DCYCle", default=50.0, lowest=0.001, highest=99.999),
    Kept(header="PULSe:WIDTh", default=5e-4, lowest=16e-9, highest=1e6, unit="S"),
    Kept(header="OUTPut#:SYNC[:STATe]", default=1.0),
    Kept(header="OUTPut#:POLarity", default="NORM", words=("NORMal", "INVerted")),
)
FUNCTIONS = ("SINusoid", "SQUare", "RAMP", "PULSe", "NOISe", "USER", "HARMonic", "DC")


class RigolChannels(Channels):
    """Channels in Rigol's words. What is out of range is clipped, and complained about."""

    functions: ClassVar[tuple[str, ...]] = FUNCTIONS
    limit_header = "OUTPut#:VOLLimit"
    limit_state = "[:STATe]"

    def switch_word(self, call: Call, *, on: bool) -> str:
        """Return what a query for a switch answers."""
        return self.word(call, "ON" if on else "OFF")

    def _text(self, value: float) -> str:
        return f"{value:.{self._model.digits}E}"

    def _drive(self) -> dict[str, Handler]:
        # Rigol knows the load by two names.
        impedance = "OUTPut#:IMPedance"
        return {
            **super()._drive(),
            impedance: self._set_load,
            f"{impedance}?": lambda call: self.told(call, self._load(call), 1.0, 10_000.0),
        }

    def _applied(self, function: str) -> Handler:
        """`APPLy` sets everything at once, and leaves the output as it is."""

        def apply(call: Call) -> None:
            channel = self.of(call)
            channel.function = scpi.choice(function, FUNCTIONS)
            values = scpi.split_outside_quotes(call.argument, ",")
            setters: tuple[Handler, ...] = (
                self._set_frequency,
                lambda part: self._set_amplitude(part, part.argument),
                self._set_offset,
                self._set_phase,
            )
            # Noise has no frequency, and a constant voltage neither that nor an amplitude.
            if function == "NOISe":
                setters = setters[1:]
            elif function == "DC":
                setters, values = setters[2:], values[2:]
            for setter, value in zip(setters, values, strict=False):
                setter(Call(argument=value, channel=call.channel))

        return apply

    def _set_phase(self, call: Call) -> None:
        self.of(call).settings["PHASe"] = scpi.quantity(call.argument, scpi.NO_UNIT, 0.0, 360.0)

    def _application(self, call: Call) -> str:
        scpi.nothing(call.argument)
        channel = self.of(call)
        phase = float(channel.settings["PHASe"])
        values = (channel.frequency_hz, channel.amplitude, channel.offset_v, phase)
        return f'"{channel.function},{",".join(self._text(value) for value in values)}"'


class RigolDialect(GeneratorDialect):
    """Answers the commands of a DG832 or DG1062Z."""

    def __init__(self, instrument: Instrument, model: Model) -> None:
        self.idn = model.idn
        channels = RigolChannels(instrument, model)
        handlers = {
            "*IDN?": asked(lambda: self.idn),
            "*RST": asked(self._preset),
            "SYSTem:VERSion?": asked(lambda: "1999.0"),
            **channels.handlers(),
        }
        super().__init__(instrument, channels, SETTINGS, handlers)

    def modulate(self) -> None:
        """Switch frequency modulation on at the panel."""
        self.channels[0].settings |= {_MODULATION: 1.0, "MOD:TYPe": "FM"}

    def add_signal(self) -> None:
        """Add a second signal to channel 1 at the panel."""
        self.channels[0].settings[_SUM] = 1.0

    def _added_emf_vpp(self) -> float:
        settings, emf_vpp = self.channels[0].settings, self.channels[0].emf_vpp
        return float(settings["SUM:AMPLitude"]) / 100 * emf_vpp if settings[_SUM] else 0.0

    def _deviates(self) -> bool:
        settings = self.channels[0].settings
        return bool(settings[_MODULATION]) and settings["MOD:TYPe"] == "FM"


MODELS = models(RigolDialect, _GENERATORS)
