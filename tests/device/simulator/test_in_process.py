"""The device in the test's own process: the same bytes and models, on simulated time."""

import random
import threading
from datetime import UTC, datetime

import pytest

from device.errors import DeviceError, OutputUnknown
from device.rig import Rig
from device.simulator.in_process import InProcessDevice, in_process_rig
from tests.device.in_process_clock import InProcessClock
from tests.device.rigs import DRIVE, LIMITS


def a_rig(seed: int = 1, longest_s: float = 0.003) -> tuple[InProcessDevice, Rig, InProcessClock]:
    stream = random.Random(seed)
    device = InProcessDevice(
        seed,
        delay_s=lambda: stream.uniform(0.0002, longest_s),
        cuts=lambda length: sorted(stream.sample(range(length), min(2, length))),
    )
    rig = in_process_rig(device, LIMITS)
    return device, rig, InProcessClock(datetime(2026, 1, 1, tzinfo=UTC), device, rig)


def a_session() -> tuple[float | None, ...]:
    device, rig, clock = a_rig()
    rig.arm()
    found = rig.resonance(24_221.0, clock.sleep)
    rig.drive(DRIVE)
    for _ in range(40):
        rig.beat()
        clock.sleep(0.05)
    shown_v = rig.read_back().monitor_v
    rig.close()
    assert shown_v == pytest.approx(100, abs=1)
    return found.frequency_hz, shown_v, device.now_s()


def test_a_device_in_process_is_the_same_each_time_and_needs_no_thread() -> None:
    before = threading.active_count()
    assert a_session() == a_session()
    assert threading.active_count() == before


def test_a_session_that_does_not_beat_is_ended_by_the_watchdog_at_its_moment() -> None:
    device, rig, clock = a_rig()
    rig.arm()
    rig.drive(DRIVE)
    heard_s = device.state()["heard_wall_s"]
    clock.sleep(2.0)
    state = device.state()
    assert (state["output"], state["cause"]) == (False, "WATC")
    assert state["tripped_wall_s"] <= heard_s + LIMITS.watchdog_s + 0.1, "one feed later"


def test_an_unread_line_holds_what_it_can_and_then_times_out() -> None:
    device, rig, _ = a_rig()
    rig.arm()
    port = device.port()
    device.fault("deaf")
    began_s = device.now_s()

    def fill() -> None:
        for _ in range(10_000):
            port.send(b"VOLT 0\n")

    with pytest.raises(OSError, match="Write timeout"):
        fill()
    assert device.now_s() - began_s == pytest.approx(0.4), "as long as an answer may take"


def test_a_vanished_port_is_gone_until_it_is_opened_anew() -> None:
    device, rig, _ = a_rig()
    rig.arm()
    device.fault("vanish")
    with pytest.raises(OutputUnknown, match="the port is closed or has vanished"):
        rig.off()
    with pytest.raises(OSError, match="no such port"):
        device.port()
    device.fault("vanish", on=False)
    with pytest.raises(DeviceError, match="the port is closed or has vanished"):
        rig.off()
    assert in_process_rig(device, LIMITS).arm().idn.startswith("touchbeam,BOARD")
