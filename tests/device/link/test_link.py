"""The link: in step and within its deadlines, whatever the peer does."""

import errno
import os
import re

import pytest

from device.errors import DeviceError, EmergencyStop, LinkTimeout, ProtocolError
from device.link.codec import number, switch
from device.link.link import EVENT_ENABLE, MOST_LINES, Link, Register
from device.link.port import advice, open_port
from tests.device.scripted import ScriptedPort, ticking


def test_a_serial_line_runs_at_115200_baud() -> None:
    termios = pytest.importorskip("termios", reason="this system has no terminals")
    ours, theirs = os.openpty()
    try:
        port = open_port(os.ttyname(theirs))
        assert termios.tcgetattr(theirs)[4:6] == [termios.B115200, termios.B115200]
        port.close()
    finally:
        os.close(ours)
        os.close(theirs)


def linked(answers: dict[bytes, bytes], **options: bool) -> tuple[Link, ScriptedPort]:
    port = ScriptedPort(answers, **options)
    return Link(port, monotonic=ticking()), port


def test_a_query_is_one_line_in_one_write() -> None:
    link, port = linked({b"VOLT?\n": b"100\r\n"})
    assert link.ask("VOLT?") == "100"
    assert port.sent == [b"VOLT?\n"]


def test_a_late_answer_is_not_taken_as_the_answer_to_the_next_query() -> None:
    link, port = linked({b"FREQ?\n": b"24221\n"})
    with pytest.raises(LinkTimeout, match=r"no answer to 'VOLT\?' in time"):
        link.ask("VOLT?")
    port.pending = b"100\n"
    assert link.ask("FREQ?") == "24221"
    assert port.sent[1:5] == [b"*ESE 1\n", b"*ESE?\n", b"*ESE 2\n", b"*ESE?\n"]


def test_an_answer_that_arrives_during_synchronisation_is_ignored() -> None:
    link, port = linked({b"FREQ?\n": b"24221\n"})
    with pytest.raises(LinkTimeout, match="in time"):
        link.ask("VOLT?")
    port.answers[b"*ESE 1\n"] = b"1\n"  # equals the first token, so that a second is needed
    assert link.ask("FREQ?") == "24221"


def test_a_device_that_cannot_be_synchronised_is_an_error() -> None:
    link, _ = linked({}, deaf_to_sync=True)
    with pytest.raises(LinkTimeout, match="in time"):
        link.ask("VOLT?")
    with pytest.raises(LinkTimeout, match=r"within 1 s \(an earlier answer may be outst"):
        link.ask("FREQ?")


def test_unsolicited_lines_are_ignored() -> None:
    link, port = linked({b"FREQ?\n": b"24221\n"})
    port.pending = b"touchbeam board ready\n100\n"
    assert link.ask("FREQ?") == "24221"


def test_an_answer_that_is_cut_short_is_refused() -> None:
    link, _ = linked({b"VOLT?\n": b"10"})
    with pytest.raises(ProtocolError, match=r"answer to 'VOLT\?' was cut short, got b'10'"):
        link.ask("VOLT?")


def test_a_query_with_a_garbled_answer_is_repeated_once() -> None:
    link, port = linked({b"VOLT?\n": b"\xb1\xb0\n"})
    with pytest.raises(ProtocolError, match="in ASCII, got"):
        link.query("VOLT?", number)
    assert port.sent.count(b"VOLT?\n") == 2


def test_a_second_line_makes_an_answer_none() -> None:
    link, port = linked({b"OUTP?\n": b"0\n1\n"})
    with pytest.raises(ProtocolError, match=r"must answer 'OUTP\?' with one line, got two"):
        link.query("OUTP?", switch)
    assert port.sent.count(b"OUTP?\n") == 2


def test_a_block_may_hold_line_ends_and_answers() -> None:
    link, _ = linked({b"DATA?\n": b"#16\n1\n2\n\xff\n", b"FREQ?\n": b"24221\n"})
    assert link.block("DATA?", bytes) == b"\n1\n2\n\xff"
    assert link.ask("FREQ?") == "24221"


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (b"1\n", "must answer with a block, got b'1"),
        (b"#0ab\n", "must answer with a block, got b'#0ab"),
        (b"#9999999999\n", "must have a length of at most 2048 bytes, got b'999999999'"),
        (b"#2x1a\n", "must have a length of at most 2048 bytes, got b'x1'"),
        (b"#12abc\n", r"a block of 2 bytes must end there, got b'c\\n'"),
        (b"#15ab", "the answer to 'DATA\\?' was cut short, got b'#15ab'"),
        (b"#12ab\n#12ab\n", "with one block, got more"),
    ],
)
def test_a_broken_block_is_asked_for_again_once(answer: bytes, says: str) -> None:
    link, port = linked({b"DATA?\n": answer})
    with pytest.raises(ProtocolError, match=says):
        link.block("DATA?", bytes)
    assert port.sent.count(b"DATA?\n") == 2
    link, port = linked({b"DATA?\n": answer})
    port.on_repeat = {b"DATA?\n": b"#12ab\n"}
    assert link.block("DATA?", bytes) == b"ab"


