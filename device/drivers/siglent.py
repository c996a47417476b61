"""The driver of the Siglent SDG generators of the X series, through an amplifier.

Source: Siglent SDG Series Programming Guide (PG02). An answer starts with the command that was
asked for, followed by names and values: `C1:OUTP OFF,LOAD,HZ,PLRT,NOR`.
"""

import math
import re
from collections.abc import Mapping
from typing import ClassVar

from device.drivers import generator
from device.errors import DeviceError, ProtocolError
from device.link.codec import number, number_text, switch
from device.link.link import Register

LEAST_VPP = 4e-3
"""An amplitude that every model can generate into an open circuit."""
_OFF = (
    # The wave becomes a sine before its harmonics go off: `C1:HARM` is answered for a sine only.
    *("C1:MDWV STATE,OFF", "C1:SWWV STATE,OFF", "C1:BTWV STATE,OFF", "C1:BSWV WVTP,SINE"),
    *("C1:HARM HARMSTATE,OFF", "C1:CMBN OFF", "C2:OUTP OFF"),
    # Coupled channels move each other: a change of the second would change what is on the beam.
    *("COUP TRACE,OFF", "COUP FCOUP,OFF", "COUP PCOUP,OFF", "COUP ACOUP,OFF"),
)
_MUST_BE_OFF = {
    "modulation": "C1:MDWV",
    "sweep": "C1:SWWV",
    "burst": "C1:BTWV",
    "harmonics": "C1:HARM",
    "combined channel": "C1:CMBN",
    "coupling of channels": "COUP",
    "second channel": "C2:OUTP",
}
_HEADERS = ("C1:OUTP", "C1:BSWV", *_MUST_BE_OFF.values())
_UNITS = {"": 1.0, "HZ": 1.0, "KHZ": 1e3, "MHZ": 1e6, "V": 1.0, "MV": 1e-3}
_VALUE = re.compile(r"([-+]?[\d.]+(?:[eE][-+]?\d+)?)([A-Z]*)")


class Siglent(generator.Generator):
    """Control an SDG1000X, 2000X, 6000X or similar; it completes commands before it answers."""

    dialect: ClassVar[str] = "siglent"
    idn: ClassVar["re.Pattern[str]"] = re.compile(r"Siglent Technologies,SDG\d{4}X", re.IGNORECASE)
    expected: ClassVar[str] = "a generator (Siglent SDG of the X series)"
    health: ClassVar[Mapping[str, str]] = {
        "output": "C1:OUTP?",
        "wave": "C1:BSWV?",
        "modulation": "C1:MDWV?",
        "sweep": "C1:SWWV?",
        "burst": "C1:BTWV?",
        "second_channel": "C2:OUTP?",
    }
    off_command: ClassVar[str] = "C1:OUTP OFF"
    output_query: ClassVar[str] = "C1:OUTP?"
    register: ClassVar[Register] = Register(
        put="C2:BSWV PHSE,{}",
        get="C2:BSWV?",
        told=re.compile(r"C2:BSWV .*\bPHSE,(\d{1,3})(?:,.*)?"),
        is_a_setting=True,
    )
    """The phase of the second channel, which is off: there is no event enable register."""
    amplitude_abs_tol_vpp: ClassVar[float] = 1e-3
    lines_to_set: ClassVar[int] = 2
    on_command = "C1:OUTP ON"

    def _meet(self) -> None:
        """Decouple the second channel, and make it a sine, which has a phase."""
        # The link puts its numbers into this phase. Coupled channels share it, and noise has none.
        for command in ("COUP TRACE,OFF", "COUP PCOUP,OFF", "C2:BSWV WVTP,SINE"):
            self.link.tell(command)

    def _set_up(self, idn: str) -> float:  # noqa: ARG002 - all models are alike
        """Apply all settings; `read_back` shows whether the generator accepted them."""
        # The load goes first: what an amplitude means depends on it.
        amplitude = f"C1:BSWV AMP,{number_text(LEAST_VPP)}"
        for command in (*_OFF, "C1:OUTP LOAD,HZ", amplitude, "C1:BSWV OFST,0"):
            self.send(command)
        return LEAST_VPP

    def _remarks(self) -> tuple[str, ...]:
        return self._watched, generator.NO_LIMITS, generator.NO_ERRORS

    def output(self) -> bool:
        """Return whether the output is on; no unsolicited line is taken for the answer."""
        return self.link.certain(
            [self.output_query], lambda answers: switch(_words(answers[0], "C1:OUTP")[0])
        )

    def send(self, command: str) -> None:
        """Send `command` and wait until it is done; the generator reports no errors."""
        self.link.tell(command)
        # Commands that pile up would make the next answer late, however fast each of them is.
        self.link.query(self.output_query, lambda answer: _words(answer, "C1:OUTP"))

    def drained_errors(self) -> list[str]:
        """Return an empty list: the generator has no error queue."""
        return []

    def _set_vpp(self, vpp: float) -> None:
        self._set_wave(
            "AMP", vpp, generator.AMPLITUDE_REL_TOL, self.amplitude_abs_tol_vpp, unit="V"
        )

    def _set_frequency(self, frequency_hz: float) -> None:
        self._set_wave("FRQ", frequency_hz, 1e-6, 0.0, unit="HZ")

    def _set_wave(self, name: str, value: float, rel_tol: float, abs_tol: float, unit: str) -> None:
        # The generator clips silently: only the value that it kept shows whether it obeyed.
        self.link.tell(f"C1:BSWV {name},{number_text(value)}{unit}")
        kept = self.link.query(
            "C1:BSWV?", lambda answer: _quantity(_words(answer, "C1:BSWV"), name)
        )
        if not math.isclose(kept, value, rel_tol=rel_tol, abs_tol=abs_tol):
            raise DeviceError(f"{name} was set to {value:g} and reads back as {kept:g}")

    def _status(self) -> generator.Status:
        return self.link.certain([f"{header}?" for header in _HEADERS], _status_of)


