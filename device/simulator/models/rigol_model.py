"""The dialect of the Rigol DG800 and DG1000Z generators, as far as it is spoken to.

Source: Rigol DG800 and DG1000Z Programming Guides. Numbers have seven digits, switches say `ON` and
`OFF`. What is out of range is clipped, and complained about.
"""

from functools import partial

from device.simulator.models import scpi
from device.simulator.models.generator_model import (
    UNIT,
    Command,
    GeneratorDialect,
    Model,
    function,
    limits,
)
from device.simulator.models.scpi import SECONDS, Call, Handler

_FUNCTIONS = ("SINusoid", "SQUare", "RAMP", "PULSe", "NOISe", "USER", "HARMonic", "DC")
_SETTINGS = (
    function(*_FUNCTIONS),
    UNIT,
    Command(header="MOD[:STATe]"),
    Command(header="SWEep:STATe"),
    Command(header="BURSt[:STATe]"),
    Command(header="HARMonic[:STATe]"),
    Command(header="SUM[:STATe]"),
    Command(header="PHASe", default=0.0, lowest=0, highest=360),
    Command(header="PULSe:DCYCle", default=50.0, lowest=0.001, highest=99.999),
    Command(header="PULSe:WIDTh", default=5e-4, lowest=16e-9, highest=1e6, units=SECONDS),
    Command(header="OUTPut#:SYNC[:STATe]", default=True),
)
_GENERATORS = {
    "rigol": Model(
        idn="Rigol Technologies,DG832,SIM,00.02.05.00.00",
        channels=2,
        digits=6,
        least_emf_vpp=4e-3,
        most_hz=35e6,
        settings=(*_SETTINGS, *limits("OUTPut#:VOLLimit")),
        limit_switch="OUTPut#:VOLLimit[:STATe]",
    ),
    "rigol-DG1062Z": Model(
        idn="Rigol Technologies,DG1062Z,SIM,03.01.12",
        channels=2,
        digits=6,
        least_emf_vpp=2e-3,
        most_hz=60e6,
        settings=_SETTINGS,
    ),
}


class RigolDialect(GeneratorDialect):
    """Answers the commands of a DG832 or DG1062Z."""

    switches = ("OFF", "ON")
    modulation = ("MOD[:STATe]", True)
    addition = ("SUM[:STATe]", True)
    # The sum's second signal is as large as the first.
    added_channel = 1

    def _handlers(self) -> dict[str, Handler]:
        handlers, apply = super()._handlers(), "[SOURce#:]APPLy"
        set_phase = handlers["[SOURce#:]PHASe"]
        return {
            **handlers,
            # Rigol knows the load by two names.
            "OUTPut#:IMPedance": handlers["OUTPut#:LOAD"],
            "OUTPut#:IMPedance?": handlers["OUTPut#:LOAD?"],
            **{f"{apply}:{word}": self._applied(word, set_phase) for word in _FUNCTIONS},
            f"{apply}?": self._application,
        }

    def _applied(self, word: str, set_phase: Handler) -> Handler:
        """`APPLy` sets everything at once, and leaves the output as it is."""

        def apply(call: Call) -> None:
            self.of(call).function = scpi.choice(word, _FUNCTIONS)
            values = scpi.split_outside_quotes(call.argument, ",")
            setters: tuple[Handler, ...] = (
                *(self._set_frequency, self._set_amplitude, self._set_offset),
                set_phase,
            )
            # Noise has no frequency, and a constant voltage neither that nor an amplitude.
            if word == "NOISe":
                setters = setters[1:]
            elif word == "DC":
                setters, values = setters[2:], values[2:]
            # Not strict, because the last values may be left out.
            for setter, value in zip(setters, values, strict=False):
                setter(Call(argument=value, channel=call.channel))

        return apply

    def _application(self, call: Call) -> str:
        scpi.nothing(call.argument)
        channel = self.of(call)
        phase, vpp = float(channel.settings["PHASe"]), channel.shown * channel.emf_vpp
        values = (channel.frequency_hz, vpp / channel.unit_vpp, channel.offset_v, phase)
        return f'"{channel.function},{",".join(map(self._text, values))}"'


MODELS = {name: partial(RigolDialect, model) for name, model in _GENERATORS.items()}
