"""Off, whatever happens: a host that dies or hangs, a stop by hand, a cable, a second program."""

import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import pytest

from device.drivers.driver import Reading
from device.drivers.limits import Limits
from device.errors import DeviceError, EmergencyStop, OutputUnknown
from device.link.link import open_link
from device.rig import FEEDS_PER_WATCHDOG, open_rig
from device.simulator.client import ControlClient, Endpoints, simulator_process
from device.simulator.in_process import InProcessDevice, in_process_rig
from tests.device.in_process_clock import InProcessClock
from tests.device.rigs import DRIVE, LIMITS, TOUCHBEAM, driven_on, opened, until

pytestmark = pytest.mark.waits

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def simulator() -> Iterator[Endpoints]:
    with simulator_process(TOUCHBEAM, seed=1, keep=True) as endpoints:
        yield endpoints


@pytest.fixture
def control(simulator: Endpoints) -> Iterator[ControlClient]:
    with ControlClient(simulator.control) as control:
        control.reset()
        yield control


@contextmanager
def driving_host(url: str, *more: str) -> Iterator["subprocess.Popen[str]"]:
    """A host in a process of its own, with the output on."""
    command = [sys.executable, "-m", "tests.device.host", url, *more]
    with subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as host:
        try:
            assert host.stdout is not None
            assert host.stdout.readline() == "on\n"
            yield host
        finally:
            os.kill(host.pid, signal.SIGKILL)


def ends_the_host(
    simulator: Endpoints, control: ControlClient, number: int, after_s: float
) -> None:
    """Kill or stop a driving host; its device is at 0 V within the watchdog's time."""
    control.reset()
    with driving_host(simulator.url) as host:
        assert until(lambda: control.state()["voltage_v"] > 50, within_s=2)
        ended_s = time.monotonic() + after_s
        until(lambda: time.monotonic() > ended_s and bool(control.state()), within_s=1)
        os.kill(host.pid, number)
        killed_s = time.monotonic()
        assert until(lambda: control.state()["voltage_v"] == 0, within_s=2)
        state = control.state()
        assert (state["output"], state["cause"]) == (False, "WATC")
        assert state["tripped_wall_s"] - killed_s <= LIMITS.watchdog_s


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_host_that_dies_or_stops_leaves_0_v_within_the_watchdogs_time(
    simulator: Endpoints, control: ControlClient, number: int
) -> None:
    ends_the_host(simulator, control, number, after_s=0.05)


@pytest.mark.soak
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_fifty_times_out_of_fifty(
    simulator: Endpoints, control: ControlClient, number: int
) -> None:
    moments = random.Random(f"host/{number}")
    for _ in range(50):
        ends_the_host(simulator, control, number, after_s=moments.uniform(0, 0.2))


def test_a_session_that_hangs_is_ended_by_the_watchdog(
    simulator: Endpoints, control: ControlClient
) -> None:
    with opened(simulator.url) as rig:
        rig.arm()
        rig.drive(DRIVE)
        assert until(lambda: control.state()["output"] is False, within_s=2), "nobody beats"
        assert control.state()["cause"] == "WATC"
        with pytest.raises(DeviceError, match=r"its watchdog tripped: .*; output off, read back"):
            driven_on(rig, control)
        rig.arm()
        assert rig.drive(DRIVE).output, "armed anew, it drives again"


def test_the_last_reading_follows_a_ramp_and_the_end_of_the_output(simulator: Endpoints) -> None:
    with opened(simulator.url) as rig:

        def last() -> Reading:
            assert rig.reading is not None
            rig.beat()
            return rig.reading

        rig.arm()
        rig.drive(replace(DRIVE, ramp_v_per_s=100))
        for least_v in (20, 50, 80):
            passed = partial(lambda volts: last().amplitude_v > volts, least_v)
            assert until(passed, within_s=2), "the poll that feeds the watchdog reads it"
            assert last().monitor_v == pytest.approx(last().amplitude_v, abs=4)
        finger = (rig.read_back().force_n, last().finger_s)
        rig.off()
        assert until(lambda: not last().output, within_s=1)
        assert (last().force_n, last().finger_s) == finger


