"""Addresses of devices: the rule that one in a study file, a command or a session must keep."""

import re

from protocol.errors import BadInput

ADDRESS_RULE = (
    "must be sim, a serial port such as /dev/ttyACM0 or COM3 (touchbeam device list), "
    "socket://HOST:PORT or rfc2217://HOST:PORT, without options"
)
_HOST = r"(?:[\w.-]+|\[[\w:.%]+\])"
_ON_A_NETWORK = re.compile(rf"(?:socket|rfc2217)://{_HOST}:(\d{{1,5}})", re.ASCII | re.IGNORECASE)
# What other programs call an address. A serial port has no such name on any system.
_VISA = re.compile(rf"(TCPIP|USB|GPIB|VXI|PXI)\d*::({_HOST}|[^:]+)(?:::(.*))?", re.IGNORECASE)
_VISA_SERIAL = re.compile(r"(ASRL)([^:]+)::INSTR", re.IGNORECASE)
_WITH_PORT = re.compile(rf"({_HOST}):(\d{{1,5}})", re.ASCII)
_IPV4 = re.compile(r"\d{1,3}(?:\.\d{1,3}){3}", re.ASCII)
_COM = re.compile(r"COM\d+", re.IGNORECASE)
_SCPI, _TELNET = "5025", "5024"
_AT_RIGOL = "(5555 in place of 5025 at a Rigol)"

SIMULATED = "sim"
"""The address of a simulated device, which each command starts for itself."""
BAUD = 115_200
"""Of a serial line, 8N1; USB and networks ignore it and carry more."""


class AddressError(BadInput):
    """The address of a device, or its dialect, is not one that exists: the user's mistake."""


def is_address(text: str) -> bool:
    """Return whether `text` may be the address of a device; whether one is there is not asked.

    pySerial opens more than devices: `spy://` writes its traffic into any file that the address
    names, and options after `?` change how a port works. A study file must not have such power.

    >>> is_address("/dev/ttyUSB0"), is_address("socket://192.168.0.5:5025")
    (True, True)
    >>> is_address("spy:///dev/ttyUSB0?file=thesis.tex")
    False
    """
    # A serial port is a name of the system, which only the system knows: opening it tells the rest.
    if "://" not in text:
        return bool(text.strip())
    # The whole text must match, because pySerial takes options after `?`.
    matched = _ON_A_NETWORK.fullmatch(text)
    return matched is not None and 1 <= int(matched[1]) <= 65_535


def other_spelling(text: str) -> str:
    """Return how to write the name that another program has for a device; '' for an address.

    >>> other_spelling("TCPIP0::192.168.1.50::inst0::INSTR")
    'is a VISA name; write socket://192.168.1.50:5025 (5555 in place of 5025 at a Rigol)'
    >>> other_spelling("/dev/ttyUSB0"), other_spelling("socket://192.168.1.50:5025")
    ('', '')
    """
    text = text.strip()
    if visa := _VISA.fullmatch(text) or _VISA_SERIAL.fullmatch(text):
        return f"is a VISA name{_of_visa(*visa.groups())}"
    if (with_port := _WITH_PORT.fullmatch(text)) is None:
        return f"lacks the port; write {_socket(text)}" if _IPV4.fullmatch(text) else ""
    host, port = with_port.groups()
    if _COM.fullmatch(host):
        return f"names a speed, too; write {host}, whose speed is {BAUD:,} baud"
    if port == _TELNET:
        return f"names a telnet port, which is for people; write {_socket(host)}"
    return f"lacks how to connect; write {_socket(host, port)}"


def _of_visa(kind: str, name: str, rest: str | None = None) -> str:
    if kind.upper() == "TCPIP":
        port, _, resource = (rest or "").rpartition("::")
        is_raw = resource.upper() == "SOCKET" and port.isdecimal()
        return f"; write {_socket(name, port if is_raw else _SCPI)}"
    if kind.upper() == "ASRL":
        numbered = f"COM{name} on Windows, else its name in touchbeam device list"
        return f"; write {numbered if name.isdecimal() else name}"
    # USBTMC and GPIB are buses of their own.
    return (
        f" of {kind.upper()}, which touchbeam does not speak; connect the device's LAN and write "
        f"{_socket('ADDRESS')}, or a serial port"
    )


def _socket(host: str, port: str = _SCPI) -> str:
    return f"socket://{host}:{port}{f' {_AT_RIGOL}' * (port == _SCPI)}"


def checked_address(text: str) -> str:
    """Return `text` if it may be the address of a device, else raise an AddressError."""
    if spelling := other_spelling(text):
        raise AddressError(f"{text.strip()}: {spelling}")
    if not is_address(text):
        told = text.strip() or repr(text)
        raise AddressError(f"{told}: not the address of a device; it {ADDRESS_RULE}")
    return text
