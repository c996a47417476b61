"""The wire codec: lines, numbers and errors in SCPI's notation. Does no I/O.

Functions that read an answer raise `ProtocolError` for what they cannot read, such as a word in
place of a number, SCPI's codes for infinity and not-a-number, or a wrong count of fields.

Source: IEEE 488.2 (blocks: 8.7.9) and SCPI-99; the documented wire protocol lists the board's.
"""

import math
import re

from device.errors import ProtocolError

LONGEST_LINE = 1024
"""Most bytes in a line; a peer that sends more does not speak our protocol."""

LONGEST_BLOCK = 2048
"""Most bytes in a block; 50 ms of three channels at 1 kHz are 322."""

_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")
_ERROR = re.compile(r'([+-]?\d{1,9}),"(.*)"')
# SCPI-99 writes infinity as 9.9E+37 and not-a-number as 9.91E+37: nothing measured is as large.
_SCPI_NOT_A_NUMBER = 9.9e37


def encoded(line: str) -> bytes:
    """Return `line` as bytes; raise `ValueError` if it has a control character or is not ASCII."""
    # A line feed within a command would make two commands of it.
    if not line.isascii() or not line.isprintable():
        raise ValueError(f"a command must be printable ASCII, got {line!r}")
    return line.encode("ascii") + b"\n"


def number_text(value: float) -> str:
    """Return `value` with ten significant digits; raise `ValueError` if it is not finite.

    >>> number_text(24221.37)
    '24221.37'
    """
    if not math.isfinite(value):
        raise ValueError(f"a number on the wire must be finite, got {value}")
    return f"{value:.10G}"


def number(reply: str) -> float:
    """Return the number in `reply`."""
    # Not `float` alone, which takes `1_000`, `nan` and `inf`: such a device is out of order.
    text = reply.strip()
    value = float(text) if _NUMBER.fullmatch(text) else math.nan
    # Written so that NaN is refused, too.
    if not abs(value) < _SCPI_NOT_A_NUMBER:
        raise ProtocolError(f"the device must answer with a number, got {reply[:60]!r}")
    return value


def impedance(reply: str) -> float:
    """Return the load in `reply`, Ω; SCPI's 9.9E+37 means an open circuit.

    >>> impedance("9.9E+37")
    inf
    """
    text = reply.strip()
    if _NUMBER.fullmatch(text) and float(text) >= _SCPI_NOT_A_NUMBER:
        return math.inf
    return number(reply)


def switch(reply: str) -> bool:
    """Return the on/off state in `reply`."""
    states = {"1": True, "ON": True, "0": False, "OFF": False}
    try:
        return states[reply.strip().upper()]
    except KeyError:
        raise ProtocolError(f"the device must answer with 1 or 0, got {reply[:60]!r}") from None


def queued_error(reply: str) -> str | None:
    """Return the error that an answer to `SYST:ERR?` reports, or None for "No error".

    >>> queued_error('-222,"Data out of range"')
    '-222 Data out of range'
    """
    entry = _ERROR.fullmatch(reply.strip())
    if entry is None:
        raise ProtocolError(
            f'the device must answer with an error such as 0,"No error", got {reply[:60]!r}'
        )
    return None if int(entry[1]) == 0 else f"{int(entry[1])} {entry[2]}"


class LineBuffer:
    """A buffer that turns bytes into whole lines; its size is bounded, whatever the peer sends."""

    def __init__(self) -> None:
        self._pending = b""

    @property
    def pending(self) -> bytes:
        """The bytes of the line that has not ended yet."""
        return self._pending

    def feed(self, chunk: bytes) -> list[bytes]:
        """Add `chunk`; return the non-empty lines it completes, ended by LF, CRLF or CR.

        Raise `ProtocolError` beyond `LONGEST_LINE`; the pending bytes are discarded.
        """
        if not chunk:
            return []
        # CR LF leaves an empty line between them, which is dropped below.
        if b"\r" in chunk:
            chunk = chunk.replace(b"\r", b"\n")
        data = self._pending + chunk
        *whole, self._pending = data.split(b"\n")
        # The cheap test comes first: hardly any chunk is as long as a line may be.
        if len(data) > LONGEST_LINE and max(map(len, (*whole, self._pending))) > LONGEST_LINE:
            self.clear()
            raise ProtocolError(
                f"the device sent more than {LONGEST_LINE} bytes without a line end"
            )
        return [line for line in whole if line]

    def clear(self) -> None:
        self._pending = b""


class BlockBuffer:
    """A buffer that takes one definite-length block, `#`, a digit, a length and as many bytes.

    Its content may hold any byte, a line end too; its size is bounded, whatever the peer sends.
    """

    def __init__(self) -> None:
        self.pending = b""
        """What has come so far."""

    def feed(self, chunk: bytes) -> tuple[bytes, bytes] | None:
        """Add `chunk`; return a whole block's content and what follows its line end.

        Raise `ProtocolError` if it is not a block, too long, or without a line end.
        """
        self.pending += chunk
        begin = self._begin()
        if begin is None:
            return None
        end = begin + self._length(begin)
        content, after = self.pending[begin:end], self.pending[end:]
        # Without its line end it is not over: the next byte would answer the next query.
        if not after:
            return None
        line_end = re.match(rb"\r?\n|\r", after)
        if line_end is None:
            raise ProtocolError(
                f"a block of {len(content)} bytes must end there, got {after[:9]!r}"
            )
        return content, after[line_end.end() :]

    def _begin(self) -> int | None:
        """Return where the content begins, None while its header is incomplete."""
        head = self.pending[:2]
        if not re.fullmatch(rb"(#([1-9])?)?", head):
            raise ProtocolError(f"the device must answer with a block, got {self.pending[:40]!r}")
        begin = 2 + int(head[1:]) if len(head) == 2 else len(self.pending) + 1
        return begin if begin <= len(self.pending) else None

    def _length(self, begin: int) -> int:
        digits = self.pending[2:begin]
        # Refused at its header, before anything of that length is kept.
        length = int(digits) if digits.isdigit() else LONGEST_BLOCK + 1
        if length > LONGEST_BLOCK:
            raise ProtocolError(
                f"a block must have a length of at most {LONGEST_BLOCK} bytes, got {digits!r}"
            )
        return length


def block(content: bytes) -> bytes:
    """Return `content` as a definite-length block, without its line end.

    >>> block(b"any bytes")
    b'#19any bytes'
    """
    length = str(len(content))
    return f"#{len(length)}{length}".encode("ascii") + content


def text(line: bytes) -> str:
    """Return `line` as text."""
    if line.isascii() and (decoded := line.decode("ascii").strip()).isprintable():
        return decoded
    raise ProtocolError(f"the device must answer in ASCII, got {line[:40]!r}")


def fields(reply: str, count: int) -> list[str]:
    """Return the answers in the reply to a compound query.

    >>> fields('1;24221.37;0,"No error"', 3)
    ['1', '24221.37', '0,"No error"']
    """
    answers = reply.split(";")
    if len(answers) != count:
        raise ProtocolError(f"the device must answer with {count} fields, got {reply[:60]!r}")
    return answers


def whole(reply: str) -> int:
    """Return the whole number in `reply`."""
    value = number(reply)
    if value != int(value):
        raise ProtocolError(f"the device must answer with a whole number, got {reply[:60]!r}")
    return int(value)
