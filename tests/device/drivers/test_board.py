"""The board's driver over a real byte path: a simulated device in a process of its own."""

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import pytest

from device.drivers.board import Board
from device.drivers.limits import Limits, Setpoint
from device.errors import DeviceError, ForeignOutput, OutputUnknown
from device.link.link import Link, open_link
from device.simulator.client import ControlClient, Endpoints, simulator_process
from device.simulator.in_process import InProcessDevice
from protocol.address import AddressError
from tests.device.lying import lying
from tests.device.scripted import ScriptedPort, ticking

TOUCHBEAM = (str(Path(sys.executable).with_name("touchbeam")),)
LIMITS = Limits(max_voltage_v=120, max_frequency_hz=40_000, ramp_v_per_s=400, watchdog_s=5)


@pytest.fixture(scope="module")
def simulator() -> Iterator[Endpoints]:
    with simulator_process(TOUCHBEAM, seed=1) as endpoints:
        yield endpoints


@pytest.fixture(scope="module")
def board(simulator: Endpoints) -> Iterator[Board]:
    board = Board(open_link(simulator.url), LIMITS)
    yield board
    board.close()


@pytest.fixture
def control(simulator: Endpoints) -> Iterator[ControlClient]:
    with ControlClient(simulator.control) as control:
        yield control


def setpoint(voltage_v: float) -> Setpoint:
    return Setpoint(voltage_v=voltage_v, frequency_hz=24221.37, ramp_v_per_s=400)


def test_arming_leaves_the_output_off_and_the_limits_set(
    board: Board, control: ControlClient
) -> None:
    identity = board.arm()
    assert identity.idn.startswith("touchbeam,BOARD")
    assert identity.boot == 1
    state = control.state()
    assert (state["output"], state["watchdog_s"]) == (False, 5.0)


def test_a_drive_is_read_back_and_off_is_off(board: Board, control: ControlClient) -> None:
    board.arm()
    read_back = board.drive(setpoint(100))
    assert (read_back.output, read_back.voltage_v) == (True, 100)
    assert read_back.frequency_hz == 24221.37
    assert control.state()["output"] is True
    board.off()
    assert control.state()["output"] is False


def test_a_step_of_a_sweep_sets_the_frequency_alone() -> None:
    device = InProcessDevice(seed=1)
    port = device.port()
    board = Board(Link(port, device.now_s), LIMITS, device.now_s)
    board.arm()
    board.drive(setpoint(100))
    with patch.object(port, "send", wraps=port.send) as send:
        read_back = board.drive(replace(setpoint(100), frequency_hz=24_000.0))
    sent = [call.args[0] for call in send.call_args_list]
    assert [data for data in sent if b"?" not in data] == [b"FREQ 24000\n"]
    assert (read_back.voltage_v, read_back.frequency_hz) == (100, 24_000)
    assert board.drive(setpoint(90)).voltage_v == 90


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (setpoint(121), r"voltage_v must lie in \[0, 120\], got 121"),
        (setpoint(float("nan")), "voltage_v .* got nan"),
        (
            Setpoint(voltage_v=1, frequency_hz=50_000, ramp_v_per_s=1),
            r"frequency_hz must .* 40000\], got 50000",
        ),
        (
            Setpoint(voltage_v=1, frequency_hz=1000, ramp_v_per_s=500),
            r"ramp_v_per_s must .* 400\], got 500",
        ),
    ],
)
def test_the_driver_refuses_what_exceeds_the_limits(
    board: Board, control: ControlClient, wrong: Setpoint, message: str
) -> None:
    board.arm()
    with pytest.raises(ValueError, match=message):
        board.drive(wrong)
    assert control.state()["output"] is False


def test_the_device_refuses_it_too(board: Board, control: ControlClient) -> None:
    board.arm()
    with pytest.raises(DeviceError, match="VOLT was refused by the device: -222 Data out of range"):
        board.send("VOLT 121")
    assert control.state()["output"] is False


