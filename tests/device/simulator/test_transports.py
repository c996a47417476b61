"""The loopback port of a simulated device: one host after the other, and one at a time."""

import socket
from collections.abc import Iterator
from urllib.parse import urlsplit

import pytest

from device.simulator.client import simulator_process
from device.simulator.transports import TcpLine
from tests.device.rigs import TOUCHBEAM

pytestmark = pytest.mark.waits

RECONNECTS = 200


@pytest.fixture
def line() -> Iterator[TcpLine]:
    line = TcpLine(0)
    yield line
    line.close()


def connected(url: str) -> socket.socket:
    place = urlsplit(url)
    host = socket.create_connection((place.hostname, place.port or 0), timeout=2)
    host.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return host


def test_a_host_that_comes_while_another_hangs_up_is_served() -> None:
    with simulator_process(TOUCHBEAM, seed=1, wire="tcp", keep=True) as endpoints:
        for number in range(RECONNECTS):
            with connected(endpoints.url) as host:
                host.sendall(b"SYST:BOOT?\n")
                assert host.recv(100) == b"1\n", number
                if number % 2:
                    host.sendall(b"OUTP OFF\nVOLT")  # the next host does not end this line


def test_the_next_host_is_let_in_once_the_first_is_gone(line: TcpLine) -> None:
    with connected(line.url) as first:
        line.receive()
        line.receive()
        first.sendall(b"last words")
    with connected(line.url) as second:
        second.sendall(b"first words")
        assert [line.receive() for _ in range(4)] == [b"last words", None, b"", b"first words"]


def test_a_second_host_is_turned_away(line: TcpLine) -> None:
    with connected(line.url) as first, connected(line.url) as second:
        first.sendall(b"here")
        assert [line.receive() for _ in range(3)] == [b"", b"here", b""]
        assert second.recv(1) == b""
        first.sendall(b"still here")
        assert line.receive() == b"still here"
