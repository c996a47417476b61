"""The wire codec: lines out, lines in, numbers and errors as SCPI writes them. Does no I/O.

Source: IEEE 488.2 and SCPI-99; docs/wire-protocol.md lists the board's commands.
"""

import math
import re

from device.errors import DeviceError

LONGEST_LINE = 1024
"""Bytes without a line end beyond which a peer is not speaking our language."""

_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")
_ERROR = re.compile(r'([+-]?\d+),"(.*)"')
_SCPI_NOT_A_NUMBER = 9.9e37


def encoded(line: str) -> bytes:
    """Return `line` as it goes over the wire.

    Raises:
        ValueError: it has a character that would end it early or that is not ASCII.
    """
    if not line.isascii() or not line.isprintable():
        raise ValueError(f"a command must be printable ASCII, got {line!r}")
    return line.encode("ascii") + b"\n"


def number_text(value: float) -> str:
    """Return `value` with ten significant digits, enough for a frequency in mHz.

    >>> number_text(24221.37)
    '24221.37'

    Raises:
        ValueError: it is not finite.
    """
    if not math.isfinite(value):
        raise ValueError(f"a number on the wire must be finite, got {value}")
    return f"{value:.10G}"


def number(reply: str) -> float:
    """Return the number that `reply` gives.

    Raises:
        DeviceError: it is none; SCPI's stand-ins for infinity and not-a-number are none either.
    """
    text = reply.strip()
    value = float(text) if _NUMBER.fullmatch(text) else math.nan
    if not abs(value) < _SCPI_NOT_A_NUMBER:
        raise DeviceError(f"the device must answer with a number, got {reply!r}")
    return value


def switch(reply: str) -> bool:
    """Return the on/off state that `reply` gives.

    Raises:
        DeviceError: it is neither 1, 0, ON nor OFF.
    """
    states = {"1": True, "ON": True, "0": False, "OFF": False}
    try:
        return states[reply.strip().upper()]
    except KeyError:
        raise DeviceError(f"the device must answer with 1 or 0, got {reply!r}") from None


def queued_error(reply: str) -> str | None:
    """Return the error that an answer to `SYST:ERR?` reports, None if there is none.

    >>> queued_error('-222,"Data out of range"')
    '-222 Data out of range'

    Raises:
        DeviceError: the answer has not the form of an error.
    """
    found = _ERROR.fullmatch(reply.strip())
    if found is None:
        raise DeviceError(
            f'the device must answer with an error such as 0,"No error", got {reply!r}'
        )
    return None if int(found[1]) == 0 else f"{int(found[1])} {found[2]}"


class LineBuffer:
    """Bytes in, whole lines out; bounded, whatever the peer sends."""

    def __init__(self) -> None:
        self._pending = b""

    def feed(self, chunk: bytes) -> list[str]:
        """Take `chunk` and return the lines it completes; LF, CRLF and CR end a line.

        Raises:
            DeviceError: a line is not ASCII, or longer than `LONGEST_LINE`.
        """
        *whole, self._pending = re.split(rb"[\r\n]+", self._pending + chunk)
        if len(self._pending) > LONGEST_LINE:
            self.clear()
            raise DeviceError(f"the device sent more than {LONGEST_LINE} bytes without a line end")
        return [_text(line) for line in whole if line]

    def clear(self) -> None:
        """Forget what was not completed."""
        self._pending = b""


def _text(line: bytes) -> str:
    try:
        return line.decode("ascii")
    except UnicodeDecodeError:
        raise DeviceError(f"the device must answer in ASCII, got {line[:40]!r}") from None
