"""The link: one serial port, one command at a time, every answer within its deadline.

The one module of the project that imports pySerial on our side of the wire.
"""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import serial

from device.errors import AddressError, DeviceError, LinkTimeout
from device.wire import LineBuffer, encoded

WRITE_TIMEOUT_S = 0.2
ANSWER_TIMEOUT_S = 0.4
_SLICE_S = 0.02


class Port(Protocol):
    """What the link needs of a serial port; `read` returns what came within its timeout."""

    @property
    def in_waiting(self) -> int:
        """Bytes that have come and were not read."""
        ...

    def read(self, size: int = 1, /) -> bytes:
        """Return up to `size` bytes."""
        ...

    def write(self, data: bytes, /) -> int | None:
        """Send `data`."""
        ...

    def close(self) -> None:
        """Give the port back."""
        ...


class Link:
    """Commands and queries over one port, in step: an answer belongs to the query before it."""

    def __init__(self, port: Port, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._port = port
        self._monotonic = monotonic
        self._buffer = LineBuffer()
        self._lines: list[str] = []
        self._in_step = True

    def tell(self, command: str) -> None:
        """Send `command`, which has no answer.

        Raises:
            DeviceError: the port is gone or does not take it.
        """
        try:
            self._port.write(encoded(command))
        except OSError as error:  # SerialException is one
            raise DeviceError(f"the device does not take {command!r}: {error}") from error

    def ask(self, query: str, timeout_s: float = ANSWER_TIMEOUT_S) -> str:
        """Send `query` and return the line that answers it.

        Raises:
            LinkTimeout: no whole line came within `timeout_s`, or an earlier answer is still due.
            DeviceError: the port is gone, or what came is no line of text.
        """
        if not self._in_step:
            raise LinkTimeout(f"{query!r} was not sent: an earlier answer is still due")
        self.tell(query)
        deadline_s = self._monotonic() + timeout_s
        while not self._lines:
            if self._monotonic() > deadline_s:
                self._in_step = False
                raise LinkTimeout(f"no answer to {query!r} within {timeout_s:g} s")
            self._lines += self._received()
        return self._lines.pop(0)

    def close(self) -> None:
        """Give the port back."""
        self._port.close()

    def _received(self) -> list[str]:
        try:
            chunk = self._port.read(self._port.in_waiting or 1)
        except OSError as error:
            raise DeviceError(f"the device is gone: {error}") from error
        return self._buffer.feed(chunk)


def open_link(url: str) -> Link:
    """Return a link over the serial port or pySerial URL `url`, opened for us alone.

    Raises:
        AddressError: `url` has a scheme that pySerial does not know, or is a plain file.
        DeviceError: the port is missing, in use, or may not be opened; the message says what to do.
    """
    if Path(url).is_file():
        raise AddressError(f"{url}: a device must be a serial port, got a plain file")
    try:
        port = serial.serial_for_url(url, timeout=_SLICE_S, write_timeout=WRITE_TIMEOUT_S)
        _claim(port)
    except ValueError as error:
        raise AddressError(f"{url}: not the address of a device ({error})") from error
    except (serial.SerialException, OSError) as error:
        raise DeviceError(f"{url}: {_advice(error)}") from error
    return Link(port)


def serial_ports() -> list[str]:
    """Return the names of the serial ports of this machine."""
    from serial.tools.list_ports import comports

    return sorted(port.device for port in comports())


def _claim(port: "serial.SerialBase") -> None:
    """Keep other programs off a port of the operating system; a socket has one peer anyway."""
    if isinstance(port, serial.Serial):
        port.exclusive = True


def _advice(error: OSError) -> str:
    text = str(error).lower()
    if "no such file" in text or "could not find" in text:
        return "no such port; is the device plugged in? (touchbeam device list)"
    if "permission" in text:
        return "permission denied; add yourself to the group dialout and log in again"
    if "exclusive" in text or "busy" in text or "resource temporarily" in text:
        return "in use by another program; close it first"
    return f"cannot be opened ({error})"
