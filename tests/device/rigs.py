"""A rig on a simulated device in a process of its own, over a real byte path."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from device.drivers.limits import Amplifier, Limits, Setpoint
from device.errors import DeviceError
from device.rig import Rig, open_rig
from device.simulator.client import ControlClient
from protocol.journal.records import ReadBack

TOUCHBEAM = (str(Path(sys.executable).with_name("touchbeam")),)
LIMITS = Limits(
    max_voltage_v=120,
    max_frequency_hz=40_000,
    ramp_v_per_s=400,
    watchdog_s=0.5,
    amplifier=Amplifier(gain=20.0),
)
DRIVE = Setpoint(voltage_v=100, frequency_hz=24221.37, ramp_v_per_s=400)


@contextmanager
def opened(url: str, dialect: str = "board", limits: Limits = LIMITS) -> Iterator[Rig]:
    """A rig that is closed afterwards, whatever its device thinks of it."""
    rig = open_rig(url, limits, dialect)
    try:
        yield rig
    finally:
        with suppress(DeviceError):
            rig.close()


def driven_on(rig: Rig, control: ControlClient, seconds: float = 0.3) -> ReadBack:
    """Let the session live on for a while, then drive again; raises what the rig raises."""
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        rig.beat()
        control.state()
        _pause()
    return rig.drive(DRIVE)


def until(condition: Callable[[], bool], within_s: float) -> bool:
    """Whether `condition` becomes true within `within_s`."""
    end_s = time.monotonic() + within_s
    while time.monotonic() < end_s:
        if condition():
            return True
        _pause()
    return condition()


def _pause() -> None:
    time.sleep(0.005)  # asked without one, a simulator and this process fill both cores
