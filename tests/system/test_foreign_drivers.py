"""Drivers that others wrote for these generators drive the simulated ones unchanged (PyMeasure)."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from device.simulator.client import ControlClient, simulator_process
from device.simulator.models.generator_model import AMPLIFIER_GAIN
from tests.device.rigs import TOUCHBEAM

pytestmark = [
    pytest.mark.waits,
    # Not ours: what PyMeasure, Pint and PyVISA warn about when they are imported and closed.
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::FutureWarning"),
]

WIRES = ("pty", "tcp")


@contextmanager
def opened(model: str, dialect: str, wire: str) -> Iterator[tuple[Any, ControlClient]]:
    """Their driver of `model` on a simulated `dialect`, through VISA in pure Python."""
    from pymeasure.instruments import agilent, rigol

    with (
        simulator_process(TOUCHBEAM, seed=1, dialect=dialect, wire=wire) as endpoints,
        ControlClient(endpoints.control) as control,
    ):
        driver = getattr(rigol if dialect == "rigol" else agilent, model)(
            _resource(endpoints.url),
            visa_library="@py",
            read_termination="\n",
            write_termination="\n",
            timeout=5_000,
        )
        try:
            yield driver, control
        finally:
            driver.adapter.close()
            driver.adapter.manager.close()


def _resource(url: str) -> str:
    """The name that VISA has for a pySerial URL."""
    if url.startswith("socket://"):
        host, port = url.removeprefix("socket://").split(":")
        return f"TCPIP::{host}::{port}::SOCKET"
    return f"ASRL{url}::INSTR"


@pytest.mark.parametrize("wire", WIRES)
def test_their_33220a_drives_ours(wire: str) -> None:
    with opened("Agilent33220A", "keysight-33220A", wire) as (generator, control):
        assert ",33220A," in generator.id
        generator.shape = "SINUSOID"
        generator.amplitude_unit = "VPP"
        generator.frequency = 24221.37
        generator.amplitude = 2.5
        generator.offset = 0
        generator.output = True
        assert generator.shape == "SIN"
        assert generator.frequency == pytest.approx(24221.37)
        assert (generator.amplitude, generator.offset) == (pytest.approx(2.5), 0)
        assert generator.output is True
        state = control.state()
        assert state["frequency_hz"] == pytest.approx(24221.37)
        twice_v = 2 * AMPLIFIER_GAIN * 2.5 / 2  # it believes in 50 Ω, the amplifier's input is open
        assert state["voltage_v"] == pytest.approx(twice_v)
        generator.output = False
        assert control.state()["output"] is False
        assert generator.check_errors() == []


@pytest.mark.parametrize("wire", WIRES)
def test_their_33500_drives_ours(wire: str) -> None:
    with opened("Agilent33500", "keysight", wire) as (generator, control):
        generator.output_load = "INF"
        assert float(generator.output_load) == pytest.approx(9.9e37)
        generator.ch_1.amplitude_unit = "VRMS"
        generator.ch_1.amplitude = 1.0
        assert generator.ch_1.amplitude == pytest.approx(1.0)
        generator.ch_1.amplitude_unit = "VPP"
        assert generator.amplitude == pytest.approx(2 * math.sqrt(2))
        generator.ch_1.voltage_high = 2.0
        generator.ch_1.voltage_low = -2.0
        generator.ch_1.output = "on"
        assert generator.output is True
        assert control.state()["voltage_v"] == pytest.approx(AMPLIFIER_GAIN * 2)
        generator.ch_2.frequency = 5_000
        assert generator.ch_2.frequency == 5_000
        assert generator.ch_1.frequency == 1_000, "the channels are apart"
        assert generator.check_errors() == []


@pytest.mark.parametrize("wire", WIRES)
def test_their_dg800_drives_ours(wire: str) -> None:
    with opened("DG800", "rigol", wire) as (generator, control):
        assert ",DG832," in generator.id
        first, second = generator.channel_1, generator.channel_2
        first.high_impedance = True
        assert first.load == pytest.approx(9.9e37)
        first.sine = (24221.37, 2.5, 0, 90)
        assert first.frequency == pytest.approx(24221.37)
        assert first.waveform[0] == '"SIN'
        assert first.waveform[1:4] == pytest.approx([24221.37, 2.5, 0])
        first.output_enabled = True
        assert first.output_enabled is True
        state = control.state()
        assert state["frequency_hz"] == pytest.approx(24221.37)
        assert state["voltage_v"] == pytest.approx(AMPLIFIER_GAIN * 2.5 / 2)
        second.load = 75
        assert (second.load, second.output_enabled) == (75, False)
        second.square = (1000, 1, 0, 0)
        second.duty_cycle, second.pulse_width = 25, 1e-4
        assert (second.duty_cycle, second.pulse_width) == (25, pytest.approx(1e-4))
        second.sync_enabled = False
        assert (second.sync_enabled, first.sync_enabled) == (False, True)
        for channel in (first, second):
            channel.triangle = channel.pulse = (1000, 1, 0, 0)
            channel.noise, channel.dc = (1, 0), 1
        first.shape = "SIN"
        assert first.shape == "SIN"
        first.output_enabled = False
        assert first.output_enabled is False
        assert control.state()["output"] is False
        assert generator.check_errors() == []


@pytest.mark.parametrize(
    ("model", "dialect"), [("Agilent33220A", "keysight-33220A"), ("Agilent33500", "keysight")]
)
def test_every_property_of_theirs_is_answered(model: str, dialect: str) -> None:
    """Get each one, and set it to what was got, without an error in the queue."""
    with opened(model, dialect, "tcp") as (generator, _):
        names = [
            name
            for name in dir(type(generator))
            if isinstance(getattr(type(generator), name), property)
            and getattr(type(generator), name).fset is not None
        ]
        generator.clear()
        got = {name: _got(generator, name) for name in names}
        assert {"shape", "frequency", "amplitude", "output", "burst_ncycles"} <= set(got)
        assert generator.check_errors() == []


def _got(generator: Any, name: str) -> object:
    try:
        return getattr(generator, name)
    except LookupError:  # a property that can only be set
        return None


@pytest.mark.parametrize("wire", WIRES)
def test_a_burst_of_theirs_ends_by_itself(wire: str) -> None:
    with opened("Agilent33220A", "keysight-33220A", wire) as (generator, control):
        generator.burst_mode = "TRIGGERED"
        generator.burst_ncycles = 1000
        generator.trigger_source = "BUS"
        generator.burst_state = True
        generator.frequency = 1_000
        generator.output = True
        assert generator.output is True
        assert control.state()["voltage_v"] == 0, "it waits for its trigger"
        generator.trigger()
        generator.wait_for_trigger()
        assert control.state()["voltage_v"] > 0
        control.advance(1.5)
        assert control.state()["voltage_v"] == 0
        assert generator.check_errors() == []
