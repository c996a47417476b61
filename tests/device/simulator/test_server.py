"""The simulated device ends when it is told to, silently, whatever it is doing."""

import itertools
import signal
import sys
from types import FrameType
from typing import Any

from device.simulator.server import _Ending

SENT = signal.SIGTERM


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
