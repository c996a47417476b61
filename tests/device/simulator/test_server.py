"""The simulated device is ready when it says so, and ends silently, whatever it is doing."""

import itertools
import signal
import subprocess
import sys
from types import FrameType
from typing import Any

from device.simulator.server import _Ending

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