def scripted(answers: dict[bytes, bytes]) -> tuple[Board, ScriptedPort]:
    port = ScriptedPort(answers)
    return Board(Link(port, monotonic=ticking()), LIMITS), port


def test_what_a_drive_before_had_is_too_much_for_the_next_from_its_beginning() -> None:
    board, port = lying(LIMITS)
    board.drive(setpoint(100))
    board.off()
    port.lies = {"VOLT:INST?": ["60"], "MEAS:VOLT?": ["60"]}
    with pytest.raises(DeviceError, match="the amplitude must not exceed 20"):
        board.drive(setpoint(20))


@pytest.mark.parametrize(("driven", "answer"), [(True, "0"), (False, "1")])
def test_an_output_that_was_switched_for_a_moment_is_a_fault(driven: bool, answer: str) -> None:
    board, port = lying(LIMITS)
    if driven:
        board.drive(setpoint(100))
    port.lies = {"OUTP?": [answer, "1" if driven else "0"]}
    told = "turned its output off by itself" if driven else "is on, and nobody here switched it on"
    with pytest.raises(DeviceError, match=f"{told}$"):
        board.read_back()


def test_another_device_is_told_nothing_but_off() -> None:
    board, port = scripted({b"*IDN?\n": b"Rigol,DG1022,1,2\n"})
    with pytest.raises(ForeignOutput, match=r"expected a board .* got 'Rigol,DG1022,1,2'"):
        board.arm()
    with pytest.raises(
        OutputUnknown, match=r"^output state UNKNOWN - cut the amplifier \(expected"
    ):
        board.off()
    assert port.sent == [b"OUTP OFF\n", b"*IDN?\n"]


@pytest.mark.parametrize("answer", [b"1;0\n", b"", b"what?;0\n", b"0\n", b"0;what?\n", b"0;0"])
def test_off_is_off_only_when_read_back(answer: bytes) -> None:
    board, _ = scripted({b"OUTP?;:MEAS:VOLT?\n": answer})
    with pytest.raises(OutputUnknown, match="output state UNKNOWN - cut the amplifier"):
        board.off()


def test_off_is_sent_and_asked_again_where_one_answer_is_lost() -> None:
    question = b"OUTP?;:MEAS:VOLT?\n"
    board, port = scripted({question: b""})
    port.on_repeat = {question: b"0;0\n"}
    board.off()
    assert port.sent.count(b"OUTP OFF\n") == 2
    assert port.sent[-1] == question


@pytest.mark.parametrize(
    ("url", "kind", "message"),
    [
        ("/dev/ttyNOPE", DeviceError, "no such port; is the device plugged in"),
        ("/dev/rfcomm7", DeviceError, "no such port; .*; a Bluetooth device must be paired"),
        ("frob://x", AddressError, "not the address of a device"),
        ("loop://", AddressError, "loop://: not the address of a device"),
        ("socket://127.0.0.1:1?logging=debug", AddressError, "not the address of a device"),
        ("socket://127.0.0.1:1", DeviceError, "cannot be opened: the connection was refused"),
        ("/dev", AddressError, "got a plain folder"),
        (__file__, AddressError, "got a plain file"),
    ],
)
def test_a_port_that_does_not_work_is_explained(
    url: str, kind: type[Exception], message: str
) -> None:
    with pytest.raises(kind, match=message):
        open_link(url)


def test_opening_a_file_leaves_it_as_it_was(tmp_path: Path) -> None:
    file, link = tmp_path / "thesis.tex", tmp_path / "ttyUSB0"
    file.write_text("a chapter")
    link.symlink_to(file)
    for path in (file, link):
        with pytest.raises(AddressError, match=f"{path}: .* got a plain file"):
            open_link(str(path))
    assert file.read_text() == "a chapter"


def test_a_second_program_is_kept_off(simulator: Endpoints, board: Board) -> None:
    with pytest.raises(DeviceError, match="in use by another program"):
        open_link(simulator.url)
    assert board.output() is False
