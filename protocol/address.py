"""Addresses of devices: the rule that one in a study file, a command or a session must keep."""

import re

from protocol.errors import BadInput

ADDRESS_RULE = (
    "must be sim, a serial port such as /dev/ttyACM0 or COM3 (touchbeam device list), "
    "socket://HOST:PORT or rfc2217://HOST:PORT, without options"
)
_HOST = r"(?:[\w.-]+|\[[\w:.%]+\])"
_ON_A_NETWORK = re.compile(rf"(?:socket|rfc2217)://{_HOST}:(\d{{1,5}})", re.ASCII | re.IGNORECASE)

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


def checked_address(text: str) -> str:
    """Return `text` if it may be the address of a device, else raise an AddressError."""
    if not is_address(text):
        told = text.strip() or repr(text)
        raise AddressError(f"{told}: not the address of a device; it {ADDRESS_RULE}")
    return text
