"""What the link costs, against the same bytes by pySerial alone, interleaved in the same run."""

import os
import select
import sys
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import pyvisa
import serial
from pyvisa.resources import MessageBasedResource

from benchmarks.compared import compare
from device.drivers.board import Board
from device.drivers.limits import Limits
from device.force_channel.recording import encoded
from device.link.codec import LineBuffer, text
from device.link.codec import block as in_block
from device.link.link import open_link
from device.link.port import SerialPort
from device.simulator.client import Endpoints, simulator_process

TOUCHBEAM = (str(Path(sys.executable).with_name("touchbeam")),)
LIMITS = Limits(max_voltage_v=120, max_frequency_hz=40_000, ramp_v_per_s=400, watchdog_s=5)
ROUNDS = 1_000
FLOOD = 20_000
SET_AND_READ_BACK = (b"FREQ 24221.37\n", b"*OPC?\n", b"SYST:ERR?\n", b"FREQ?\n")


@pytest.fixture(params=["pty", "tcp"])
def simulator(request: pytest.FixtureRequest) -> Iterator[Endpoints]:
    with simulator_process(TOUCHBEAM, seed=1, wire=request.param, keep=True) as endpoints:
        yield endpoints


def test_set_and_read_back_against_raw_pyserial(benchmark: Any, simulator: Endpoints) -> None:
    link = open_link(simulator.url)
    board = Board(link, LIMITS)
    board.arm()
    port = link._port._port  # the same port, so that both see the same simulator

    def ours() -> None:
        board.set_number("FREQ", 24221.37)

    def raw() -> None:
        for line in SET_AND_READ_BACK:
            port.write(line)
            if b"?" in line:
                got = b""
                while not got.endswith(b"\n"):
                    select.select([port.fileno()], [], [], 1)
                    got += port.read(4096)

    taken = {"ours": [], "raw": []}
    for _ in range(ROUNDS):
        taken["ours"].append(_seconds(ours))
        taken["raw"].append(_seconds(raw))
    benchmark.pedantic(ours, rounds=100)
    link.close()
    work = f"set a frequency, wait, read errors and value back, by {wire(simulator)}"
    assert compare(benchmark, work, "pySerial, the same lines", taken["ours"], taken["raw"]) <= 1.3


def test_set_and_read_back_against_pyvisa(benchmark: Any) -> None:
    """Two simulated devices, because each has one host at a time."""
    with (
        simulator_process(TOUCHBEAM, seed=1, wire="tcp", keep=True) as ours_at,
        simulator_process(TOUCHBEAM, seed=1, wire="tcp", keep=True) as theirs_at,
    ):
        link = open_link(ours_at.url)
        board = Board(link, LIMITS)
        board.arm()
        port = theirs_at.url.rpartition(":")[2]
        visa = pyvisa.ResourceManager("@py").open_resource(f"TCPIP::127.0.0.1::{port}::SOCKET")
        assert isinstance(visa, MessageBasedResource)
        visa.read_termination = visa.write_termination = "\n"

        def theirs() -> None:
            for line in SET_AND_READ_BACK:
                ask = visa.query if b"?" in line else visa.write
                ask(line.decode().strip())

        pairs = [
            (_seconds(lambda: board.set_number("FREQ", 24221.37)), _seconds(theirs))
            for _ in range(ROUNDS // 2)
        ]
        benchmark.pedantic(theirs, rounds=50)
        visa.close()
        link.close()
    work = "set a frequency, wait, read errors and value back, by TCP"
    assert (
        compare(benchmark, work, "PyVISA (pyvisa-py), the same lines", *zip(*pairs, strict=True))
        <= 1.3
    )


def test_a_block_of_samples_against_raw_pyserial(benchmark: Any, simulator: Endpoints) -> None:
    """A whole block of 50 ms at 1 kHz, asked for, checked and decoded."""
    link = open_link(simulator.url)
    board = Board(link, LIMITS)
    board.arm()
    board.start_sampling(1000)
    time.sleep(0.1)
    port = link._port._port
    size = len(in_block(encoded(board.sampled(0, lambda found: found)))) + 1

    def ours() -> None:
        assert board.sampled(0, lambda found: found).count == 50

    def raw() -> None:
        port.write(b"TRAC:DATA? 0\n")
        got = 0
        while got < size:
            select.select([port.fileno()], [], [], 1)
            got += len(port.read(4096))

    taken = {"ours": [], "raw": []}
    board.stop_sampling()
    for _ in range(ROUNDS):
        taken["ours"].append(_seconds(ours))
        taken["raw"].append(_seconds(raw))
    benchmark.pedantic(ours, rounds=100)
    link.close()
    work = f"fetch, check and decode 50 ms of samples, by {wire(simulator)}"
    assert compare(benchmark, work, "pySerial, the bytes alone", taken["ours"], taken["raw"]) <= 1.4


class Flood:
    """Bytes through a pseudo-terminal, read by our port and buffer, and by pySerial alone."""

    def __init__(self) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self._raw = serial.serial_for_url(os.ttyname(self._slave), timeout=0)
        self._port = SerialPort(self._raw)

    def raw(self) -> None:
        """By pySerial alone."""

        def receive() -> int:
            select.select([self._raw.fileno()], [], [], 1)
            return len(self._raw.read(65_536))

        self._through(receive)

    def ours(self) -> None:
        """By our port and buffer."""
        buffer, lines = LineBuffer(), []

        def receive() -> int:
            chunk = self._port.receive(1)
            lines.extend(text(line) for line in buffer.feed(chunk))
            return len(chunk)

        self._through(receive)
        assert len(lines) == FLOOD

    def close(self) -> None:
        """Give everything back."""
        self._raw.close()
        os.close(self._master)
        os.close(self._slave)

    def _through(self, receive: Callable[[], int]) -> None:
        """As much at a time as a pseudo-terminal holds."""
        burst = b"unasked 24221.37\n" * 200
        for _ in range(FLOOD // 200):
            os.write(self._master, burst)
            got = 0
            while got < len(burst):
                got += receive()


def test_a_flood_against_reading_the_same_bytes_raw(benchmark: Any) -> None:
    flood = Flood()
    taken = {"ours": [], "raw": []}
    for _ in range(10):
        taken["ours"].append(_seconds(flood.ours))
        taken["raw"].append(_seconds(flood.raw))
    benchmark.pedantic(flood.ours, rounds=3)
    flood.close()
    work = "read 20,000 lines that nobody asked for"
    assert compare(benchmark, work, "pySerial, the bytes alone", taken["ours"], taken["raw"]) <= 10


def wire(simulator: Endpoints) -> str:
    """The kind of line, in words."""
    return "TCP" if "://" in simulator.url else "a pseudo-terminal"


def _seconds(work: Callable[[], None]) -> float:
    start_s = time.perf_counter()
    work()
    return time.perf_counter() - start_s