def test_a_watchdog_is_tried_at_0_v_and_cleared(
    simulator: Endpoints, control: ControlClient
) -> None:
    with opened(simulator.url) as rig:
        rig.arm()
        assert rig.watchdog_trips() is True
        state = control.state()
        assert (state["output"], state["tripped"]) == (False, False)
        assert rig.drive(DRIVE).output, "it goes on as if nothing had been"


def test_a_watchdog_that_is_acknowledged_and_not_there_is_found(
    simulator: Endpoints, control: ControlClient
) -> None:
    control.fault("watchdog-dead")
    with opened(simulator.url) as rig:
        rig.arm()
        assert rig.watchdog_trips() is False
        assert control.state()["output"] is False


def test_nothing_but_0_v_is_on_while_a_watchdog_is_tried(
    simulator: Endpoints, control: ControlClient
) -> None:
    with opened(simulator.url) as rig:
        rig.arm()
        trial = threading.Thread(target=rig.watchdog_trips)
        trial.start()
        assert until(lambda: control.state()["output"], within_s=1)
        voltages = []
        while control.state()["output"]:
            voltages.append(control.state()["voltage_v"])
        trial.join()
        assert set(voltages) == {0.0}


def test_a_stop_by_hand_ends_the_trial_of_a_watchdog(
    simulator: Endpoints, control: ControlClient
) -> None:
    with opened(simulator.url, limits=replace(LIMITS, watchdog_s=5)) as rig:
        rig.arm()
        caught: list[BaseException] = []

        def try_it() -> None:
            try:
                rig.watchdog_trips()
            except DeviceError as error:
                caught.append(error)

        trial = threading.Thread(target=try_it)
        trial.start()
        assert until(lambda: control.state()["output"], within_s=1)
        stopped_s = time.monotonic()
        rig.emergency_stop()
        assert until(lambda: not control.state()["output"], within_s=1)
        assert time.monotonic() - stopped_s < 0.1
        trial.join()
        assert isinstance(caught[0], EmergencyStop)


def test_a_generator_has_no_watchdog_to_try() -> None:
    with (
        simulator_process(TOUCHBEAM, seed=1, dialect="keysight", wire="tcp") as other,
        opened(other.url, "keysight") as rig,
    ):
        rig.arm()
        with pytest.raises(DeviceError, match="a keysight device has no watchdog; output off"):
            rig.watchdog_trips()


def test_the_search_for_the_resonance_never_waits_longer_than_the_watchdog_is_fed(
    simulator: Endpoints, control: ControlClient
) -> None:
    waits: list[float] = []

    def sleep(seconds: float) -> None:
        waits.append(seconds)
        control.advance(seconds)

    limits = replace(LIMITS, watchdog_s=0.4)
    with opened(simulator.url, limits=limits) as rig:
        rig.arm()
        found = rig.resonance(24_221.0, sleep)
    assert found.frequency_hz == pytest.approx(24_221, rel=0.02)
    assert sum(waits) > 42 * 0.1
    assert max(waits) <= limits.watchdog_s / FEEDS_PER_WATCHDOG


def test_a_search_after_which_the_voltage_stays_does_not_end_with_off(
    simulator: Endpoints, control: ControlClient
) -> None:
    def sleep(seconds: float) -> None:
        control.fault("relay-stuck")
        control.advance(seconds)

    with opened(simulator.url) as rig:
        rig.arm()
        with pytest.raises(OutputUnknown, match=r"monitor still shows \d+\.\d V after 0.5 s"):
            rig.resonance(24_221.0, sleep)


def test_a_generator_is_turned_off_when_the_session_hangs() -> None:
    with (
        simulator_process(TOUCHBEAM, seed=1, dialect="keysight", wire="tcp") as other,
        ControlClient(other.control) as control,
        opened(other.url, "keysight") as rig,
    ):
        remarks = rig.arm().remarks
        assert "this generator has no watchdog" in remarks[0]
        rig.drive(DRIVE)
        assert until(lambda: control.state()["output"] is False, within_s=2), "nobody beats"
        with pytest.raises(DeviceError, match=r"session did not move for .*; output off, read"):
            driven_on(rig, control)


