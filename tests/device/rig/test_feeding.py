"""When the rig feeds the device, and when it turns it off because the session is silent."""

import inspect
import sys
import time
from contextlib import suppress
from typing import cast
from unittest.mock import Mock

import pytest

from device.drivers.driver import Driver, Reading
from device.errors import (
    DeviceError,
)
from device.guardian_process import passed_s
from device.rig import FEEDS_PER_WATCHDOG, RAMP_STEP_S, Rig
from protocol.journal.records import ReadBack
from tests.device.rig.bench import DRIVE, FEED_S, IDENTITY, LIMITS, SHOWN, Bench, RecordedDriver


def test_a_new_rig_waits_for_calls_alone() -> None:
    bench = Bench(RecordedDriver())
    assert bench.rig.idle_s() is None
    assert bench.after(10) == []


def test_an_armed_rig_says_who_answered_and_is_fed_five_times_in_its_watchdogs_time(
    bench: Bench,
) -> None:
    assert FEEDS_PER_WATCHDOG == 5
    assert bench.rig.arm() is IDENTITY
    bench.calls()
    assert bench.rig.idle_s() == pytest.approx(FEED_S)
    assert bench.after(0.75 * FEED_S) == []
    assert bench.rig.idle_s() == pytest.approx(0.25 * FEED_S)
    bench.clock.advance(FEED_S)
    assert bench.rig.idle_s() == 0
    assert bench.after(0.0) == ["check"]
    assert bench.after(0.75 * FEED_S) == []
    assert bench.after(0.3 * FEED_S) == ["check"]


def test_the_last_answers_can_be_seen_without_asking(bench: Bench) -> None:
    answers = Reading(at_s=1.0, output=True, amplitude_v=20.0, frequency_hz=24_000.0)
    bench.driver.reading = answers
    assert bench.rig.reading is answers
    assert bench.calls() == []


def test_a_feed_is_due_at_its_moment_and_not_only_after_it() -> None:
    bench = Bench(RecordedDriver())
    bench.clock.advance(-100)  # 0.2 s is 0.2 s here, without rounding
    bench.rig = Rig(cast(Driver, bench.driver), LIMITS, None, bench.clock)
    bench.rig.arm()
    bench.calls()
    assert bench.after(FEED_S) == ["check"]


def test_each_is_limited_by_its_own_watchdog() -> None:
    assert Bench(RecordedDriver(has_watchdog=True)).rig.has_watchdog is True
    assert Bench(RecordedDriver(has_watchdog=False)).rig.has_watchdog is False


def test_what_is_driven_is_fed_only_while_the_session_moves(driven: Bench) -> None:
    assert driven.after(FEED_S) == ["check"]
    assert driven.after(FEED_S, beats=False) == []
    assert driven.after(FEED_S, beats=False) == []
    assert driven.after(FEED_S) == ["check"]


def test_what_is_off_is_looked_at_although_the_session_stands(bench: Bench) -> None:
    assert bench.after(FEED_S, beats=False) == ["check"]
    assert bench.after(FEED_S, beats=False) == ["check"]


def test_a_device_without_a_watchdog_is_turned_off_once_the_session_is_silent(
    unwatched: Bench,
) -> None:
    for _ in range(4):
        assert unwatched.after(FEED_S, beats=False) == []
    assert unwatched.after(0.3 * FEED_S, beats=False) == []
    assert unwatched.after(FEED_S, beats=False) == ["send_off", "confirm_off"]
    message = (
        r"^the session did not move for 0\.5 s while the output was on; output off, read back$"
    )
    with pytest.raises(DeviceError, match=message):
        unwatched.rig.beat()


def test_a_session_that_is_silent_for_its_watchdogs_time_and_no_longer_goes_on() -> None:
    bench = Bench(RecordedDriver(has_watchdog=False))
    bench.clock.advance(-100)
    bench.rig = Rig(cast(Driver, bench.driver), LIMITS, None, bench.clock)
    bench.rig.arm()
    bench.rig.drive(DRIVE)
    bench.calls()
    assert bench.after(0.5) == ["check"]
    assert bench.after(LIMITS.watchdog_s, beats=False) == []


def test_a_drive_moves_the_session(unwatched: Bench) -> None:
    unwatched.clock.advance(0.9 * LIMITS.watchdog_s)
    unwatched.rig.drive(DRIVE)
    unwatched.calls()
    assert unwatched.after(0.9 * LIMITS.watchdog_s, beats=False) == []


def test_a_session_that_waits_for_a_long_answer_is_not_silent(unwatched: Bench) -> None:
    def wait_for_an_answer() -> ReadBack:
        for _ in range(20):
            unwatched.clock.advance(0.1 * LIMITS.watchdog_s)
            unwatched.driver.link.alive()
        return SHOWN

    unwatched.driver.does["read_back"] = wait_for_an_answer
    unwatched.rig.read_back()
    assert unwatched.calls() == ["read_back"]
    unwatched.rig.beat()


@pytest.mark.parametrize("slept_in", ["the session", "a call"])
def test_a_computer_that_slept_while_a_generator_was_on_turns_it_off_on_waking(
    unwatched: Bench, slept_in: str
) -> None:
    """The session moves again before the owner of the port looks whether it does."""
    message = r"for 60\.0 s .*; output off, read back$"
    if slept_in == "a call":
        unwatched.driver.does["read_back"] = lambda: unwatched.clock.advance(60)
        with pytest.raises(DeviceError, match=message):
            unwatched.rig.read_back()
    else:
        unwatched.clock.advance(60)
        with pytest.raises(DeviceError, match=message):
            unwatched.rig.beat()
    assert unwatched.calls()[-2:] == ["send_off", "confirm_off"]
    with pytest.raises(DeviceError, match=message):
        unwatched.rig.drive(DRIVE)


