"""What the link costs, against the same bytes by pySerial alone, interleaved in the same run."""

import os
import select
import sys
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median, quantiles
from typing import Any

import pytest
import serial

from device.drivers.board import Board
from device.drivers.limits import Limits
from device.force_channel.blocks import encoded
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
    _report(benchmark, taken, most=1.3)


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
    _report(benchmark, taken, most=1.4)


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
    _report(benchmark, taken, most=10)


def _seconds(work: Callable[[], None]) -> float:
    start_s = time.perf_counter()
    work()
    return time.perf_counter() - start_s


def _report(benchmark: Any, taken: dict[str, list[float]], most: float) -> None:
    ratio = median(taken["ours"]) / median(taken["raw"])
    for name, seconds in taken.items():
        p99 = quantiles(seconds, n=100)[-1] if len(seconds) > 100 else max(seconds)
        benchmark.extra_info[name] = {"median_us": 1e6 * median(seconds), "p99_us": 1e6 * p99}
        print(f"{name}: median {1e6 * median(seconds):.0f} us, p99 {1e6 * p99:.0f} us")
    print(f"ratio of the medians: {ratio:.2f}, at most {most}")
    benchmark.extra_info["ratio"] = ratio
    assert ratio <= most
