"""The values in SCPI commands: numbers with units, switches, choices, strings; and what is wrong.

Source: IEEE 488.2-1992, section 7.7 (data elements), SCPI-99, volume 1, chapter 7.
"""

import re
from collections.abc import Mapping

HERTZ = {"": 1.0, "UHZ": 1e-6, "HZ": 1.0, "KHZ": 1e3, "MHZ": 1e6, "MAHZ": 1e6, "GHZ": 1e9}
VOLTS = {"": 1.0, "UV": 1e-6, "MV": 1e-3, "V": 1.0, "KV": 1e3}
SECONDS = {"": 1.0, "NS": 1e-9, "US": 1e-6, "MS": 1e-3, "S": 1.0}
NO_UNIT = {"": 1.0}
_NUMBER = re.compile(r"([+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:E[+-]?\d+)?)\s*([A-Z][A-Z/]*)?")
_NOT_DECIMAL = re.compile(r"#(?:H([0-9A-F]+)|Q([0-7]+)|B([01]+))")
_SWITCHES = {"ON": True, "1": True, "OFF": False, "0": False}


class ScpiError(Exception):
    """An entry for the instrument's error queue."""

    def __init__(self, code: int, text: str) -> None:
        self.code = code
        self.text = text
        super().__init__(f'{code},"{text}"')


def given(argument: str) -> str:
    """Return `argument` in capitals.

    Raises:
        ScpiError: there is none, -109.
    """
    if not argument:
        raise ScpiError(-109, "Missing parameter")
    return argument.upper()


def nothing(argument: str) -> None:
    """Refuse an argument where none belongs.

    Raises:
        ScpiError: there is one, -108.
    """
    if argument:
        raise ScpiError(-108, "Parameter not allowed")


def number(argument: str, units: Mapping[str, float] = NO_UNIT) -> float:
    """Return the number that `argument` gives, in the base unit of `units`.

    Raises:
        ScpiError: missing (-109), no number (-104), more than one (-108), a unit where none
            belongs (-138) or a wrong one (-131).
    """
    text = given(argument)
    if "," in text:
        raise ScpiError(-108, "Parameter not allowed")
    if other := _NOT_DECIMAL.fullmatch(text):
        digits = [(digits, base) for digits, base in zip(other.groups(), (16, 8, 2), strict=True)]
        return float(next(int(text, base) for text, base in digits if text))
    found = _NUMBER.fullmatch(text)
    if found is None:
        raise ScpiError(-104, "Data type error")
    suffix = found[2] or ""
    if suffix not in units:
        known = len(units) > 1
        raise ScpiError(-131, "Invalid suffix") if known else ScpiError(-138, "Suffix not allowed")
    return float(found[1]) * units[suffix]


def quantity(argument: str, units: Mapping[str, float], lowest: float, highest: float) -> float:
    """Return the number that `argument` gives, with its unit, `MIN` or `MAX`.

    Raises:
        ScpiError: as `number`, or out of range (-222).
    """
    extreme = extremes(argument, lowest, highest)
    value = number(argument, units) if extreme is None else extreme
    if not lowest <= value <= highest:
        raise ScpiError(-222, "Data out of range")
    return value


def extremes(argument: str, lowest: float, highest: float) -> float | None:
    """Return what `MIN` or `MAX` stands for, None if `argument` is neither."""
    words = {"MIN": lowest, "MINIMUM": lowest, "MAX": highest, "MAXIMUM": highest}
    return words.get(argument.upper())


def boolean(argument: str) -> bool:
    """Return the state that `argument` gives.

    Raises:
        ScpiError: missing (-109), or neither ON, OFF, 1 nor 0 (-104).
    """
    text = given(argument)
    if text not in _SWITCHES:
        raise ScpiError(-104, "Data type error")
    return _SWITCHES[text]


def choice(argument: str, spellings: tuple[str, ...]) -> str:
    """Return the short form of the one of `spellings` (`SINusoid`) that `argument` gives.

    Raises:
        ScpiError: missing (-109), or none of them (-224).
    """
    text = given(argument)
    for spelling in spellings:
        short = "".join(letter for letter in spelling if not letter.islower())
        if text in {short, spelling.upper()}:
            return short
    raise ScpiError(-224, "Illegal parameter value")


def string(argument: str) -> str:
    """Return the quoted text that `argument` gives.

    Raises:
        ScpiError: missing (-109), or not in quotes (-151).
    """
    given(argument)
    if len(argument) < 2 or argument[0] != argument[-1] or argument[0] not in "'\"":
        raise ScpiError(-151, "Invalid string data")
    return argument[1:-1]
