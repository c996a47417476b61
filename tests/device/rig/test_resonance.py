"""How the rig finds the resonance."""

from dataclasses import replace

import pytest

from device.errors import (
    DeviceError,
)
from tests.device.rig.bench import CALIBRATION, FEED_S, SHOWN, Bench, RecordedDriver, raising


def test_the_kept_resonance_is_used_only_where_none_can_be_measured() -> None:
    unable = RecordedDriver(measures_vibration=False)
    bench = Bench(unable, CALIBRATION)
    bench.rig.arm()
    bench.calls()
    assert bench.rig.resonance(24_000, lambda _: None) is CALIBRATION
    assert bench.calls() == []
    for driver, kept in ((RecordedDriver(), CALIBRATION), (RecordedDriver(), None), (unable, None)):
        bench = Bench(driver, kept)
        driver.does["vibration_m"] = raising(DeviceError("measures none"))
        bench.rig.arm()
        bench.calls()
        with pytest.raises(DeviceError, match=r"^measures none; output off"):
            bench.rig.resonance(24_000, lambda _: None)
        assert "drive" not in bench.calls(), "it refuses before anything is driven"


def test_the_resonance_is_searched_for_in_waits_of_at_most_a_feed(bench: Bench) -> None:
    waits: list[float] = []
    fed: list[int] = []

    def sleep(seconds: float) -> None:
        waits.append(seconds)
        fed.append(bench.rig._beats)
        bench.clock.advance(seconds)

    def vibration_m() -> float:
        if not bench.driver.asked:
            return 1e-7
        ratio = bench.driver.asked[-1].frequency_hz / 24_100
        return float(1e-7 / ((1 - ratio**2) ** 2 + (0.01 * ratio) ** 2) ** 0.5)

    bench.driver.does["vibration_m"] = vibration_m
    found = bench.rig.resonance(24_000, sleep)
    assert found.frequency_hz == pytest.approx(24_100, abs=20)
    assert max(waits) <= FEED_S + 1e-9
    assert sum(waits) == pytest.approx(42 * 0.1)
    assert len(set(fed)) == len(waits), "each wait comes after a beat of its own"
    assert bench.calls()[-1] == "off"
    assert bench.driver.driven is None


def test_a_long_wait_of_the_search_is_cut_into_pieces_of_a_feed(bench: Bench) -> None:
    """80 V below what is asked, the wait for the ramp is longer than the watchdog."""
    waits: list[float] = []
    beats: set[int] = set()

    def sleep(seconds: float) -> None:
        waits.append(seconds)
        beats.add(bench.rig._beats)

    bench.driver.shown = replace(SHOWN, voltage_v=-70.0)
    with pytest.raises(DeviceError, match="no resonance"):
        bench.rig.resonance(24_000, sleep)
    assert waits == pytest.approx([FEED_S] * 21 * 5)
    assert len(beats) == len(waits), "each wait comes after a beat of its own"


def test_a_search_ends_with_the_reason_of_a_device_that_turned_itself_off(bench: Bench) -> None:
    """It moves nothing then: that the vibration is 0 is only what follows from it."""

    def tripped() -> None:
        raise DeviceError("protection tripped")

    def vibration_m() -> float:
        if len(bench.driver.asked) < 30:
            return 1e-7 if len(bench.driver.asked) == 10 else 1e-9
        bench.driver.does["read_back"] = tripped
        return 0.0

    bench.driver.does["vibration_m"] = vibration_m
    with pytest.raises(DeviceError, match=r"^protection tripped; output off"):
        bench.rig.resonance(24_000, lambda _: None)
    assert bench.calls()[-1] == "off"
