"""The simulated device as a whole, and the loop that serves its wire and its control socket.

One thread. It ends when its host is gone, after the watchdog has taken the output to 0 V.
"""

import select
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from device.errors import DeviceError
from device.simulator.beam import SimulatedBeam
from device.simulator.board import BoardDialect
from device.simulator.clock import DeviceClock
from device.simulator.control import Control
from device.simulator.door import ControlDoor
from device.simulator.instrument import Instrument
from device.simulator.lines import Line
from device.wire import LineBuffer

TICK_S = 0.01
"""How often the watchdog is looked at."""


@dataclass(frozen=True, kw_only=True)
class SimulatedDevice:
    """What is inside the device."""

    instrument: Instrument
    dialect: BoardDialect
    control: Control
    clock: DeviceClock

    def answer(self, line: str, wall_s: float) -> str | None:
        """Take one line from the wire; any line keeps the watchdog quiet."""
        self.instrument.hear(wall_s)
        self.instrument.advance_to(self.clock.now_s())
        return self.dialect.answer(line)

    def answer_control(self, line: str) -> str:
        """Take one line from the control socket."""
        self.instrument.advance_to(self.clock.now_s())
        return self.control.answer(line)


def simulated_device(seed: int, wall_s: Callable[[], float] = time.monotonic) -> SimulatedDevice:
    """Return a board with a beam whose hidden properties follow from `seed`."""
    instrument, beam, clock = Instrument(), SimulatedBeam(seed), DeviceClock(wall_s)
    return SimulatedDevice(
        instrument=instrument,
        dialect=BoardDialect(instrument, beam),
        control=Control(instrument, beam, clock),
        clock=clock,
    )


def serve(
    device: SimulatedDevice,
    line: Line,
    door: ControlDoor | None,
    *,
    keep: bool = False,
    orphaned: Callable[[], bool] = lambda: False,
    wall_s: Callable[[], float] = time.monotonic,
) -> None:
    """Serve until the host is gone and the output is off; for ever if `keep`.

    `orphaned` says whether whoever started us is gone, so that a host which never came is no
    reason to wait for ever.
    """
    buffer = LineBuffer()
    gone = False
    while keep or not gone or device.instrument.output:
        _wait(line if not gone else None, door)
        received = line.receive()
        gone = received is None or orphaned()
        for text in _lines(buffer, received or b""):
            _reply(line, device.answer(text, wall_s()))
        if door is not None:
            door.serve(device.answer_control)
        device.instrument.watch(wall_s())


def _wait(line: Line | None, door: ControlDoor | None) -> None:
    """Wait until somebody does something, a tick at most; a line that hung up is no somebody."""
    sources: list[Any] = [*([line] if line else []), *(door.sockets() if door else [])]
    select.select(sources, [], [], TICK_S)


def _reply(line: Line, answer: str | None) -> None:
    if answer is not None:
        line.send(answer.encode("ascii") + b"\n")


def _lines(buffer: LineBuffer, received: bytes) -> list[str]:
    """Whole lines; what is no line of text is dropped, as a real device would."""
    try:
        return buffer.feed(received)
    except DeviceError:
        return []
