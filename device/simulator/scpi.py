"""The grammar of SCPI as an instrument reads it: program messages, paths, headers.

Source: IEEE 488.2-1992, chapter 7 (program messages), and SCPI-99, volume 1, chapter 6 (paths,
long and short forms, numeric suffixes). Values are read in `values`.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass

from device.simulator.values import ScpiError

_TOKEN = re.compile(r"[*A-Za-z]+|[\[\]:#?]")
_HEADER = re.compile(r":?[*A-Z][A-Z0-9_]*(:[A-Z][A-Z0-9_]*)*\??")
_TOKENS = {"[": "(?:", "]": ")?", ":": ":", "?": r"\?", "#": r"(\d*)"}


@dataclass(frozen=True, kw_only=True)
class Message:
    """One command of a program message: its whole header, `?` included, and its argument."""

    header: str
    argument: str


@dataclass(frozen=True, kw_only=True)
class Call:
    """A command that was understood: its argument and the channel in its header."""

    argument: str
    channel: int


Handler = Callable[[Call], str | None]


def messages(line: str) -> list[Message]:
    """Return the commands of a compound `line` in order, each with its path from the root.

    A header goes on where the one before it stopped, unless it begins with a colon; common
    commands (`*OPC?`) leave the path as it is.

    >>> [message.header for message in messages("VOLT:LIM 100;RAMP 50;*OPC?;:FREQ?")]
    ['VOLT:LIM', 'VOLT:RAMP', '*OPC?', 'FREQ?']
    """
    found, path = [], ""
    for part in split_outside_quotes(line, ";"):
        header, _, argument = part.partition(" ")
        header = header.upper()
        if not header.startswith("*"):
            header = header[1:] if header.startswith(":") else path + header
            path = header[: header.rfind(":") + 1]
        found.append(Message(header=header, argument=argument.strip()))
    return found


def split_outside_quotes(text: str, separator: str) -> list[str]:
    """Return the parts of `text` between separators that no quotes hold, without empty ones.

    >>> split_outside_quotes("DISP:TEXT 'a;b';*OPC?", ";")
    ["DISP:TEXT 'a;b'", '*OPC?']
    """
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
    short = "".join(letter for letter in token if not letter.islower())
    return f"(?:{re.escape(token.upper())}|{re.escape(short)})"


class Headers:
    """The headers that an instrument knows, and what each one does."""

    def __init__(self, handlers: dict[str, Handler], channels: int = 1) -> None:
        self._handlers = [
            (header_pattern(spelling), handler) for spelling, handler in handlers.items()
        ]
        self._channels = channels
        self._known: dict[str, tuple[Handler, int]] = {}

    def found(self, header: str) -> tuple[Handler, int]:
        """Return what `header` does, and the channel it names (1 if none).

        Raises:
            ScpiError: it is no header (-102), unknown (-113), or of no channel here (-114).
        """
        if header not in self._known:
            self._known[header] = self._looked_up(header)
        return self._known[header]

    def _looked_up(self, header: str) -> tuple[Handler, int]:
        if not _HEADER.fullmatch(header):
            raise ScpiError(-102, "Syntax error")
        for pattern, handler in self._handlers:
            if match := pattern.fullmatch(header):
                return handler, self._channel([text for text in match.groups() if text])
        raise ScpiError(-113, "Undefined header")

    def _channel(self, suffixes: list[str]) -> int:
        channel = int(suffixes[0]) if suffixes else 1
        if not 1 <= channel <= self._channels:
            raise ScpiError(-114, "Header suffix out of range")
        return channel
