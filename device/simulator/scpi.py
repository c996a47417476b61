"""The grammar of SCPI as an instrument understands it: long and short forms, any case."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

_UNITS = {"": 1.0, "V": 1.0, "MV": 1e-3, "HZ": 1.0, "KHZ": 1e3, "MHZ": 1e6, "S": 1.0, "MS": 1e-3}
_NUMBER = re.compile(r"([+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:E[+-]?\d+)?)\s*([A-Z]*)")


class ScpiError(Exception):
    """An entry for the instrument's error queue."""

    def __init__(self, code: int, text: str) -> None:
        self.code = code
        super().__init__(f'{code},"{text}"')


@dataclass(frozen=True, kw_only=True)
class Message:
    """One command of a program message: its header, `?` included, and its argument."""

    header: str
    argument: str


def messages(line: str) -> list[Message]:
    """Return the commands of a compound `line`, in order.

    >>> [message.header for message in messages("OUTP OFF;*OPC?")]
    ['OUTP', '*OPC?']
    """
    parts = (part.strip() for part in line.split(";"))
    return [_message(part) for part in parts if part]


def _message(part: str) -> Message:
    header, _, argument = part.partition(" ")
    return Message(header=header.lstrip(":").upper(), argument=argument.strip())


def known_header(header: str, patterns: Iterable[str]) -> str:
    """Return the pattern, such as `VOLTage:LIMit?`, that `header` spells in long or short form.

    Raises:
        ScpiError: none of them, -113.
    """
    for pattern in patterns:
        if _spells(header, pattern):
            return pattern
    raise ScpiError(-113, "Undefined header")


def _spells(header: str, pattern: str) -> bool:
    if header.endswith("?") != pattern.endswith("?"):
        return False
    given, wanted = header.rstrip("?").split(":"), pattern.rstrip("?").split(":")
    return len(given) == len(wanted) and all(
        mnemonic in {word.upper(), "".join(c for c in word if not c.islower())}
        for mnemonic, word in zip(given, wanted, strict=True)
    )


def quantity(argument: str, lowest: float, highest: float) -> float:
    """Return the number that `argument` gives, with its unit, `MIN` or `MAX`.

    Raises:
        ScpiError: no number (-104), an unknown unit (-131), or out of range (-222).
    """
    text = argument.upper()
    if text in {"MIN", "MINIMUM"}:
        return lowest
    if text in {"MAX", "MAXIMUM"}:
        return highest
    found = _NUMBER.fullmatch(text)
    if found is None:
        raise ScpiError(-104, "Data type error")
    if found[2] not in _UNITS:
        raise ScpiError(-131, "Invalid suffix")
    value = float(found[1]) * _UNITS[found[2]]
    if not lowest <= value <= highest:
        raise ScpiError(-222, "Data out of range")
    return value


def boolean(argument: str) -> bool:
    """Return the state that `argument` gives.

    Raises:
        ScpiError: neither ON, OFF, 1 nor 0, -104.
    """
    states = {"ON": True, "1": True, "OFF": False, "0": False}
    if argument.upper() not in states:
        raise ScpiError(-104, "Data type error")
    return states[argument.upper()]
