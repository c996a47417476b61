"""The force channel over real byte paths: nothing lost or doubled, and off as fast as ever."""

import os
import signal
import subprocess
import sys
import threading
import time
from array import array
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

import pytest

from device.errors import DeviceError, EmergencyStop
from device.force_channel.recording import Samples
from device.rig import Rig
from device.simulator.client import ControlClient, Endpoints, simulator_process
from runner.clock import SteppedClock
from tests.device.rigs import DRIVE, LIMITS, TOUCHBEAM, driven_on, opened, until

pytestmark = pytest.mark.waits

ROOT = Path(__file__).parents[2]
SPEED_M_S = 0.001
NOISES = ("jitter", "tangential_noise_n", "normal_noise_n", "position_noise_m", "drift_n_per_min")


@pytest.fixture(scope="module", params=["pty", "tcp"])
def simulator(request: pytest.FixtureRequest) -> Iterator[Endpoints]:
    with simulator_process(TOUCHBEAM, seed=1, wire=request.param, keep=True) as endpoints:
        yield endpoints


@contextmanager
def noiseless(simulator: Endpoints) -> Iterator[ControlClient]:
    """Control a device whose sensors show what is there."""
    with ControlClient(simulator.control) as control:
        control.reset()
        for noise in NOISES:
            control.sensor(noise, 0.0)
        yield control


@pytest.fixture
def control(simulator: Endpoints) -> Iterator[ControlClient]:
    with noiseless(simulator) as control:
        yield control


def recorded(rig: Rig, control: ControlClient, seconds: float) -> Samples:
    """A slide at 1 kHz, driven, with the read-backs of a session."""
    rig.arm()
    rig.drive(DRIVE)
    control.touch(0.5, 0.02, "right", SPEED_M_S)
    rig.record(1000)
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        assert rig.read_back().output
        rig.beat()
        time.sleep(0.02)
    rig.off()
    return rig.recorded()


def require_complete(samples: Samples, seconds: float, tolerance_counts: float = 1.1) -> None:
    """Each sample is there once: the finger moves on by the same way from each to the next."""
    counts = array("h", samples.counts)
    positions = counts[2 * len(counts) // 3 :]
    assert seconds * 1000 <= len(positions) < (seconds + 1) * 1000
    for number, count in enumerate(positions):
        moved_m = (count - positions[0]) * samples.scale[2]
        tolerance_m = tolerance_counts * samples.scale[2]
        assert moved_m == pytest.approx(SPEED_M_S * number / 1000, abs=tolerance_m)


def test_seconds_at_1_khz_are_complete(simulator: Endpoints, control: ControlClient) -> None:
    with opened(simulator.url) as rig:
        samples = recorded(rig, control, seconds=4)
    require_complete(samples, 4)
    assert samples.clock_error_s < 0.1


@pytest.mark.soak
def test_a_minute_at_1_khz_is_complete(simulator: Endpoints, control: ControlClient) -> None:
    with opened(simulator.url) as rig:
        require_complete(recorded(rig, control, seconds=60), 60)


def test_a_session_on_a_stepped_clock_waits_for_its_samples() -> None:
    """Ten seconds pass in less than ten: the board would have to keep more than it can."""
    with (
        simulator_process(TOUCHBEAM, seed=1, keep=True) as stepped,
        ControlClient(stepped.control) as control,
        opened(stepped.url) as rig,
    ):
        clock = SteppedClock(datetime(2026, 1, 1, tzinfo=UTC), control.advance)
        clock.sleep(1.0)
        for noise in NOISES:
            control.sensor(noise, 0.0)
        rig.arm()
        control.touch(0.5, 0.02, "right", SPEED_M_S)
        rig.record(1000, clock.monotonic_s)
        for _ in range(500):
            rig.beat()
            clock.sleep(0.02)
        samples = rig.recorded()
    require_complete(samples, 10)
    assert samples.clock_error_s < 1e-6
    assert samples.first_s + samples.clock_offset_s == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("fault", ["block-garbled-once", "block-doubled-once"])
def test_a_broken_or_doubled_block_leaves_no_trace(
    fault: str, simulator: Endpoints, control: ControlClient
) -> None:
    with opened(simulator.url) as rig, ControlClient(simulator.control) as hand:
        breaks = threading.Timer(1.0, lambda: hand.fault(fault))
        breaks.start()
        samples = recorded(rig, control, seconds=2)
        breaks.join()
    require_complete(samples, 2)


def test_a_session_that_hangs_while_it_records_is_ended_by_the_watchdog(
    simulator: Endpoints, control: ControlClient
) -> None:
    with opened(simulator.url) as rig:
        rig.arm()
        rig.drive(DRIVE)
        rig.record(1000)
        driven_on(rig, control)
        hung_s = time.monotonic()
        assert until(lambda: control.state()["output"] is False, within_s=2), "nobody beats"
        state = control.state()
        assert state["cause"] == "WATC"
        assert state["tripped_wall_s"] - hung_s < 1.5 * LIMITS.watchdog_s
        with pytest.raises(DeviceError, match=r"its watchdog tripped|samples .* were lost"):
            driven_on(rig, control)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_host_that_dies_or_stops_while_it_records_leaves_0_v(
    number: int, simulator: Endpoints, control: ControlClient
) -> None:
    command = [sys.executable, "-m", "tests.device.host", simulator.url, "1000"]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as host:
        try:
            assert host.stdout is not None
            assert host.stdout.readline() == "on\n"
            assert until(lambda: control.state()["voltage_v"] > 50, within_s=2)
            os.kill(host.pid, number)
            killed_s = time.monotonic()
            assert until(lambda: control.state()["voltage_v"] == 0, within_s=2)
            state = control.state()
            assert (state["output"], state["cause"]) == (False, "WATC")
            assert state["tripped_wall_s"] - killed_s <= LIMITS.watchdog_s
        finally:
            os.kill(host.pid, signal.SIGKILL)


@pytest.mark.parametrize("fault", ["", "block-truncated-once", "block-lost-once"])
def test_a_stop_by_hand_during_a_block_is_off_within_100_ms(
    fault: str, simulator: Endpoints, control: ControlClient
) -> None:
    with opened(simulator.url) as rig:
        rig.arm()
        rig.drive(DRIVE)
        rig.record(1000)
        driven_on(rig, control)
        if fault:
            control.fault(fault)
            rig.beat()
            time.sleep(0.08)  # the owner now waits for a block that does not come
        stopped_s = time.monotonic()
        rig.emergency_stop()
        assert until(lambda: not control.state()["output"], within_s=1)
        assert time.monotonic() - stopped_s < 0.1
        with pytest.raises(EmergencyStop, match="stopped by hand; output off, read back"):
            rig.recorded()