def test_a_late_block_answers_neither_a_block_nor_a_line() -> None:
    late = b"#15\n1\n2\n\n"
    link, port = linked({b"DATA? 7\n": b"#11b\n", b"FREQ?\n": b"24221\n"})
    for after in ("block", "line"):
        with pytest.raises(LinkTimeout, match=r"no answer to 'DATA\? 0' in time"):
            link.block("DATA? 0", bytes)
        port.pending = late
        if after == "block":
            assert link.block("DATA? 7", bytes) == b"b"
        else:
            assert link.ask("FREQ?") == "24221"


def test_waiting_for_a_block_ends_by_the_stop() -> None:
    link, _ = linked({b"DATA?\n": b"#15ab"})
    link.stop()
    with pytest.raises(EmergencyStop, match="stopped by hand"):
        link.block("DATA?", bytes)


class Keeping(ScriptedPort):
    """Answers queries for its register, of which `put` and `get` are the words, in any line."""

    def __init__(self, answers: dict[bytes, bytes], put: str, get: str) -> None:
        super().__init__(answers, deaf_to_sync=True)
        self._put, self._get, self._number = put, get, ""

    def send(self, data: bytes) -> None:
        self.sent.append(data)
        said = []
        for part in data.decode().strip().split(";"):
            if part.startswith(self._put):
                self._number = part.removeprefix(self._put)
            elif part == self._get:
                said.append(self._number)
            else:
                said.append(self.answers[part.lstrip(":").encode()].decode())
        if said:
            self.pending += ";".join(said).encode() + b"\n"


PHASE = Register(put="C2:PHSE {}", get="C2?", told=re.compile(r"(\d+)"))


def certain(answer: bytes, register: Register) -> tuple[Link, Keeping]:
    port = Keeping({b"OUTP?": answer, b"VOLT?": b"5"}, register.put[:-2], register.get)
    link = Link(port, monotonic=ticking())
    link.register = register
    return link, port


def test_a_certain_answer_comes_with_a_number_in_one_line() -> None:
    link, port = certain(b"0", EVENT_ENABLE)
    assert link.certain(["OUTP?", "VOLT?"], list) == ["0", "5"]
    assert port.sent == [b"*ESE 1;*ESE?;:OUTP?;:VOLT?\n"]


def test_a_certain_answer_stands_alone_between_two_numbers() -> None:
    link, port = certain(b"0", PHASE)
    assert link.certain(["OUTP?", "VOLT?"], list) == ["0", "5"]
    told = [b"C2:PHSE 1\n", b"C2?\n", b"OUTP?\n", b"VOLT?\n", b"C2:PHSE 2\n", b"C2?\n"]
    assert port.sent == told


@pytest.mark.parametrize("register", [EVENT_ENABLE, PHASE], ids=["compound", "one a line"])
@pytest.mark.parametrize("answer", [b"0\n1", b"0\n0", b"1\n0", b"0;0"])
def test_no_stray_line_answers_a_certain_question(answer: bytes, register: Register) -> None:
    link, _ = certain(answer, register)
    with pytest.raises(ProtocolError, match="the device must answer"):
        link.certain(["OUTP?"], lambda answers: switch(answers[0]))


def test_a_stray_line_that_came_before_is_passed_over() -> None:
    for register in (EVENT_ENABLE, PHASE):
        link, port = certain(b"1", register)
        port.pending = b"0\n"
        assert link.certain(["OUTP?"], list) == ["1"]


def test_an_echo_is_detected() -> None:
    link, _ = linked({b"*IDN?\n": b"*IDN?\ntouchbeam,BOARD,1,1\n"})
    with pytest.raises(ProtocolError, match="the device echoes commands; switch its echo off"):
        link.identify()