@pytest.mark.parametrize("dialect", ["board", "keysight"])
def test_a_host_that_was_stopped_turns_the_output_off_once_it_goes_on(dialect: str) -> None:
    """A board turns itself off meanwhile, and a generator is turned off by its guardian."""
    with (
        simulator_process(TOUCHBEAM, seed=1, dialect=dialect, keep=True) as other,
        ControlClient(other.control) as control,
        driving_host(other.url, "0", dialect) as host,
    ):
        assert until(lambda: control.state()["voltage_v"] > 50, within_s=2)
        os.kill(host.pid, signal.SIGSTOP)
        assert until(lambda: control.state()["output"] is False, within_s=3)
        os.kill(host.pid, signal.SIGCONT)
        assert host.stderr is not None
        *_, said = host.stderr.read().splitlines()
        assert control.state()["output"] is False
    assert said.endswith("output off, read back")
    turned_off = "its guardian turned the output off" in said
    assert turned_off is (dialect == "keysight")


def test_a_session_that_waits_for_a_slow_generator_does_not_hang() -> None:
    device = InProcessDevice(seed=1, dialect="rigol", delay_s=lambda: 0.01)
    rig = in_process_rig(device, LIMITS, "rigol")
    rig.arm()
    rig.drive(DRIVE)
    begin_s = device.now_s()
    assert all(rig.read_back().output for _ in range(3)), "no beat, but calls"
    assert device.now_s() - begin_s > 2 * LIMITS.watchdog_s
    InProcessClock(datetime(2026, 1, 5, tzinfo=UTC), device, rig).sleep(2 * LIMITS.watchdog_s)
    with pytest.raises(DeviceError, match=r"session did not move for .*; output off, read"):
        rig.beat()


def test_a_stop_by_hand_sends_off_within_100_ms_of_a_blocked_read(
    simulator: Endpoints, control: ControlClient
) -> None:
    with opened(simulator.url) as rig:
        rig.arm()
        rig.drive(DRIVE)
        control.fault("silent")
        caught: list[BaseException] = []

        def ask() -> None:
            try:
                rig.read_back()
            except DeviceError as error:
                caught.append(error)

        blocked = threading.Thread(target=ask)
        heard_s = control.state()["heard_wall_s"]
        blocked.start()
        until(lambda: control.state()["heard_wall_s"] > heard_s, within_s=1)
        assert control.state()["output"] is True
        stopped_s = time.monotonic()
        rig.emergency_stop()
        assert until(lambda: control.state()["output"] is False, within_s=1)
        assert time.monotonic() - stopped_s < 0.1
        blocked.join()
        assert isinstance(caught[0], OutputUnknown), "a silent device does not confirm"
        assert control.state()["cause"] == "NONE", "not the watchdog did it"


def test_a_stop_by_hand_latches(simulator: Endpoints, control: ControlClient) -> None:
    with opened(simulator.url) as rig:
        rig.arm()
        rig.drive(DRIVE)
        rig.emergency_stop()
        assert until(lambda: control.state()["output"] is False, within_s=1)
        with pytest.raises(EmergencyStop, match="stopped by hand; output off, read back"):
            rig.drive(DRIVE)
        assert rig.idle_s() is None, "its thread waits for a call, and does not spin"
        rig.off()
        rig.arm()
        assert rig.drive(DRIVE).output


def test_a_stop_by_hand_says_nothing_of_the_output_of_another_device(
    simulator: Endpoints, control: ControlClient
) -> None:
    control.fault("wrong-idn")
    with opened(simulator.url) as rig:
        with pytest.raises(OutputUnknown, match="got 'ACME,Toaster 3000"):
            rig.arm()
        rig.emergency_stop()
        with pytest.raises(OutputUnknown, match=r"cut the amplifier \((expected|stopped by hand)"):
            rig.drive(DRIVE)
        with pytest.raises(OutputUnknown, match=r"cut the amplifier \(expected"):
            rig.off()


