"""The dialect of the Siglent SDG generators of the X series, as far as it is spoken to.

Source: Siglent SDG Series Programming Guide (PG02). There is no error queue: what is not understood
does nothing, and what is out of range is clipped.
"""

import math
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from itertools import pairwise

from device.drivers.manual import Model
from device.simulator.hardware.power_stage import Instrument
from device.simulator.models.generator_model import GeneratorDialect
from device.simulator.models.scpi import Handler, ScpiError

_GENERATORS = {
    "siglent": Model(
        idn="Siglent Technologies,SDG2042X,SIM,2.01.01.23R7",
        channels=2,
        digits=6,
        least_emf_vpp=4e-3,
        most_hz=40e6,
        modulation=("MDWV", "ON"),
        addition=("CMBN", "ON"),
    )
}
WAVES = ("SINE", "SQUARE", "RAMP", "PULSE", "NOISE", "ARB", "DC")
_MODES = ("MDWV", "SWWV", "BTWV")
"""Only one of them can be on."""
_LINE = re.compile(r"(?:C([12]):)?([*A-Z_]+)(\?)?(?:\s+(.*))?")
_NUMBER = re.compile(r"([-+]?[\d.]+(?:E[-+]?\d+)?)([A-Z]*)")
_UNITS = {"": 1.0, "HZ": 1.0, "KHZ": 1e3, "MHZ": 1e6, "V": 1.0, "VPP": 1.0, "MV": 1e-3}
_COUPLED = ("TRACE", "FCOUP", "PCOUP", "ACOUP")
FIRST_EMF_VPP = 4.0
_Answer = Callable[[int], str]
_Put = Callable[[int, list[str]], None]