@pytest.mark.parametrize(
    ("greeting", "answer", "says"),
    [
        (b"", b"*IDN?\r\nAgilent Technologies,33522A,1,2\r\n", "echoes commands"),
        (b"", b"33522A> *IDN?\r\nAgilent Technologies,33522A,1,2\r\n", "echoes commands"),
        (b"\xff\xfb\x01Welcome to the 33522A\r\n33522A> ", b"", r"sends a prompt, b'33522A> '"),
        (b"Welcome to the SDG2042X\n>>", b"", r"sends a prompt, b'>>'"),
        (b"", b">>Siglent Technologies,SDG2042X,1,2\n", r"sends a prompt, b'>>'"),
    ],
)
def test_a_telnet_port_is_recognised_by_its_echo_or_its_prompt(
    greeting: bytes, answer: bytes, says: str
) -> None:
    link, port = linked({b"*IDN?\n": answer})
    port.pending = greeting
    remedy = r".*; a telnet port \(5024\) does that: use .* such as socket://HOST:5025 \(5555 at"
    with pytest.raises(ProtocolError, match=f"the device {says}{remedy}"):
        link.identify()


@pytest.mark.parametrize("line", [b"-> booting\n", b"boot>\n"])
def test_a_line_of_a_start_up_that_looks_like_a_prompt_is_ignored(line: bytes) -> None:
    link, port = linked({b"*IDN?\n": line + b"touchbeam,BOARD,1,1\r\n"})
    port.pending = line
    assert link.identify() == "touchbeam,BOARD,1,1"


def test_start_up_messages_are_ignored() -> None:
    link, port = linked({b"*IDN?\n": b"ready\r\n\xff\ntouchbeam,BOARD,1,1\r\n"})
    port.pending = b"booting, please wait\n"
    assert link.identify() == "touchbeam,BOARD,1,1"


def test_a_device_that_does_not_identify_itself_is_quoted() -> None:
    link, _ = linked({b"*IDN?\n": b"Rigol,DG1022\n"})
    with pytest.raises(LinkTimeout, match=r"within 5 s; its last message was b'Rigol,DG1022'"):
        link.identify()


class Endless(ScriptedPort):
    """A port that delivers lines at every read."""

    def receive(self, timeout_s: float) -> bytes:
        return b"unasked\n" * 30


def test_a_device_that_sends_without_end_is_an_error() -> None:
    link = Link(Endless({}), monotonic=ticking(1e-4))
    with pytest.raises(ProtocolError, match="keeps sending unsolicited lines"):
        link.ask("VOLT?")
    assert len(link._lines) <= MOST_LINES + 60


def test_stop_ends_a_wait() -> None:
    link, _ = linked({})
    link.stop()
    with pytest.raises(EmergencyStop, match="stopped by hand"):
        link.ask("VOLT?")
    link.tell("OUTP OFF")


class Gone(ScriptedPort):
    """A port that was unplugged."""

    def receive(self, timeout_s: float) -> bytes:
        raise OSError(errno.EIO, "Input/output error")

    def send(self, data: bytes) -> None:
        raise OSError(errno.EIO, "Input/output error")


def test_a_port_that_is_gone_is_reported() -> None:
    link = Link(Gone({}))
    with pytest.raises(DeviceError, match=r"cannot send 'OUTP OFF' to .* Input/output error"):
        link.tell("OUTP OFF")
    with pytest.raises(DeviceError, match=r"the device is gone: .* Input/output error"):
        link.ask("VOLT?")


@pytest.mark.parametrize(
    ("number", "message"),
    [
        (errno.ENOENT, "no such port; is the device plugged in"),
        (errno.EACCES, "permission denied; add yourself to the group dialout"),
        (errno.EBUSY, "in use by another program; close it first"),
        (errno.EAGAIN, "in use by another program; close it first"),
        (errno.EHOSTDOWN, "pair it over Bluetooth first"),
        (errno.ENOTTY, "is not a serial port"),
        (errno.ECONNREFUSED, "the connection was refused; is the device on"),
        (errno.EHOSTUNREACH, "check the network cable"),
        (errno.ENXIO, "cannot be opened"),
    ],
)
def test_a_port_that_cannot_be_opened_comes_with_advice(number: int, message: str) -> None:
    hidden = OSError(f"could not open port: {number}")
    hidden.__context__ = OSError(number, "the system's own words")
    assert message in advice(hidden)


@pytest.mark.parametrize(
    ("took_s", "why"),
    [
        (0.5, "Write timeout"),
        (3.0, r"nothing moved for 3.0 s, where the port gives up after 0.4 s \(the program may "),
    ],
)
def test_a_write_that_the_computer_slept_through_says_so(took_s: float, why: str) -> None:
    now_s = 0.0

    class Slept(ScriptedPort):
        def send(self, data: bytes) -> None:
            nonlocal now_s
            now_s += took_s
            raise OSError("Write timeout")

    link = Link(Slept({}), monotonic=lambda: now_s)
    with pytest.raises(DeviceError, match=f"^cannot send 'OUTP OFF' to the device: {why}"):
        link.tell("OUTP OFF")