def _status_of(answers: list[str]) -> generator.Status:
    words_of = {
        header: _words(answer, header) for header, answer in zip(_HEADERS, answers, strict=True)
    }
    wave = words_of["C1:BSWV"]
    return generator.Status(
        output=switch(words_of["C1:OUTP"][0]),
        vpp=_quantity(wave, "AMP"),
        frequency_hz=_quantity(wave, "FRQ"),
        fault=_shape_fault(words_of["C1:OUTP"], wave) or _left_on(words_of),
    )


def _shape_fault(output: list[str], wave: list[str]) -> str:
    load, shape, offset_v = _word(output, "LOAD"), _word(wave, "WVTP"), _quantity(wave, "OFST")
    if load != "HZ":
        return f"load must be HZ, got {load}: twice the voltage"
    if (shape, offset_v) != ("SINE", 0):
        return f"wave and offset must be SINE and 0, got {shape} and {number_text(offset_v)}"
    return ""


def _left_on(words_of: Mapping[str, list[str]]) -> str:
    for name, header in _MUST_BE_OFF.items():
        # An answer that says neither is no proof that something is off.
        if "ON" in words_of[header] or "OFF" not in words_of[header]:
            return f"{name} must be off, got {','.join(words_of[header])[:40]}"
    return ""


def _words(answer: str, header: str) -> list[str]:
    """Return the names and values after `header` in `answer`."""
    begin, _, rest = answer.partition(" ")
    if begin != header or not rest:
        raise ProtocolError(f"the device must answer with {header} and its values, got {answer!r}")
    return [word.strip() for word in rest.split(",")]


def _word(words: list[str], name: str) -> str:
    if name not in words[:-1]:
        raise ProtocolError(f"the device must answer with its {name}, got {','.join(words)!r}")
    return words[words.index(name) + 1]


def _quantity(words: list[str], name: str) -> float:
    """Return the number that follows `name`, in Hz or V."""
    word = _word(words, name)
    matched = _VALUE.fullmatch(word)
    if matched is None or matched[2] not in _UNITS:
        raise ProtocolError(f"the device must answer with a number for {name}, got {word!r}")
    return number(matched[1]) * _UNITS[matched[2]]


DRIVER = Siglent