@pytest.mark.parametrize("watched", ["a board", "a generator"])
@pytest.mark.parametrize("renewed_by", ["beat", "read_back", "drive", "step", "off"])
def test_nothing_renews_a_sign_of_life_without_looking_at_the_silence_before_it(
    watched: str, renewed_by: str
) -> None:
    """All of the program stood still; what it did first then was this."""
    bench = Bench(RecordedDriver(has_watchdog=watched == "a board"))
    bench.rig.arm()
    bench.rig.drive(DRIVE)
    bench.after(FEED_S)
    bench.clock.advance(3.4)
    with suppress(DeviceError):
        getattr(bench.rig, renewed_by)(*[DRIVE] * (renewed_by == "drive"))
    bench.rig.step()
    assert bench.driver.driven is None
    with pytest.raises(DeviceError, match=r"stood still for 3\.4 s .*; output off, read back$"):
        bench.rig.beat()


@pytest.mark.parametrize("renewed_by", ["beat", "read_back", "drive", "off"])
def test_a_session_that_stood_still_alone_is_seen_whatever_it_does_next(
    unwatched: Bench, renewed_by: str
) -> None:
    """The owner lived on, but did not get to look at the session between."""
    for _ in range(4):
        unwatched.clock.advance(0.2)
        unwatched.rig._pulse.beat()
    with suppress(DeviceError):
        getattr(unwatched.rig, renewed_by)(*[DRIVE] * (renewed_by == "drive"))
    with pytest.raises(DeviceError, match=r"^the session did not move for 0\.8 s .*; output off"):
        unwatched.after(0.0)


def test_off_is_sent_and_read_back_whatever_stood_still_before(unwatched: Bench) -> None:
    unwatched.clock.advance(60)
    unwatched.rig.off()
    assert unwatched.calls() == ["off"]


def test_a_rig_that_is_armed_anew_forgets_what_stood_still(unwatched: Bench) -> None:
    unwatched.clock.advance(60)
    unwatched.rig.off()
    unwatched.rig.arm()
    unwatched.rig.beat()
    unwatched.rig.drive(DRIVE)


def test_a_computer_may_sleep_while_the_output_is_off(unwatched: Bench) -> None:
    unwatched.rig.off()
    unwatched.clock.advance(60)
    unwatched.rig.beat()
    unwatched.rig.drive(DRIVE)


@pytest.mark.skipif(sys.platform != "linux", reason="other clocks count it anyway, or never do")
def test_a_rig_lives_by_a_clock_that_counts_the_time_asleep(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("time.clock_gettime", {time.CLOCK_BOOTTIME: 7.0}.get)
    assert passed_s() == 7.0
    default = inspect.signature(Rig).parameters["monotonic"].default
    assert default is passed_s


def test_a_device_with_a_watchdog_is_left_to_it(driven: Bench) -> None:
    for _ in range(20):
        assert driven.after(FEED_S, beats=False) == []
    driven.rig.beat()


def test_a_ramp_is_carried_on_until_it_is_done(bench: Bench) -> None:
    steps = iter([True, True, False])
    bench.driver.does["carry_on"] = lambda: next(steps)
    assert bench.rig.drive(DRIVE) is SHOWN
    assert bench.driver.asked == [DRIVE]
    assert bench.rig.idle_s() == RAMP_STEP_S == 0.02
    assert bench.calls() == ["drive", "carry_on"]
    assert bench.after(0.0) == ["carry_on"]
    assert bench.after(0.0) == ["carry_on"]
    assert bench.after(0.0) == []
    assert bench.rig.idle_s() == pytest.approx(FEED_S)


@pytest.mark.parametrize("call", ["drive", "watchdog_trips"])
def test_a_call_that_switches_on_is_a_beat(bench: Bench, call: str) -> None:
    beats = bench.rig._beats
    _ = bench.rig.drive(DRIVE) if call == "drive" else bench.rig.watchdog_trips()
    assert bench.rig._beats == beats + 1


@pytest.mark.parametrize("then", ["beat", "drive", "off", "emergency_stop"])
def test_a_guardian_that_was_killed_is_a_fault_and_the_output_goes_off(then: str) -> None:
    bench = Bench(RecordedDriver(has_watchdog=False))
    guardian = Mock(has_tripped=Mock(return_value=False))
    bench.rig = Rig(cast(Driver, bench.driver), LIMITS, None, bench.clock, guardian=guardian)
    bench.rig.arm()
    bench.rig.drive(DRIVE)
    bench.calls()
    guardian.has_tripped = Mock(side_effect=DeviceError("the guardian has ended"))
    with suppress(DeviceError):
        getattr(bench.rig, then)(*[DRIVE] * (then == "drive"))
    bench.rig.step()
    assert bench.driver.driven is None
    assert "drive" not in bench.calls()
    why = "stopped by hand" if then == "emergency_stop" else "the guardian has ended"
    with pytest.raises(DeviceError, match=f"^{why}; output off, read back$"):
        bench.rig.beat()


def test_why_an_output_is_off_is_told_where_its_being_off_is_found_first() -> None:
    bench = Bench(RecordedDriver(has_watchdog=False))
    bench.rig.arm()
    bench.rig.drive(DRIVE)

    def found_off() -> None:
        bench.clock.advance(3.2)
        bench.driver.link.alive()
        raise DeviceError("the output is off, and nobody here switched it")

    bench.driver.does["read_back"] = found_off
    with pytest.raises(DeviceError, match=r"^the program stood still for 3\.2 s .*, read back$"):
        bench.rig.read_back()
