"""The wire codec: lines, numbers and errors in SCPI's notation. Does no I/O.

Source: IEEE 488.2 and SCPI-99; docs/wire-protocol.md lists the board's commands.
"""

import math
import re

from device.errors import ProtocolError

LONGEST_LINE = 1024
"""Most bytes without a line end; a peer that sends more does not speak our protocol."""

_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")
_ERROR = re.compile(r'([+-]?\d+),"(.*)"')
_SCPI_NOT_A_NUMBER = 9.9e37


def encoded(line: str) -> bytes:
    """Return `line` as bytes on the wire.

    Raises:
        ValueError: it contains a control character, which could end it early, or is not ASCII.
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
    """Return the number in `reply`.

    Raises:
        ProtocolError: it is not a number, or is SCPI's code for infinity or not-a-number.
    """
    text = reply.strip()
    value = float(text) if _NUMBER.fullmatch(text) else math.nan
    if not abs(value) < _SCPI_NOT_A_NUMBER:
        raise ProtocolError(f"the device must answer with a number, got {reply!r}")
    return value


def impedance(reply: str) -> float:
    """Return the load in `reply`, Ω; SCPI's 9.9E+37 means an open circuit.

    >>> impedance("9.9E+37")
    inf

    Raises:
        ProtocolError: it is not a number.
    """
    text = reply.strip()
    if _NUMBER.fullmatch(text) and float(text) >= _SCPI_NOT_A_NUMBER:
        return math.inf
    return number(reply)


def switch(reply: str) -> bool:
    """Return the on/off state in `reply`.

    Raises:
        ProtocolError: it is not 1, 0, ON or OFF.
    """
    states = {"1": True, "ON": True, "0": False, "OFF": False}
    try:
        return states[reply.strip().upper()]
    except KeyError:
        raise ProtocolError(f"the device must answer with 1 or 0, got {reply!r}") from None


def queued_error(reply: str) -> str | None:
    """Return the error that an answer to `SYST:ERR?` reports, or None for "No error".

    >>> queued_error('-222,"Data out of range"')
    '-222 Data out of range'

    Raises:
        ProtocolError: the answer does not have the form of an error.
    """
    found = _ERROR.fullmatch(reply.strip())
    if found is None:
        raise ProtocolError(
            f'the device must answer with an error such as 0,"No error", got {reply!r}'
        )
    return None if int(found[1]) == 0 else f"{int(found[1])} {found[2]}"


class LineBuffer:
    """A buffer that turns bytes into whole lines; its size is bounded, whatever the peer sends."""

    def __init__(self) -> None:
        self._pending = b""

    @property
    def pending(self) -> bytes:
        """The bytes of the line that has not ended yet."""
        return self._pending

    def feed(self, chunk: bytes) -> list[bytes]:
        """Add `chunk` and return the non-empty lines it completes, ended by LF, CRLF or CR.

        Raises:
            ProtocolError: a line is longer than `LONGEST_LINE`; the pending bytes are discarded.
        """
        if b"\r" in chunk:
            chunk = chunk.replace(b"\r", b"\n")
        *whole, self._pending = (self._pending + chunk).split(b"\n")
        if len(self._pending) > LONGEST_LINE:
            self.clear()
            raise ProtocolError(
                f"the device sent more than {LONGEST_LINE} bytes without a line end"
            )
        return [line for line in whole if line]

    def clear(self) -> None:
        """Discard the bytes of an incomplete line."""
        self._pending = b""


def text(line: bytes) -> str:
    """Return `line` as text.

    Raises:
        ProtocolError: it is not printable ASCII.
    """
    if line.isascii() and (found := line.decode("ascii").strip()).isprintable():
        return found
    raise ProtocolError(f"the device must answer in ASCII, got {line[:40]!r}")


def fields(reply: str, count: int) -> list[str]:
    """Return the answers in the reply to a compound query.

    >>> fields('1;24221.37;0,"No error"', 3)
    ['1', '24221.37', '0,"No error"']

    Raises:
        ProtocolError: the number of answers is not `count`.
    """
    found = reply.split(";")
    if len(found) != count:
        raise ProtocolError(f"the device must answer with {count} fields, got {reply!r}")
    return found


def whole(reply: str) -> int:
    """Return the whole number in `reply`.

    Raises:
        ProtocolError: it is not a whole number.
    """
    value = number(reply)
    if value != int(value):
        raise ProtocolError(f"the device must answer with a whole number, got {reply!r}")
    return int(value)
