"""A gauge on a port of its own: its samples are those of a board's, and its faults turn off."""

import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

import pytest

from device.errors import DeviceError
from device.gauges.owner import open_gauge
from device.rig import Rig, open_rig
from device.simulator.client import ControlClient, Endpoints, simulator_process
from protocol.address import AddressError
from protocol.study.rig_settings import ForceChannel
from protocol.study.rig_settings import Rig as RigSettings
from protocol.study_file.loading import template
from runner.launch.device_access import session_rig
from runner.launch.locks import RigInUse, rig_lock
from runner.launch.request import SessionOptions
from runner.launch.run_session import run_session
from runner.study.folder import StudyFolder
from tests.device.rigs import DRIVE, LIMITS, TOUCHBEAM, driven_on, until
from tests.system.test_force_channel import noiseless, recorded, require_complete

pytestmark = pytest.mark.waits


@pytest.fixture(scope="module", params=[("board", "pty"), ("keysight", "tcp")], ids=str)
def simulator(request: pytest.FixtureRequest) -> Iterator[Endpoints]:
    dialect, wire = request.param
    with simulator_process(TOUCHBEAM, 1, dialect=dialect, wire=wire, keep=True) as endpoints:
        yield endpoints


@pytest.fixture
def dialect(request: pytest.FixtureRequest) -> str:
    found: str = request.node.callspec.params["simulator"][0]
    return found


@pytest.fixture
def control(simulator: Endpoints) -> Iterator[ControlClient]:
    with noiseless(simulator) as control:
        yield control
        control.reset()


@contextmanager
def rig_with_gauge(simulator: Endpoints, dialect: str) -> Iterator[Rig]:
    rig = open_rig(simulator.url, LIMITS, dialect, gauge=open_gauge(simulator.gauge, "gauge"))
    try:
        yield rig
    finally:
        with suppress(DeviceError):
            rig.close()


def test_seconds_at_1_khz_are_complete(
    simulator: Endpoints, dialect: str, control: ControlClient
) -> None:
    with rig_with_gauge(simulator, dialect) as rig:
        samples = recorded(rig, control, seconds=3)
    require_complete(samples, 3, tolerance_counts=3)
    assert samples.source == "gauge"
    assert samples.clock_error_s < 0.1
    assert samples.clock_offset_s + samples.first_s < time.monotonic()


def test_a_garbled_answer_is_asked_for_again(
    simulator: Endpoints, dialect: str, control: ControlClient
) -> None:
    with rig_with_gauge(simulator, dialect) as rig:
        control.fault("gauge-garbled-once")
        require_complete(recorded(rig, control, seconds=1), 1, tolerance_counts=3)


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        ("gauge-vanish", "gauge: the device is gone|gauge: cannot send"),
        ("gauge-silent", r"gauge: no answer to 'DATA\? \d+' in time"),
        ("samples-lost", "gauge: samples of the force channel were lost"),
    ],
)
def test_a_gauge_that_fails_turns_the_output_off(
    fault: str, says: str, simulator: Endpoints, dialect: str, control: ControlClient
) -> None:
    with rig_with_gauge(simulator, dialect) as rig:
        rig.arm()
        rig.drive(DRIVE)
        rig.record(1000)
        driven_on(rig, control)
        control.fault(fault)
        with pytest.raises(DeviceError, match=f"({says}).*; output off, read back"):
            driven_on(rig, control, seconds=2)
        assert control.state()["output"] is False
        control.fault(fault, on=False)


def test_a_gauge_with_another_unit_is_refused(
    simulator: Endpoints, dialect: str, control: ControlClient
) -> None:
    control.fault("gauge-wrong-unit")
    with rig_with_gauge(simulator, dialect) as rig:
        with pytest.raises(DeviceError, match="gauge: the gauge must measure in N, got 'gf'"):
            rig.arm()
        control.fault("gauge-wrong-unit", on=False)
        rig.arm()
        assert rig.drive(DRIVE).output


