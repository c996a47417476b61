"""The addresses of devices."""

import pytest

from protocol.address import AddressError, checked_address, is_address, other_spelling


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
        "/dev/serial/by-path/pci-0000:00:14.0-usb-0:1:1.0-port0",
        "socket://localhost:5024",
        "rig.pty",
    ],
)
def test_ports_and_sockets_are_addresses(text: str) -> None:
    assert is_address(text)
    assert checked_address(text) == text
    assert other_spelling(text) == ""


AT_RIGOL = " (5555 in place of 5025 at a Rigol)"
LAN = f"; connect the device's LAN and write socket://ADDRESS:5025{AT_RIGOL}, or a serial port"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "TCPIP0::192.168.1.50::inst0::INSTR",
            f"is a VISA name; write socket://192.168.1.50:5025{AT_RIGOL}",
        ),
        (
            "tcpip::generator.local::instr",
            f"is a VISA name; write socket://generator.local:5025{AT_RIGOL}",
        ),
        ("TCPIP0::192.168.1.51::5555::SOCKET", "is a VISA name; write socket://192.168.1.51:5555"),
        (
            "TCPIP::[fe80::1]::hislip0::INSTR",
            f"is a VISA name; write socket://[fe80::1]:5025{AT_RIGOL}",
        ),
        (
            "USB0::0x0957::0x0407::MY44021621::INSTR",
            f"is a VISA name of USB, which touchbeam does not speak{LAN}",
        ),
        ("GPIB0::10::INSTR", f"is a VISA name of GPIB, which touchbeam does not speak{LAN}"),
        (
            "ASRL3::INSTR",
            "is a VISA name; write COM3 on Windows, else its name in touchbeam device list",
        ),
        ("ASRL/dev/ttyUSB0::INSTR", "is a VISA name; write /dev/ttyUSB0"),
        (
            "192.168.1.50:5025",
            f"lacks how to connect; write socket://192.168.1.50:5025{AT_RIGOL}",
        ),
        ("generator.local:5555", "lacks how to connect; write socket://generator.local:5555"),
        (
            "192.168.1.50:5024",
            f"names a telnet port, which is for people; write socket://192.168.1.50:5025{AT_RIGOL}",
        ),
        ("192.168.1.50", f"lacks the port; write socket://192.168.1.50:5025{AT_RIGOL}"),
        ("COM3:9600", "names a speed, too; write COM3, whose speed is 115,200 baud"),
    ],
)
def test_the_name_that_another_program_has_for_a_device_is_answered_with_its_address(
    text: str, said: str
) -> None:
    assert other_spelling(text) == said
    with pytest.raises(AddressError) as refused:
        checked_address(f" {text}")
    assert str(refused.value) == f"{text}: {said}"
    written = said.split("write ")[1].split(maxsplit=1)[0].rstrip(",")
    assert is_address(written.replace("ADDRESS", "localhost"))


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
