"""Recording on a simulated board in the test's own thread, whose truth is known to the sample."""

from array import array
from collections.abc import Callable
from datetime import UTC, datetime

import pytest

from device.errors import CannotRecord, DeviceError
from device.force_channel.recording import Samples
from device.rig import RAMP_STEP_S, Rig
from device.simulator.in_process import InProcessDevice, in_process_rig
from device.simulator.models.board_model import BoardDialect
from tests.device.in_process_clock import InProcessClock
from tests.device.rigs import DRIVE, LIMITS

BEAT_S = 0.02


class Bench:
    """An armed rig on a board without noise, on which a finger slides at 5 mm/s."""

    def __init__(self, dialect: str = "board", seed: int = 3) -> None:
        self.device = InProcessDevice(seed, dialect)
        for noise in ("jitter", "tangential_noise_n", "normal_noise_n", "position_noise_m"):
            self.device.sensor(noise, 0.0)
        self.device.sensor("drift_n_per_min", 0.0)
        self.rig: Rig = in_process_rig(self.device, LIMITS, dialect)
        self.rig.arm()
        self.clock = InProcessClock(datetime(2026, 1, 1, tzinfo=UTC), self.device, self.rig)

    def live(self, seconds: float, look: Callable[[], None] = lambda: None) -> None:
        """Let the session live on."""
        for _ in range(round(seconds / BEAT_S)):
            self.rig.beat()
            self.clock.sleep(BEAT_S)
            look()

    def recorded(self, seconds: float = 1.0, rate_hz: int = 1000, fault: str = "") -> Samples:
        """Record a slide; a fault, if there is one, comes in the middle."""
        self.device.touch(0.5, 0.03, "right", 0.005)
        self.began_s = self.device.now_s()
        self.rig.record(rate_hz)
        self.live(seconds / 2)
        if fault:
            self.device.fault(fault)
        self.live(seconds / 2)
        samples = self.rig.recorded()
        self.took_s = self.device.now_s() - self.began_s
        return samples


def positions(samples: Samples) -> list[int]:
    counts = array("h", samples.counts)
    return list(counts[2 * len(counts) // 3 :])


def require_complete(bench: Bench, samples: Samples) -> None:
    """Each sample is there once, at its time: the finger's place says when it was taken."""
    found = positions(samples)
    assert len(found) == pytest.approx(bench.took_s * samples.rate_hz, abs=0.05 * samples.rate_hz)
    first_m = 0.03 + 0.005 * (samples.first_s - bench.began_s)
    for number, count in enumerate(found):
        place_m = first_m + 0.005 * number / samples.rate_hz
        assert count == pytest.approx(place_m / samples.scale[2], abs=0.6)


@pytest.mark.parametrize("rate_hz", [50, 137, 1000])
def test_every_sample_is_there_once(rate_hz: int) -> None:
    bench = Bench()
    samples = bench.recorded(seconds=3, rate_hz=rate_hz)
    require_complete(bench, samples)
    assert samples.source == "board"
    assert samples.saturated == 0
    assert abs(samples.clock_offset_s) <= samples.clock_error_s <= 1e-3


def test_a_second_recording_begins_anew() -> None:
    bench = Bench()
    bench.recorded(seconds=0.5)
    require_complete(bench, bench.recorded(seconds=1))


def test_a_recording_that_was_broken_off_is_forgotten() -> None:
    """Another session left the board sampling when it was killed, or a touch was repeated."""
    bench = Bench()
    bench.rig.record(1000)
    bench.live(0.2)
    samples = bench.recorded(rate_hz=200)
    assert samples.rate_hz == 200
    assert len(samples.counts) == pytest.approx(6 * 200, abs=6 * 20)


@pytest.mark.parametrize("fault", ["block-garbled-once", "block-truncated-once"])
def test_a_broken_block_is_asked_for_again_and_nothing_is_lost(fault: str) -> None:
    bench = Bench()
    require_complete(bench, bench.recorded(seconds=2, fault=fault))


def test_a_block_that_comes_twice_is_counted_once() -> None:
    bench = Bench()
    require_complete(bench, bench.recorded(seconds=2, fault="block-doubled-once"))


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        ("samples-lost", r"samples of the force channel were lost: sample \d+ is due, got \d+"),
        ("block-garbled", "must answer with a block, got"),
        ("block-lost-once", r"no answer to 'TRAC:DATA\? \d+' in time"),
        ("block-stale", r"sample \d+ of the force channel is due, got 0 again"),
    ],
)
def test_what_is_lost_doubled_or_broken_turns_the_output_off(fault: str, says: str) -> None:
    bench = Bench()
    bench.rig.drive(DRIVE)
    with pytest.raises(DeviceError, match=rf"{says}.*; output off, read back"):
        bench.recorded(fault=fault)
    assert not bench.device.inside.instrument.output
    with pytest.raises(DeviceError, match=says):
        bench.rig.beat()


def test_a_board_that_stops_sampling_is_noticed() -> None:
    bench = Bench()
    bench.rig.record(1000)
    bench.live(0.2)
    dialect = bench.device.inside.dialect
    assert isinstance(dialect, BoardDialect)
    dialect.sampler.on = False
    with pytest.raises(DeviceError, match=r"the force channel gave no samples for 0\.5 s"):
        bench.live(1)


