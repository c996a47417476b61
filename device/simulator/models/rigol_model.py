"""The dialect of the Rigol DG800 and DG1000Z generators, as far as it is spoken to.

Source: Rigol DG800 and DG1000Z Programming Guides. Numbers have seven digits, switches say `ON` and
`OFF`. What is out of range is clipped, and complained about.
"""

from typing import ClassVar

from device.simulator.hardware.power_stage import Instrument
from device.simulator.models import scpi
from device.simulator.models.generator_model import GeneratorDialect, Kept, Model, models
from device.simulator.models.scpi import SECONDS, Call, Handler

_GENERATORS = {
    "rigol": Model(
        idn="Rigol Technologies,DG832,SIM,00.02.05.00.00",
        channels=2,
        digits=6,
        least_emf_vpp=4e-3,
        most_hz=35e6,
        limits=True,
    ),
    "rigol-DG1062Z": Model(
        idn="Rigol Technologies,DG1062Z,SIM,03.01.12",
        channels=2,
        digits=6,
        least_emf_vpp=2e-3,
        most_hz=60e6,
        limits=False,
    ),
}
SETTINGS = (
    Kept(header="MOD[:STATe]"),
    Kept(header="SWEep:STATe"),
    Kept(header="BURSt[:STATe]"),
    Kept(header="HARMonic[:STATe]"),
    Kept(header="SUM[:STATe]"),
    Kept(header="PHASe", lowest=0, highest=360),
    Kept(header="PULSe:DCYCle", default=50.0, lowest=0.001, highest=99.999),
    Kept(header="PULSe:WIDTh", default=5e-4, lowest=16e-9, highest=1e6, units=SECONDS),
    Kept(header="OUTPut#:SYNC[:STATe]", default=1.0),
)


class RigolDialect(GeneratorDialect):
    """Answers the commands of a DG832 or DG1062Z."""

    functions: ClassVar[tuple[str, ...]] = (
        "SINusoid", "SQUare", "RAMP", "PULSe", "NOISe", "USER", "HARMonic", "DC",
    )  # fmt: skip
    limit_header: ClassVar[str] = "OUTPut#:VOLLimit"
    limit_state: ClassVar[str] = "[:STATe]"
    modulation = ("MOD[:STATe]", 1.0)
    addition = ("SUM[:STATe]", 1.0)
    # The sum's second signal is as large as the first.
    added_channel = 1

    def __init__(self, instrument: Instrument, model: Model) -> None:
        super().__init__(instrument, model, SETTINGS)

    def _switch_word(self, call: Call, *, on: bool) -> str:
        scpi.nothing(call.argument)
        return "ON" if on else "OFF"

    def _text(self, value: float) -> str:
        return f"{value:.{self._model.digits}E}"

    def _handlers(self) -> dict[str, Handler]:
        handlers = super()._handlers()
        apply = "[SOURce#:]APPLy"
        return {
            **handlers,
            # Rigol knows the load by two names.
            "OUTPut#:IMPedance": handlers["OUTPut#:LOAD"],
            "OUTPut#:IMPedance?": handlers["OUTPut#:LOAD?"],
            **{
                f"{apply}:{function}": self._applied(function, handlers["[SOURce#:]PHASe"])
                for function in self.functions
            },
            f"{apply}?": self._application,
        }

    def _applied(self, function: str, set_phase: Handler) -> Handler:
        """`APPLy` sets everything at once, and leaves the output as it is."""

        def apply(call: Call) -> None:
            self.of(call).function = scpi.choice(function, self.functions)
            values = scpi.split_outside_quotes(call.argument, ",")
            setters: tuple[Handler, ...] = (
                self._set_frequency,
                self._set_amplitude,
                self._set_offset,
                set_phase,
            )
            # Noise has no frequency, and a constant voltage neither that nor an amplitude.
            if function == "NOISe":
                setters = setters[1:]
            elif function == "DC":
                setters, values = setters[2:], values[2:]
            # Not strict, because the last values may be left out.
            for setter, value in zip(setters, values, strict=False):
                setter(Call(argument=value, channel=call.channel))

        return apply

    def _application(self, call: Call) -> str:
        scpi.nothing(call.argument)
        channel = self.of(call)
        phase = float(channel.settings["PHASe"])
        values = (channel.frequency_hz, channel.amplitude, channel.offset_v, phase)
        return f'"{channel.function},{",".join(self._text(value) for value in values)}"'


MODELS = models(RigolDialect, _GENERATORS)
