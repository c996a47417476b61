"""The addresses of devices."""

import pytest

from protocol.address import AddressError, checked_address, is_address


@pytest.mark.parametrize(
    "text",
    [
        "sim",
        "/dev/ttyUSB0",
        "/dev/serial/by-id/usb-FTDI_FT232R-if00-port0",
        "COM3",
        r"\\.\COM12",
        "socket://localhost:5025",
        "SOCKET://192.168.0.5:5025",
        "socket://[::1]:5025",
        "socket://[fe80::1%eth0]:5025",
        "rfc2217://rig-2.lab.example:65535",
    ],
)
def test_ports_and_sockets_are_addresses(text: str) -> None:
    assert is_address(text)
    assert checked_address(text) == text


@pytest.mark.parametrize(
    "text",
    [
        "",
        " ",
        "spy:///dev/ttyUSB0",
        "SPY:///dev/ttyUSB0?file=thesis.tex",
        "alt:///dev/ttyUSB0?class=Serial",
        "loop://",
        "hwgrep://0403:6001",
        "cp2110://",
        "://",
        "file:///home/me/thesis.tex",
        "socket://",
        "socket://localhost",
        "socket://localhost:",
        "socket://localhost:0",
        "socket://localhost:65536",
        "socket://localhost:٥٠",
        "socket://localhost:5025\n",
        "socket://localhost:5025/",
        "socket://localhost:5025/thesis.tex",
        "socket://localhost:5025?",
        "socket://localhost:5025?logging=debug",
        "socket://localhost:5025#here",
        "socket://me@localhost:5025",
        "socket://me:secret@localhost:5025",
        "rfc2217://localhost:5025?ign_set_control&timeout=60",
        "spy://socket://localhost:5025",
        "/dev/ttyUSB0://",
    ],
)
def test_nothing_else_is_one(text: str) -> None:
    assert not is_address(text)
    with pytest.raises(AddressError, match="not the address of a device; it must be sim, "):
        checked_address(text)
