"""The grammar of SCPI as an instrument reads it: program messages, paths, headers and values.

Source: IEEE 488.2-1992, chapter 7 (program messages), and SCPI-99, volume 1, chapter 6 (paths,
long and short forms, numeric suffixes).
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache

# For a frequency SCPI reads MHZ as mega, although M is milli everywhere else: hence MAHZ, too.
HERTZ = {"": 1.0, "UHZ": 1e-6, "HZ": 1.0, "KHZ": 1e3, "MHZ": 1e6, "MAHZ": 1e6, "GHZ": 1e9}
VOLTS = {"": 1.0, "UV": 1e-6, "MV": 1e-3, "V": 1.0, "KV": 1e3}
SECONDS = {"": 1.0, "NS": 1e-9, "US": 1e-6, "MS": 1e-3, "S": 1.0}
NO_UNIT = {"": 1.0}
_NUMBER = re.compile(r"([+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:E[+-]?\d+)?)\s*([A-Z][A-Z/]*)?")
_NOT_DECIMAL = re.compile(r"#(H[0-9A-F]+|Q[0-7]+|B[01]+)")
_BASES = {"H": 16, "Q": 8, "B": 2}
_SWITCHES = {"ON": True, "1": True, "OFF": False, "0": False}


class ScpiError(Exception):
    """An entry for the instrument's error queue."""

    def __init__(self, code: int, text: str) -> None:
        self.code = code
        self.text = text
        super().__init__(f'{code},"{text}"')


def given(argument: str) -> str:
    """Return `argument` in capitals; none is an error, -109."""
    if not argument:
        raise ScpiError(-109, "Missing parameter")
    return argument.upper()


def nothing(argument: str) -> None:
    """Refuse an argument where none belongs: -108."""
    if argument:
        raise ScpiError(-108, "Parameter not allowed")


def number(argument: str, units: Mapping[str, float] = NO_UNIT) -> float:
    """Return the number that `argument` gives, in the base unit of `units`.

    Errors: missing (-109), not a number (-104), several (-108), an unwanted unit (-138) or a
    wrong one (-131).
    """
    text = given(argument)
    if "," in text:
        raise ScpiError(-108, "Parameter not allowed")
    if other := _NOT_DECIMAL.fullmatch(text):
        return float(int(other[1][1:], _BASES[other[1][0]]))
    decimal = _NUMBER.fullmatch(text)
    if decimal is None:
        raise ScpiError(-104, "Data type error")
    suffix = decimal[2] or ""
    if suffix not in units:
        known = len(units) > 1
        raise ScpiError(-131, "Invalid suffix") if known else ScpiError(-138, "Suffix not allowed")
    return float(decimal[1]) * units[suffix]


def quantity(argument: str, units: Mapping[str, float], lowest: float, highest: float) -> float:
    """Return the number, with its unit, `MIN` or `MAX`; as `number`, and -222 if out of range."""
    extreme = extremes(argument, lowest, highest)
    value = number(argument, units) if extreme is None else extreme
    if not lowest <= value <= highest:
        raise ScpiError(-222, "Data out of range")
    return value


def extremes(argument: str, lowest: float, highest: float) -> float | None:
    """Return what `MIN` or `MAX` stands for, None if `argument` is neither."""
    words = {"MIN": lowest, "MINIMUM": lowest, "MAX": highest, "MAXIMUM": highest}
    return words.get(argument.upper())


def told(argument: str, kept: float, lowest: float, highest: float) -> float:
    """Return what answers a query: what is kept, or what `MIN` and `MAX` stand for (else -108)."""
    extreme = extremes(argument, lowest, highest) if argument else kept
    if extreme is None:
        raise ScpiError(-108, "Parameter not allowed")
    return extreme


def boolean(argument: str) -> bool:
    """Return the state that `argument` gives: ON, OFF, 1 or 0 (else -104)."""
    text = given(argument)
    if text not in _SWITCHES:
        raise ScpiError(-104, "Data type error")
    return _SWITCHES[text]


