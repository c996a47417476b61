"""The port: bytes out and in over anything that pySerial can open.

The only module that imports pySerial on the host's side of the wire.
"""

import errno
import re
import select
import socket
from pathlib import Path
from typing import Protocol

import serial

from device.errors import DeviceError
from protocol.address import BAUD, AddressError, checked_address

try:
    from termios import error as _termios_error

    PORT_ERRORS: tuple[type[Exception], ...] = (OSError, _termios_error)
except ImportError:  # Windows
    PORT_ERRORS = (OSError,)

WRITE_TIMEOUT_S = 0.4
"""As long as an answer may take: pySerial counts what a busy computer lets a process wait, too."""
_CHUNK = 65_536
_IN_USE = "in use by another program; close it first"
_ADVICE = {
    errno.ENOENT: "no such port; is the device plugged in? (touchbeam device list)",
    errno.EACCES: "permission denied; add yourself to the group dialout (sudo usermod -aG "
    "dialout $USER) and log in again",
    errno.EPERM: "permission denied; add yourself to the group dialout and log in again",
    errno.EBUSY: _IN_USE,
    errno.EAGAIN: _IN_USE,
    errno.EHOSTDOWN: "does not answer; switch it on and pair it over Bluetooth first",
    errno.ENOTTY: "is not a serial port",
    errno.ECONNREFUSED: "cannot be opened: the connection was refused; is the device on and its "
    "LAN interface enabled?",
    errno.EHOSTUNREACH: "cannot be opened: no route to it; check the network cable and address",
    errno.ETIMEDOUT: "cannot be opened: no answer; check the network cable and address",
}


class Port(Protocol):
    """The port as the link needs it. Every method raises `PORT_ERRORS` if the port is gone."""

    def receive(self, timeout_s: float) -> bytes:
        """Return the bytes received, waiting at most `timeout_s`; empty if none arrived."""

    def send(self, data: bytes) -> None:
        """Send `data`, within `WRITE_TIMEOUT_S`."""

    def close(self) -> None:
        """Close the port."""


class SerialPort:
    """A port opened by pySerial: serial, `socket://` or `rfc2217://`."""

    def __init__(self, port: serial.SerialBase) -> None:
        self._port = port
        self._descriptor = _descriptor(port)
        self._socket: socket.socket | None = getattr(port, "_socket", None)
        self.shared: int | None = (
            self._descriptor if self._socket is None else self._socket.fileno()
        )
        """The number of the connection, which a process of our own can share; None without one."""
        if self._socket is not None:  # or Nagle's algorithm delays each command by 40 ms
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def receive(self, timeout_s: float) -> bytes:
        if self._descriptor is None:  # Windows: select() does not work on serial ports
            self._port.timeout = timeout_s
            # One byte only: more would wait for the whole of it until the timeout.
            return bytes(self._port.read(1))
        # `select` and then all there is: pySerial's own timeout would wait for a full chunk.
        if select.select((self._descriptor,), (), (), timeout_s)[0]:
            return bytes(self._port.read(_CHUNK))
        return b""

    def send(self, data: bytes) -> None:
        self._port.write(data)

    def close(self) -> None:
        self._port.close()
        if self._socket is not None:  # pySerial leaves it open if the peer closed first
            self._socket.close()


def _descriptor(port: serial.SerialBase) -> int | None:
    try:
        return int(port.fileno())
    except PORT_ERRORS:
        return None


def open_port(url: str) -> SerialPort:
    """Return the port at `url`, opened for exclusive use.

    Raise `AddressError` for no address of a device, `DeviceError` with a remedy if it is missing.
    """
    checked_address(url)
    if Path(url).is_file() or Path(url).is_dir():
        # pySerial would open it and fail with an error about terminals.
        kind = "file" if Path(url).is_file() else "folder"
        raise AddressError(f"{url}: a device must be a serial port, got a plain {kind}")
    try:
        # Exclusive: a second program on the port could switch the output on, or take answers.
        port = serial.serial_for_url(
            url, BAUD, timeout=0, write_timeout=WRITE_TIMEOUT_S, exclusive=True
        )
    except ValueError as error:
        raise AddressError(f"{url}: not the address of a device ({error})") from error
    except PORT_ERRORS as error:
        bluetooth = any(word in url.lower() for word in ("rfcomm", "bluetooth"))
        pairing = "; a Bluetooth device must be paired and bound first" if bluetooth else ""
        # A name with a point in it may be a host's, which no system can tell from a port's.
        host = re.fullmatch(r"[\w-]+(\.[\w-]+)+", url)
        network = f"; a device on the network is socket://{url}:5025" if host else ""
        raise DeviceError(f"{url}: {advice(error)}{pairing}{network}") from error
    return SerialPort(port)


def advice(error: BaseException) -> str:
    """Return why a port cannot be opened and what to do about it."""
    number = next((number for number in _numbers(error) if number in _ADVICE), None)
    return _ADVICE[number] if number is not None else f"cannot be opened ({error})"


def _numbers(error: BaseException | None) -> list[int]:
    numbers = []
    while error is not None:
        first = error.args[0] if error.args else None  # termios.error has no errno
        number = getattr(error, "errno", None) or first
        numbers.append(number if isinstance(number, int) else 0)
        error = error.__cause__ or error.__context__
    return numbers


def described_ports() -> list[dict[str, str]]:
    """Return the name and description of each serial port, without opening any."""
    # Loaded here, because only the list of ports needs it.
    from serial.tools.list_ports import comports

    ports = sorted(comports(), key=lambda port: str(port.device))
    return [{"name": port.device, "description": port.description or ""} for port in ports]
