"""The simulated device is ready when it says so, and ends silently, whatever it is doing."""

import itertools
import signal
import subprocess
import sys
from types import FrameType
from typing import Any

import pytest

from device.simulator.device import SimulatedDevice
from device.simulator.server import Server, _Ending

SENT = signal.SIGTERM
TOUCHED_WHEN_READY = """
import sys
import numpy as np
from device.simulator.device import SimulatedDevice
from device.simulator.server import simulate

device = SimulatedDevice(1)

def touched(said):
    loaded = set(sys.modules)
    device.beam.touch(0.5, 0.04, "right", 0.02)
    device.beam.forces(np.zeros(1), np.full(1, 100.0), 24_000.0)
    print(said.partition(" ")[0], sorted(set(sys.modules) - loaded))
    raise SystemExit

simulate("tcp", "0", None, lambda: device, keep=False, say=touched)
"""


def test_its_first_touch_loads_nothing() -> None:
    ran = subprocess.run(
        [sys.executable, "-c", TOUCHED_WHEN_READY], capture_output=True, text=True, check=True
    )
    assert ran.stdout == "ready []\n"


class _Line:
    """A wire with nothing at its other end."""

    url = ""

    def __init__(self) -> None:
        self.heard, self.sent = b"", b""

    def fileno(self) -> int:
        return -1

    def receive(self) -> bytes:
        heard, self.heard = self.heard, b""
        return heard

    def send(self, data: bytes) -> None:
        self.sent += data

    def hang_up(self) -> None: ...
    def come_back(self) -> None: ...
    def close(self) -> None: ...


@pytest.mark.parametrize("fault", ["slow-drip", "late-reply"])
def test_after_a_reset_nothing_comes_late(fault: str) -> None:
    line, now_s = _Line(), [0.0]
    server = Server(SimulatedDevice(1), line, None, lambda: now_s[0])
    server.answer_control(f"fault {fault} on")
    line.heard = b"*IDN?\n"
    server.step()
    server.answer_control("reset")
    line.sent, line.heard, now_s[0] = b"", b"*OPC?\n", 100.0
    server.step()
    assert line.sent == b"1\n"


def test_after_a_reset_a_stale_block_is_none_from_before() -> None:
    line = _Line()
    server = Server(SimulatedDevice(1), line, None, lambda: 0.0)
    for fault in ("block-truncated-once", "block-stale"):
        server.answer_control(f"fault {fault} on")
        line.sent, line.heard = b"", b"TRAC:STAT ON\nTRAC:DATA? 0\n"
        server.step()
        server.answer_control("reset")
    assert line.sent.endswith(b"\n")


def test_a_signal_ends_what_serves() -> None:
    ending, done = _Ending(), []

    def serve() -> None:
        done.append("serving")
        ending.ask(SENT, None)
        done.append("too late")

    ending.ends(serve)
    assert done == ["serving"]


def test_a_signal_before_it_serves_is_not_forgotten() -> None:
    ending, done = _Ending(), []
    ending.ask(SENT, None)
    ending.ends(lambda: done.append("too late"))
    assert done == []


def test_a_signal_while_it_is_cleared_away_changes_nothing() -> None:
    ending, done = _Ending(), []
    ending.ends(lambda: done.append("served"))
    ending.ask(SENT, None)
    assert done == ["served"]


def test_a_signal_at_any_instruction_is_silent() -> None:
    for instruction in itertools.count(0):  # Python 3.12 begins to count with the second call
        ending, left = _Ending(), [instruction]

        def tracer(frame: FrameType, event: str, _: object, left: list[int] = left) -> Any:
            frame.f_trace_opcodes = frame.f_code is _Ending.ends.__code__
            if event == "opcode":
                left[0] -= 1
                if left[0] == 0:
                    signal.raise_signal(SENT)
            return tracer

        before, handler = sys.gettrace(), signal.signal(SENT, ending.ask)
        sys.settrace(tracer)
        try:
            ending.ends(lambda: None)
        finally:
            sys.settrace(before)
            signal.signal(SENT, handler)
        if instruction and left[0] > 0:
            break
    assert instruction > 10
