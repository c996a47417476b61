"""Every fault that a device can have, over the real byte path; see `fault_table`."""

from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from device.errors import DeviceError, OutputUnknown
from device.rig import Rig
from device.simulator.client import ControlClient, Endpoints, simulator_process
from device.simulator.faults import NAMES
from tests.device.fault_table import FAULTS, Row
from tests.device.rigs import DRIVE, TOUCHBEAM, driven_on, opened, until

pytestmark = pytest.mark.waits


@pytest.fixture(scope="module")
def simulators() -> Iterator[dict[str, Endpoints]]:
    with ExitStack() as stack:

        def simulator(dialect: str, wire: str) -> Endpoints:
            started = simulator_process(TOUCHBEAM, 1, dialect=dialect, wire=wire, keep=True)
            return stack.enter_context(started)

        yield {
            "board": simulator("board", "pty"),
            "keysight": simulator("keysight", "tcp"),
            "rigol": simulator("rigol", "tcp"),
            "siglent": simulator("siglent", "pty"),
        }


@pytest.fixture
def simulator(simulators: dict[str, Endpoints], row: Row) -> Endpoints:
    return simulators[row.dialect]


@pytest.fixture
def control(simulator: Endpoints) -> Iterator[ControlClient]:
    with ControlClient(simulator.control) as control:
        control.reset()
        yield control
        control.reset()


def test_the_table_has_every_fault_that_a_device_can_have() -> None:
    """Those of a gauge are in `test_gauge`."""
    of_device = {name for name in NAMES if not name.startswith("gauge-")}
    assert {row.fault for row in FAULTS} == of_device


@pytest.mark.parametrize("row", FAULTS, ids=lambda row: row.name)
def test_a_fault_is_told_and_leaves_the_output_off(
    row: Row, simulator: Endpoints, control: ControlClient
) -> None:
    with opened(simulator.url, row.dialect) as rig:
        if row.error is None:
            _provoked(rig, control, row)
            assert control.state()["output"] is True
            rig.off()
        else:
            with pytest.raises(row.error, match=row.told):
                _provoked(rig, control, row)
            _is_safe(rig, control, row)
        assert _gives_voltage(control) is row.still_on


def _provoked(rig: Rig, control: ControlClient, row: Row) -> None:
    """Bring the device to the moment, let it fail, and go on as a session would."""
    if row.when == "handshake":
        control.fault(row.fault)
        rig.arm()
        rig.drive(DRIVE)
        return
    rig.arm()
    rig.drive(DRIVE)
    if row.when == "between":
        rig.off()
    if row.when == "recording":
        rig.record(1000)
    if row.when == "off":
        assert until(lambda: _alive(rig) and control.state()["voltage_v"] > 10, within_s=1)
    control.fault(row.fault)
    if row.when == "off":
        rig.off()
        return
    read_back = driven_on(rig, control)
    if row.when == "recording":
        assert rig.recorded().counts
    assert read_back.output
    assert read_back.frequency_hz == DRIVE.frequency_hz


def _alive(rig: Rig) -> bool:
    """Keep the watchdog quiet, which would turn off what must be found on."""
    rig.beat()
    return True


def _gives_voltage(control: ControlClient) -> bool:
    state = control.state()
    return bool(state["output"] or state["voltage_v"] > 0)


def _is_safe(rig: Rig, control: ControlClient, row: Row) -> None:
    """Nothing is driven again, and the device is at 0 V by its watchdog at the latest."""
    if row.when != "off":
        with pytest.raises(DeviceError, match=row.told):
            rig.drive(DRIVE)
        with pytest.raises(DeviceError, match=row.told):
            rig.beat()
    if row.error is not None and not issubclass(row.error, OutputUnknown):
        rig.off()
    if not row.still_on:
        assert until(lambda: control.state()["voltage_v"] == 0, within_s=1.0)