def test_a_sensor_at_its_limit_is_counted() -> None:
    samples = Bench().recorded(seconds=1, fault="sensor-saturated")
    assert samples.saturated == pytest.approx(500, abs=60)


def test_the_newest_forces_can_be_seen_while_they_are_recorded() -> None:
    bench = Bench()
    seen = []
    bench.device.touch(0.5, 0.03, "right", 0.005)
    assert bench.rig.forces is None
    bench.rig.record(1000)
    bench.live(1, lambda: seen.append((bench.device.now_s(), bench.rig.forces)))
    bench.rig.recorded()
    assert bench.rig.forces is None
    late = [(now_s, forces) for now_s, forces in seen[10:] if forces is not None]
    assert len(late) == 40
    for now_s, forces in late:
        assert now_s - 0.12 < forces.at_s <= now_s + 1e-3
        assert forces.normal_n == pytest.approx(0.5, rel=0.06)
        assert forces.tangential_n / forces.normal_n == pytest.approx(0.4, rel=0.1)
        assert forces.position_m == pytest.approx(0.03, abs=0.006)


def test_a_board_of_before_refuses_in_one_line_and_goes_on() -> None:
    bench = Bench()
    bench.device.inside.dialect.idn = "touchbeam,BOARD,7,1.1"
    bench.rig.arm()
    with pytest.raises(CannotRecord, match=r"this board \(firmware 1\.1\) records no forces"):
        bench.rig.record(1000)
    assert bench.rig.drive(DRIVE).output


@pytest.mark.parametrize("dialect", ["keysight", "rigol", "siglent"])
def test_a_generator_refuses_in_one_line(dialect: str) -> None:
    with pytest.raises(CannotRecord, match=f"a {dialect} device records no forces: .* or a gauge"):
        Bench(dialect).rig.record(1000)


def test_to_begin_a_recording_and_to_end_it_is_a_beat() -> None:
    bench = Bench()
    bench.rig.record(1000)
    assert bench.rig._beats == 1
    bench.rig.recorded()
    assert bench.rig._beats == 2


def test_nothing_is_recorded_before_it_begins() -> None:
    with pytest.raises(DeviceError, match="nothing is recorded"):
        Bench().rig.recorded()


def test_a_session_that_hangs_while_it_records_trips_the_watchdog_in_time() -> None:
    """The owner of the port lives on: its questions for samples must not feed the watchdog."""
    bench = Bench()
    bench.rig.drive(DRIVE)
    bench.rig.record(1000)
    bench.live(1)
    instrument, hung_s = bench.device.inside.instrument, bench.device.now_s()
    while instrument.output and bench.device.now_s() < hung_s + 5:
        bench.clock.sleep(0.01)  # the owner works, nobody beats
    assert instrument.cause == "WATC"
    assert bench.device.now_s() - hung_s < LIMITS.watchdog_s + 2 * LIMITS.watchdog_s / 5


def test_a_beat_that_is_late_fetches_what_is_due_and_no_other_does() -> None:
    bench = Bench()
    bench.rig.record(1000)
    bench.device.advance(0.3)
    bench.rig.beat()
    assert bench.rig.forces is None
    bench.device.advance(0.1)
    bench.rig.beat()
    assert bench.rig.forces is not None


def test_the_owner_wakes_for_each_block_and_each_feed_and_asks_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bench = Bench()
    link, asked, woken = bench.rig._driver.link, [0], 0
    ask = link.block

    def counted(query: str, parsed: Callable[[bytes], object]) -> object:
        asked[0] += 1
        return ask(query, parsed)

    monkeypatch.setattr(link, "block", counted)
    bench.rig.record(1000)
    until_s = bench.device.now_s() + 1
    while bench.device.now_s() < until_s:
        bench.device.advance(bench.rig.idle_s() or 0.0)
        bench.rig.beat()
        bench.rig.step()
        woken += 1
    assert asked[0] == pytest.approx(20, abs=2), "blocks of 50 ms"
    assert woken == pytest.approx(20 + 10, abs=4), "the watchdog is fed every 0.1 s"


def test_the_owner_does_not_hurry_for_blocks_of_a_session_that_stands_still() -> None:
    bench = Bench()
    bench.rig.record(1000)
    bench.live(0.2)
    bench.device.advance(0.06)  # a block is due
    assert bench.rig.idle_s() == 0
    bench.rig.beat()
    bench.rig.step()
    bench.device.advance(0.06)
    assert bench.rig.idle_s() == pytest.approx(RAMP_STEP_S)


def test_nothing_is_recorded_after_a_fault() -> None:
    bench = Bench()
    bench.rig.record(1000)
    bench.live(0.2)
    bench.device.fault("over-temperature")
    with pytest.raises(DeviceError, match="output off, read back"):
        bench.live(1)
    assert bench.rig.forces is None


def test_a_session_that_beats_no_more_gets_at_most_four_blocks() -> None:
    bench = Bench()
    bench.rig.record(1000)
    bench.live(0.2)
    bench.device.advance(1.5)  # nobody works meanwhile
    before = bench.rig._recording.count  # type: ignore[union-attr]
    bench.rig.beat()
    for _ in range(20):
        bench.rig.step()
    assert bench.rig._recording.count == before + 200  # type: ignore[union-attr]
    bench.live(1)
    assert bench.rig.recorded().counts