def choice(argument: str, spellings: tuple[str, ...]) -> str:
    """Return the short form of the one of `spellings` (`SINusoid`) that is given (else -224)."""
    text = given(argument)
    for spelling in spellings:
        if text in {_short(spelling), spelling.upper()}:
            return _short(spelling)
    raise ScpiError(-224, "Illegal parameter value")


def _short(spelling: str) -> str:
    return "".join(letter for letter in spelling if not letter.islower())


_TOKEN = re.compile(r"[*A-Za-z]+|[\[\]:#?]")
_HEADER = re.compile(r":?[*A-Z][A-Z0-9_]*(:[A-Z][A-Z0-9_]*)*\??")
_TOKENS = {"[": "(?:", "]": ")?", ":": ":", "?": r"\?", "#": r"(\d*)"}


@dataclass(frozen=True, kw_only=True)
class Call:
    """A command that was understood: its argument and the channel in its header."""

    argument: str
    channel: int


Handler = Callable[[Call], str | None]


@lru_cache(maxsize=1000)
def messages(line: str) -> tuple[tuple[str, str], ...]:
    """Return header and argument of each command of a compound `line`, with the path from the root.

    A header goes on where the one before it stopped, unless it begins with a colon; common
    commands (`*OPC?`) leave the path as it is.

    >>> [header for header, _ in messages("VOLT:LIM 100;RAMP 50;*OPC?;:FREQ?")]
    ['VOLT:LIM', 'VOLT:RAMP', '*OPC?', 'FREQ?']
    """
    commands, path = [], ""
    for part in split_outside_quotes(line, ";"):
        header, _, argument = part.partition(" ")
        header = header.upper()
        if not header.startswith("*"):
            header = header[1:] if header.startswith(":") else path + header
            path = header[: header.rfind(":") + 1]
        commands.append((header, argument.strip()))
    return tuple(commands)


def split_outside_quotes(text: str, separator: str) -> list[str]:
    """Return the parts of `text` between separators that no quotes hold, without empty ones.

    >>> split_outside_quotes("DISP:TEXT 'a;b';*OPC?", ";")
    ["DISP:TEXT 'a;b'", '*OPC?']
    """
    # Hardly any command has quotes, and each poll passes through here.
    if "'" not in text and '"' not in text:
        parts = text.split(separator)
    else:
        pattern = rf"""((?:'[^']*'|"[^"]*"|[^{separator}'"])+)"""
        parts = re.findall(pattern, text)
    return [part.strip() for part in parts if part.strip()]


def header_pattern(spelling: str) -> "re.Pattern[str]":
    """Return the pattern of all spellings of a header written as manuals write it.

    Capitals are the short form, brackets enclose what may be left out, `#` is a channel.

    >>> bool(header_pattern("[SOURce#:]VOLTage[:AMPLitude]?").fullmatch("SOUR1:VOLTAGE?"))
    True
    """
    return re.compile("".join(_token(token) for token in _TOKEN.findall(spelling)))


def _token(token: str) -> str:
    if token in _TOKENS:
        return _TOKENS[token]
    return f"(?:{re.escape(token.upper())}|{re.escape(_short(token))})"


class Headers:
    """The headers that an instrument knows, and what each one does."""

    def __init__(self, handlers: dict[str, Handler], channels: int = 1) -> None:
        self._handlers = [
            (header_pattern(spelling), handler) for spelling, handler in handlers.items()
        ]
        self._channels = channels
        # Kept, because a session asks the same few headers again and again.
        self.found = cache(self._found)

    def _found(self, header: str) -> tuple[Handler, int]:
        """Return what `header` does and its channel (1 if none); errors -102, -113 and -114."""
        if not _HEADER.fullmatch(header):
            raise ScpiError(-102, "Syntax error")
        for pattern, handler in self._handlers:
            if match := pattern.fullmatch(header):
                channel = int(next(filter(None, match.groups()), 1))
                if not 1 <= channel <= self._channels:
                    raise ScpiError(-114, "Header suffix out of range")
                return handler, channel
        raise ScpiError(-113, "Undefined header")
