"""The link: in step, within its deadlines, whatever the peer does."""

import errno

import pytest

from device.errors import DeviceError, EmergencyStop, LinkTimeout, ProtocolError
from device.link.codec import number
from device.link.link import MOST_LINES, Link
from device.link.port import advice
from tests.device.scripted import ScriptedPort, ticking


def linked(answers: dict[bytes, bytes], **options: bool) -> tuple[Link, ScriptedPort]:
    port = ScriptedPort(answers, **options)
    return Link(port, monotonic=ticking()), port


def test_a_query_is_one_line_in_one_write() -> None:
    link, port = linked({b"VOLT?\n": b"100\r\n"})
    assert link.ask("VOLT?") == "100"
    assert port.sent == [b"VOLT?\n"]


def test_a_late_answer_is_not_taken_for_the_next_one() -> None:
    link, port = linked({b"FREQ?\n": b"24221\n"})
    with pytest.raises(LinkTimeout, match=r"no answer to 'VOLT\?' in time"):
        link.ask("VOLT?")
    port.pending = b"100\n"
    assert link.ask("FREQ?") == "24221"
    assert port.sent[1:5] == [b"*ESE 1\n", b"*ESE?\n", b"*ESE 2\n", b"*ESE?\n"]


def test_an_answer_that_comes_while_getting_into_step_is_passed_over() -> None:
    link, port = linked({b"FREQ?\n": b"24221\n"})
    with pytest.raises(LinkTimeout, match="in time"):
        link.ask("VOLT?")
    port.answers[b"*ESE 1\n"] = b"1\n"  # looks like what is waited for: it takes two numbers
    assert link.ask("FREQ?") == "24221"


def test_a_device_that_does_not_get_into_step_is_given_up() -> None:
    link, _ = linked({}, deaf_to_sync=True)
    with pytest.raises(LinkTimeout, match="in time"):
        link.ask("VOLT?")
    with pytest.raises(LinkTimeout, match="an earlier answer is still due"):
        link.ask("FREQ?")


def test_what_was_not_asked_for_is_no_answer() -> None:
    link, port = linked({b"FREQ?\n": b"24221\n"})
    port.pending = b"touchbeam board ready\n100\n"
    assert link.ask("FREQ?") == "24221"


def test_an_answer_that_is_cut_short_is_none() -> None:
    link, _ = linked({b"VOLT?\n": b"10"})
    with pytest.raises(ProtocolError, match=r"answer to 'VOLT\?' was cut short, got b'10'"):
        link.ask("VOLT?")


def test_a_garbled_answer_is_asked_for_once_more() -> None:
    link, port = linked({b"VOLT?\n": b"\xb1\xb0\n"})
    with pytest.raises(ProtocolError, match="in ASCII, got"):
        link.query("VOLT?", number)
    assert port.sent.count(b"VOLT?\n") == 2


def test_an_echo_is_detected() -> None:
    link, _ = linked({b"*IDN?\n": b"*IDN?\ntouchbeam,BOARD,1,1\n"})
    with pytest.raises(ProtocolError, match="echoes what it is sent; switch its echo off"):
        link.identify()


def test_what_a_device_says_when_it_starts_is_passed_over() -> None:
    link, port = linked({b"*IDN?\n": b"ready\r\n\xff\ntouchbeam,BOARD,1,1\r\n"})
    port.pending = b"booting, please wait\n"
    assert link.identify() == "touchbeam,BOARD,1,1"


def test_who_does_not_say_who_it_is_is_quoted() -> None:
    link, _ = linked({b"*IDN?\n": b"Rigol,DG1022\n"})
    with pytest.raises(LinkTimeout, match=r"within 3 s; the last it said was b'Rigol,DG1022'"):
        link.identify()


class Endless(ScriptedPort):
    """Talks whenever somebody listens."""

    def receive(self, timeout_s: float) -> bytes:
        return b"unasked\n" * 30


def test_a_device_that_does_not_stop_talking_is_given_up() -> None:
    link = Link(Endless({}), monotonic=ticking(1e-4))
    with pytest.raises(ProtocolError, match="without being asked, and does not stop"):
        link.ask("VOLT?")
    assert len(link._lines) <= MOST_LINES + 60


def test_stop_ends_a_wait() -> None:
    link, _ = linked({})
    link.stop()
    with pytest.raises(EmergencyStop, match="stopped by hand"):
        link.ask("VOLT?")
    link.tell("OUTP OFF")


class Gone(ScriptedPort):
    """A port that was pulled."""

    def receive(self, timeout_s: float) -> bytes:
        raise OSError(errno.EIO, "Input/output error")

    def send(self, data: bytes) -> None:
        raise OSError(errno.EIO, "Input/output error")


def test_a_port_that_is_gone_says_so() -> None:
    link = Link(Gone({}))
    with pytest.raises(DeviceError, match=r"does not take 'OUTP OFF': .* Input/output error"):
        link.tell("OUTP OFF")
    with pytest.raises(DeviceError, match=r"the device is gone: .* Input/output error"):
        link.ask("VOLT?")


@pytest.mark.parametrize(
    ("number", "told"),
    [
        (errno.ENOENT, "no such port; is the device plugged in"),
        (errno.EACCES, "permission denied; add yourself to the group dialout"),
        (errno.EBUSY, "in use by another program; close it first"),
        (errno.EAGAIN, "in use by another program; close it first"),
        (errno.EHOSTDOWN, "pair it over Bluetooth first"),
        (errno.ENOTTY, "is no serial port"),
        (errno.ECONNREFUSED, "nobody listens there"),
        (errno.EHOSTUNREACH, "check the network cable"),
        (errno.ENXIO, "cannot be opened"),
    ],
)
def test_what_is_wrong_with_a_port_comes_with_what_to_do(number: int, told: str) -> None:
    hidden = OSError(f"could not open port: {number}")
    hidden.__context__ = OSError(number, "whatever the system calls it")
    assert told in advice(hidden)