def test_a_unit_that_is_changed_between_two_touches_is_refused(
    simulator: Endpoints, dialect: str, control: ControlClient
) -> None:
    with rig_with_gauge(simulator, dialect) as rig:
        recorded(rig, control, seconds=0.2)
        control.fault("gauge-wrong-unit")
        rig.drive(DRIVE)
        with pytest.raises(DeviceError, match="in N, got 'gf'; output off, read back"):
            rig.record(1000)
        assert control.state()["output"] is False


def test_a_board_is_no_gauge(simulator: Endpoints, dialect: str, control: ControlClient) -> None:
    with rig_with_gauge(simulator, dialect) as rig:
        rig.arm()
        with pytest.raises(DeviceError, match="nothing is recorded"):
            rig.recorded()
    other = open_gauge(simulator.url, "gauge")
    with pytest.raises(DeviceError, match=r"gauge: expected a gauge \(TOUCHBEAM,GAUGE,…\), got"):
        other.meet()
    other.close()


def test_a_gauge_does_not_delay_a_stop(
    simulator: Endpoints, dialect: str, control: ControlClient
) -> None:
    with rig_with_gauge(simulator, dialect) as rig:
        rig.arm()
        rig.drive(DRIVE)
        rig.record(1000)
        driven_on(rig, control)
        control.fault("gauge-silent")
        time.sleep(0.05)
        stopped_s = time.monotonic()
        rig.emergency_stop()
        assert until(lambda: not control.state()["output"], within_s=1)
        assert time.monotonic() - stopped_s < 0.1


def study_with_gauge(tmp_path: Path, gauge: str) -> SessionOptions:
    channel = f'[force_channel]\nrate_hz = 500\ngauge = "{gauge}"\n\n[touch]\n'
    text = template("paper").replace("[touch]\n", channel, 1)
    (tmp_path / "study.toml").write_text(text)
    return SessionOptions(
        folder=StudyFolder(path=tmp_path),
        participant="P01",
        ratings="virtual",
        device="/dev/no-such-device",
    )


def test_two_sessions_cannot_share_a_gauge(tmp_path: Path) -> None:
    options = study_with_gauge(tmp_path, "/dev/some-gauge")
    with (
        rig_lock("/dev/some-gauge"),
        pytest.raises(RigInUse, match=r"^/dev/some-gauge is in use by"),
    ):
        run_session(options, lambda _: None)


@pytest.mark.parametrize(
    ("device", "gauge"),
    [
        ("socket://127.0.0.1:5999", "socket://localhost:5999"),
        ("/dev/no-such-device", "/dev/../dev/no-such-device"),
    ],
)
def test_another_spelling_of_the_devices_port_is_no_gauges(
    device: str, gauge: str, tmp_path: Path
) -> None:
    options = replace(study_with_gauge(tmp_path, gauge), device=device)
    with pytest.raises(AddressError, match=r"must have a port of its own, got \S+, the device's"):
        run_session(options, lambda _: None)


def test_a_simulated_gauge_is_not_for_a_real_device(tmp_path: Path) -> None:
    with pytest.raises(AddressError, match="'sim' is for a simulated device, got /dev/no-such"):
        run_session(study_with_gauge(tmp_path, "sim"), lambda _: None)


@pytest.mark.parametrize("dialect", ["board", "keysight"])
def test_the_gauge_of_a_simulated_device_is_simulated(dialect: str) -> None:
    rig = RigSettings(dialect=dialect, amplifier_gain=20 if dialect != "board" else None)
    channel = ForceChannel(rate_hz=500, gauge="/dev/some-gauge")
    with session_rig("sim", rig, 1, force_channel=channel) as found:
        found.device.arm()
        found.device.record(500)
        time.sleep(0.2)
        assert found.device.recorded().source == "gauge"


def test_a_dialect_that_nobody_speaks_is_refused() -> None:
    with pytest.raises(AddressError, match="dialect of a gauge must be one of gauge, got 'frob'"):
        open_gauge("/dev/null", "frob")