def test_an_output_that_is_unknown_is_said_to_be_so_once(
    simulator: Endpoints, control: ControlClient
) -> None:
    control.fault("stage-shorted")
    with opened(simulator.url) as rig, pytest.raises(OutputUnknown, match=r"(149|150)\.") as caught:
        rig.arm()
    assert str(caught.value).count("UNKNOWN") == 1


def test_after_the_port_came_back_the_output_stays_off(
    simulator: Endpoints, control: ControlClient
) -> None:
    with opened(simulator.url) as rig:
        rig.arm()
        rig.drive(DRIVE)
        control.fault("vanish")
        with pytest.raises(OutputUnknown, match="cut the amplifier"):
            driven_on(rig, control)
    assert until(lambda: control.state()["output"] is False, within_s=2)
    control.fault("vanish", on=False)
    assert until(Path(simulator.url).exists, within_s=2)
    with opened(simulator.url) as rig:
        identity = rig.arm()
        assert control.state()["output"] is False
        assert identity.idn.startswith("touchbeam,BOARD")
        assert rig.drive(DRIVE).output


def test_two_tasks_ask_one_after_the_other(simulator: Endpoints, control: ControlClient) -> None:
    with opened(simulator.url) as rig:
        rig.arm()
        read: list[tuple[float, float]] = []

        def ask() -> None:
            for _ in range(50):
                back = rig.read_back()
                read.append((back.voltage_v, back.frequency_hz))

        tasks = [threading.Thread(target=ask) for _ in range(2)]
        for task in tasks:
            task.start()
        for task in tasks:
            task.join()
        assert read == [(0.0, 1000.0)] * 100


def test_a_second_program_is_refused_and_the_first_goes_on(
    simulator: Endpoints, control: ControlClient
) -> None:
    with opened(simulator.url) as rig:
        rig.arm()
        rig.drive(DRIVE)
        with pytest.raises(DeviceError, match="in use by another program; close it first"):
            open_rig(simulator.url, LIMITS)
        assert driven_on(rig, control, 0.2).output


def test_a_second_program_on_a_network_port_hears_nothing() -> None:
    with simulator_process(TOUCHBEAM, seed=1, wire="tcp") as tcp, opened(tcp.url) as rig:
        rig.arm()
        with opened(tcp.url) as second, pytest.raises(DeviceError, match=r"gone|not take|UNKNOWN"):
            second.arm()
        assert rig.read_back().output is False


def test_a_device_that_stops_reading_does_not_block_the_writer(
    simulator: Endpoints, control: ControlClient
) -> None:
    control.fault("deaf")
    link = open_link(simulator.url)

    def fill() -> None:
        for _ in range(10_000):
            link.tell("VOLT 0")

    with pytest.raises(DeviceError, match=r"cannot send 'VOLT 0' to the device: Write timeout"):
        fill()
    link.close()


@pytest.mark.parametrize("peak_to_peak_v", [240.0, 121.0])
def test_a_peak_to_peak_value_is_refused_by_host_and_device(
    simulator: Endpoints, control: ControlClient, peak_to_peak_v: float
) -> None:
    limits = Limits(max_voltage_v=500, max_frequency_hz=40_000, ramp_v_per_s=400, watchdog_s=0.5)
    with opened(simulator.url) as rig:
        rig.arm()
        with pytest.raises(ValueError, match=rf"\[0, 120\], got {peak_to_peak_v:g}"):
            rig.drive(type(DRIVE)(**{**DRIVE.__dict__, "voltage_v": peak_to_peak_v}))
        assert rig.drive(DRIVE).output, "what was refused by the host was not sent"
    with (
        opened(simulator.url, limits=limits) as rig,
        pytest.raises(DeviceError, match=r"VOLT:LIM was refused by the device: -222"),
    ):
        rig.arm()
    assert control.state()["output"] is False
