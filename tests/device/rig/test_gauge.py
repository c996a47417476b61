"""A rig whose forces a gauge measures: its samples are the rig's, and so are its faults."""

from collections.abc import Callable, Iterator
from typing import Any, cast

import numpy as np
import pytest

from device.drivers.driver import Driver
from device.errors import DeviceError
from device.force_channel.recording import CHANNELS
from device.gauges.gauge import LineGauge
from device.gauges.owner import GaugeOwner
from device.link.link import Link
from device.rig import Rig, open_rig
from device.simulator.hardware.beam_and_finger import Finger
from protocol.address import AddressError
from tests.device.gauges.test_gauge import GaugePort
from tests.device.rig.bench import DRIVE, LIMITS, Bench, RecordedDriver, raising
from tests.device.rigs import until

BEAT_S = 0.02


class ClosedPort(GaugePort):
    """A gauge's port that says whether it was closed."""

    closed = False

    def close(self) -> None:
        self.closed = True


class GaugeBench(Bench):
    """A rig and its gauge, neither with a thread, on one clock."""

    def __init__(self) -> None:
        super().__init__(RecordedDriver())
        self.port = ClosedPort()
        self.clock = self.port.clock
        self.gauge = GaugeOwner(LineGauge(Link(self.port, monotonic=self.clock)))
        driver = cast(Driver, self.driver)
        self.rig = Rig(driver, LIMITS, None, self.clock, gauge=self.gauge)

    def live(self, seconds: float) -> None:
        """Let the session beat, and the owners of both ports work."""
        for _ in range(round(seconds / BEAT_S)):
            self.clock.advance(BEAT_S)
            self.gauge.step()
            self.rig.step()
            self.rig.beat()

    def measure(self, seconds: float) -> None:
        """Let only the owner of the gauge's port work."""
        for _ in range(round(seconds / BEAT_S)):
            self.clock.advance(BEAT_S)
            self.gauge.step()


@pytest.fixture
def gauged() -> GaugeBench:
    """An armed rig with a gauge."""
    bench = GaugeBench()
    bench.rig.arm()
    return bench


def test_what_is_recorded_is_what_the_gauge_measured(gauged: GaugeBench) -> None:
    gauged.port.device.beam.finger = Finger(force_n=0.7, position_m=0.03, direction="right")
    gauged.rig.record(1000)
    gauged.live(1)
    seen = gauged.rig.forces
    samples = gauged.rig.recorded()
    assert samples.source == "gauge"
    assert len(samples.counts) / 6 == pytest.approx(1000, abs=50)
    _, normal, place = np.frombuffer(samples.counts, "<i2").reshape(CHANNELS, -1)
    assert normal.mean() * samples.scale[1] == pytest.approx(0.7, abs=0.01)
    assert place.mean() * samples.scale[2] == pytest.approx(0.03, abs=0.001)
    assert seen is not None
    assert seen.normal_n == pytest.approx(0.7, abs=0.02)
    assert gauged.rig.forces is None


def test_a_rig_without_a_thread_lets_its_gauge_work_in_time(gauged: GaugeBench) -> None:
    gauged.rig.record(1000)
    for _ in range(50):
        gauged.clock.advance(BEAT_S)
        gauged.rig.step()
    assert gauged.gauge.latest is not None


def test_a_session_that_is_ahead_of_its_gauge_waits_for_it(gauged: GaugeBench) -> None:
    gauged.rig.record(1000)
    for _ in range(10):
        gauged.clock.advance(0.9)
        gauged.rig.beat()
    assert len(gauged.rig.recorded().counts) / 6 == pytest.approx(9000, rel=0.1)


def test_a_gauge_that_measures_in_another_unit_is_refused_at_arming() -> None:
    bench = GaugeBench()
    bench.port.of, bench.port.lie = "UNIT?", lambda _: "gf"
    with pytest.raises(DeviceError, match=r"gauge: .* in N, got 'gf'; output off, read back"):
        bench.rig.arm()
    assert bench.calls() == ["arm", "send_off", "confirm_off"]


def test_a_gauge_that_fails_turns_the_output_off_and_records_no_more(gauged: GaugeBench) -> None:
    gauged.rig.drive(DRIVE)
    gauged.rig.record(1000)
    gauged.live(0.2)
    gauged.calls()
    asked: list[str] = []

    def refused(answer: str) -> str:
        asked.append(answer)
        return "?"

    gauged.port.of, gauged.port.lie = "DATA?", refused
    gauged.measure(0.1)
    assert asked
    assert gauged.gauge.latest is None
    asked.clear()
    with pytest.raises(DeviceError, match=r"^gauge: .*; output off, read back"):
        gauged.live(1)
    assert gauged.calls()[-2:] == ["send_off", "confirm_off"]
    gauged.measure(1)
    assert gauged.gauge.latest is None
    assert asked == []


def test_nothing_is_recorded_after_a_fault_of_the_device(gauged: GaugeBench) -> None:
    gauged.rig.record(1000)
    gauged.live(0.2)
    gauged.driver.does["check"] = raising(DeviceError("too hot"))
    with pytest.raises(DeviceError, match="too hot"):
        gauged.live(1)
    assert gauged.gauge.latest is None
    asked: list[str] = []
    gauged.port.send = lambda data: asked.append(data.decode())  # type: ignore[method-assign]
    for call in (lambda: gauged.rig.record(1000), gauged.rig.recorded):
        with pytest.raises(DeviceError, match="too hot"):
            call()
    assert asked == []


def test_the_gauges_port_is_closed_with_the_rig(gauged: GaugeBench) -> None:
    gauged.rig.close()
    assert gauged.port.closed


def test_the_gauges_port_is_closed_if_the_rig_cannot_be_opened() -> None:
    bench = GaugeBench()
    with pytest.raises(AddressError, match="dialect"):
        open_rig("COM1", LIMITS, "no such dialect", gauge=bench.gauge)
    assert bench.port.closed


class FailingGauge:
    """A gauge that fails in a thread of its own."""

    def __init__(self) -> None:
        self.failed: DeviceError | None = None
        self.on_fault: Callable[[], object] = lambda: None

    def start(self, on_fault: Callable[[], object]) -> None:
        self.on_fault = on_fault

    def require_sound(self) -> None:
        if self.failed is not None:
            raise self.failed

    def meet(self) -> None: ...
    def abandon(self) -> None: ...
    def close(self) -> None: ...


@pytest.fixture
def threaded() -> Iterator[tuple[RecordedDriver, FailingGauge]]:
    """A rig with a thread; no time passes, so that the thread wakes only if it is told to."""
    bench, gauge = Bench(RecordedDriver()), FailingGauge()
    as_any: Any = gauge
    rig = Rig(cast(Driver, bench.driver), LIMITS, None, bench.clock, gauge=as_any)
    rig.start()
    yield bench.driver, gauge
    rig.close()


def test_a_gauge_that_fails_wakes_the_owner_of_the_rigs_port(
    threaded: tuple[RecordedDriver, FailingGauge],
) -> None:
    driver, gauge = threaded
    gauge.failed = DeviceError("gauge: gone")
    gauge.on_fault()
    assert until(lambda: "confirm_off" in driver.calls, within_s=5)