class SiglentDialect(GeneratorDialect):
    """Answers the commands of an SDG2042X."""

    def __init__(self, model: Model, instrument: Instrument, beam: object) -> None:
        self._coupled = dict.fromkeys(_COUPLED, "OFF")
        super().__init__(model, instrument, beam)
        # What a query answers, and what a command does with its words, each on a channel.
        self._commands: dict[str, tuple[_Answer, _Put]] = {
            "OUTP": (self._output, self._set_output),
            "BSWV": (self._wave, self._set_wave),
            "HARM": (lambda number: f"HARMSTATE,{self._kept('HARM', number)}", self._put("HARM")),
            "CMBN": (partial(self._kept, "CMBN"), self._put("CMBN")),
            "COUP": (lambda _: ",".join(map(",".join, self._coupled.items())), self._couple),
            **{mode: (partial(self._mode, mode), partial(self._set_mode, mode)) for mode in _MODES},
        }

    def answer(self, line: str) -> str | None:
        answer = self._line_answer(line.strip().upper())
        self.follow()
        return answer

    def _handlers(self) -> dict[str, Handler]:
        """Return none of SCPI: `answer` reads the lines of this dialect itself."""
        return {}

    def _preset(self) -> None:
        super()._preset()
        self._coupled |= dict.fromkeys(_COUPLED, "OFF")
        for channel in self.channels:
            channel.function, channel.load_ohm = "SINE", math.inf
            channel.emf_vpp = FIRST_EMF_VPP
            channel.settings |= dict.fromkeys((*_MODES, "HARM", "CMBN"), "OFF")
            channel.settings |= {"PLRT": "NOR", "PHSE": 0.0}

    def _line_answer(self, line: str) -> str | None:
        common = {"*IDN?": self.idn, "*OPC?": "1"}
        if line in common:
            return common[line]
        if line == "*RST":
            self._preset()
        command = _LINE.fullmatch(line)
        if command is None or command[2] not in self._commands:
            return None
        number, header = int(command[1] or 1), command[2]
        answer, put = self._commands[header]
        if not command[3]:
            put(number, [word.strip() for word in (command[4] or "").split(",")])
            return None
        # A query for harmonics is answered for a sine only.
        if header == "HARM" and self.channels[number - 1].function != "SINE":
            return None
        named = header if header == "COUP" else f"C{number}:{header}"
        return f"{named} {answer(number)}"

    def _kept(self, name: str, number: int) -> str:
        return str(self.channels[number - 1].settings[name])

    def _put(self, name: str) -> _Put:
        def put(number: int, words: list[str]) -> None:
            if words[-1] in {"ON", "OFF"}:
                self.channels[number - 1].settings[name] = words[-1]

        return put

    def _couple(self, _: int, words: list[str]) -> None:
        for name, word in _pairs(words).items():
            if name in self._coupled and word in {"ON", "OFF"}:
                self._coupled[name] = word

    def _output(self, number: int) -> str:
        channel = self.channels[number - 1]
        on = "ON" if self.is_on(number) else "OFF"
        load = "HZ" if math.isinf(channel.load_ohm) else f"{channel.load_ohm:g}"
        return f"{on},LOAD,{load},PLRT,{channel.settings['PLRT']}"

    def _set_output(self, number: int, words: list[str]) -> None:
        channel = self.channels[number - 1]
        if words[0] in {"ON", "OFF"}:
            # The switch comes first, if it is there at all: only pairs are left after it.
            self.switch(number, on=words.pop(0) == "ON")
        pairs = _pairs(words)
        if pairs.get("PLRT") in {"NOR", "INVT"}:
            channel.settings["PLRT"] = pairs["PLRT"]
        load = pairs.get("LOAD", "")
        if load == "HZ":
            channel.load_ohm = math.inf
        elif (ohm := _number(load)) is not None:
            # Clipped without a word, as everything else here: only reading back shows it.
            channel.load_ohm = min(max(ohm, 50.0), 100_000.0)

    def _wave(self, number: int) -> str:
        channel = self.channels[number - 1]
        vpp, offset_v = channel.shown * channel.emf_vpp, channel.offset_v
        return (
            f"WVTP,{channel.function},FRQ,{channel.frequency_hz:.10g}HZ,"
            f"PERI,{1 / channel.frequency_hz:.6g}S,AMP,{vpp:.6g}V,OFST,{offset_v:.6g}V,"
            f"HLEV,{offset_v + vpp / 2:.6g}V,LLEV,{offset_v - vpp / 2:.6g}V,"
            f"PHSE,{channel.settings['PHSE']:g}"
        )

    def _set_wave(self, number: int, words: list[str]) -> None:
        channel, pairs = self.channels[number - 1], _pairs(words)
        if pairs.get("WVTP") in WAVES:
            channel.function = pairs["WVTP"]
            # A basic wave ends modulation, sweep and burst.
            channel.settings |= dict.fromkeys(_MODES, "OFF")
        gain = self._gain(number)
        setters: Mapping[str, Callable[[float], object]] = {
            "FRQ": lambda hz: setattr(
                channel, "frequency_hz", min(max(gain * hz, 1e-6), self._model.most_hz)
            ),
            "AMP": lambda vpp: channel.set_vpp(gain * vpp),
            "OFST": channel.set_offset,
            "PHSE": lambda degrees: channel.settings.update(PHSE=degrees % 360),
        }
        for name, setter in setters.items():
            if (value := _number(pairs.get(name, ""))) is not None:
                with suppress(ScpiError):
                    setter(value)

    def _mode(self, mode: str, number: int) -> str:
        if self._kept(mode, number) == "OFF":
            return "STATE,OFF"
        kind = ",FM" if mode == "MDWV" else ""
        return f"STATE,ON{kind},SRC,INT,CARR,{self._wave(number)}"

    def _set_mode(self, mode: str, number: int, words: list[str]) -> None:
        state = _pairs(words).get("STATE", "")
        if state == "ON":
            self.channels[number - 1].settings |= dict.fromkeys(_MODES, "OFF")
        self._put(mode)(number, [state])


def _pairs(words: list[str]) -> dict[str, str]:
    """Each word that may be a name, and what follows it."""
    return dict(pairwise(words))


def _number(word: str) -> float | None:
    matched = _NUMBER.fullmatch(word)
    if matched is None or matched[2] not in _UNITS:
        return None
    return float(matched[1]) * _UNITS[matched[2]]


MODELS = {name: partial(SiglentDialect, model) for name, model in _GENERATORS.items()}
