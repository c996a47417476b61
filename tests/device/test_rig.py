"""The rig's own work, step by step: its driver records its calls, and its clock stands still."""

import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any, cast

import pytest

from device.drivers.driver import Driver
from device.drivers.limits import Limits, Setpoint
from device.errors import (
    DeviceError,
    EmergencyStop,
    ForeignDevice,
    ForeignOutput,
    LimitExceeded,
    OutputUnknown,
)
from device.resonance import Resonance
from device.rig import FEEDS_PER_WATCHDOG, RAMP_STEP_S, Rig, open_rig
from protocol.journal.records import Identity, ReadBack
from tests.device.lying import SteppedClock

LIMITS = Limits(max_voltage_v=120, max_frequency_hz=40_000, ramp_v_per_s=400, watchdog_s=0.5)
DRIVE = Setpoint(voltage_v=100, frequency_hz=24_000, ramp_v_per_s=400)
FEED_S = LIMITS.watchdog_s / 5
SHOWN = ReadBack(output=True, voltage_v=100, frequency_hz=24_000)
IDENTITY = Identity(idn="recorded", boot=1, device_time_s=0.0)
CALIBRATION = Resonance(frequency_hz=24_100, tip_m_per_v=1e-8)


class RecordedLink:
    def __init__(self) -> None:
        self.stopped = False

    def stop(self) -> None:
        self.stopped = True

    def go_on(self) -> None:
        self.stopped = False


class RecordedDriver:
    """Records its calls; what `does` has for one of them is done instead."""

    def __init__(self, *, has_watchdog: bool = True, measures_vibration: bool = True) -> None:
        self.has_watchdog = has_watchdog
        self.measures_vibration = measures_vibration
        self.link = RecordedLink()
        self.driven: Setpoint | None = None
        self.foreign: ForeignOutput | None = None
        self.calls: list[str] = []
        self.does: dict[str, Callable[[], Any]] = {}
        self.asked: list[Setpoint] = []
        self.shown = SHOWN

    def _called(self, name: str, result: object = None) -> Any:
        self.calls.append(name)
        return self.does.get(name, lambda: result)()

    def arm(self) -> Identity:
        self.driven = None
        return cast(Identity, self._called("arm", IDENTITY))

    def drive(self, setpoint: Setpoint) -> ReadBack:
        self._called("drive")
        self.driven = setpoint
        self.asked.append(setpoint)
        return self.shown

    def read_back(self) -> ReadBack:
        return cast(ReadBack, self._called("read_back", SHOWN))

    def check(self) -> None:
        self._called("check")

    def carry_on(self) -> bool:
        return bool(self._called("carry_on", False))

    def vibration_m(self) -> float:
        return cast(float, self._called("vibration_m", 1e-7))

    def watchdog_trips(self) -> bool:
        return bool(self._called("watchdog_trips", True))

    def off(self) -> None:
        self.driven = None
        self._called("off")

    def send_off(self) -> None:
        self._called("send_off")

    def confirm_off(self) -> None:
        self._called("confirm_off")

    def close(self) -> None:
        self._called("close")


def raising(error: BaseException) -> Callable[[], Any]:
    def fail() -> None:
        raise error

    return fail


class Bench:
    """A rig without a thread, its driver and its clock."""

    def __init__(self, driver: RecordedDriver, calibration: Resonance | None = None) -> None:
        self.driver = driver
        self.clock = SteppedClock()
        self.clock.advance(100)
        self.rig = Rig(cast(Driver, driver), LIMITS, calibration, self.clock)

    def calls(self) -> list[str]:
        """What was called since this was asked last."""
        made, self.driver.calls = self.driver.calls, []
        return made

    def after(self, seconds: float, *, beats: bool = True) -> list[str]:
        """What the owner does after so long, with or without a beat of the session."""
        self.clock.advance(seconds)
        if beats:
            self.rig.beat()
        self.rig.step()
        return self.calls()


@pytest.fixture
def bench() -> Bench:
    """An armed rig with a watchdog, which was fed just now."""
    bench = Bench(RecordedDriver())
    bench.rig.arm()
    bench.after(FEED_S)
    return bench


@pytest.fixture
def driven(bench: Bench) -> Bench:
    """The same, driven, at the end of its ramp."""
    bench.rig.drive(DRIVE)
    bench.after(FEED_S)
    return bench


@pytest.fixture
def unwatched() -> Bench:
    """A driven generator without a watchdog, which was fed just now."""
    bench = Bench(RecordedDriver(has_watchdog=False))
    bench.rig.arm()
    bench.rig.drive(DRIVE)
    bench.after(FEED_S)
    return bench


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
    message = r"^the session did not move for 0\.5 s; output off, read back$"
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


@pytest.mark.parametrize("ends_by", ["off", "arm", "fault"])
def test_nothing_carries_a_ramp_on_after_its_end(bench: Bench, ends_by: str) -> None:
    bench.driver.does["carry_on"] = lambda: True
    bench.rig.drive(DRIVE)
    match ends_by:
        case "off":
            bench.rig.off()
        case "arm":
            bench.rig.arm()
        case _:
            bench.driver.does["read_back"] = raising(DeviceError("wrong"))
            with pytest.raises(DeviceError, match=r"^wrong; output off, read back$"):
                bench.rig.read_back()
    bench.calls()
    bench.rig.step()
    assert "carry_on" not in bench.calls()


def test_off_turns_off_whatever_was_stopped_or_failed_before(driven: Bench) -> None:
    driven.driver.does["read_back"] = raising(DeviceError("wrong"))
    with pytest.raises(DeviceError, match=r"^wrong"):
        driven.rig.read_back()
    driven.calls()
    driven.driver.link.stopped = True
    driven.rig.off()
    assert driven.calls() == ["off"]
    assert not driven.driver.link.stopped


@pytest.mark.parametrize("call", ["drive", "read_back", "check", "carry_on", "vibration_m"])
def test_a_fault_turns_off_once_and_latches(bench: Bench, call: str) -> None:
    bench.driver.does[call] = raising(DeviceError("wrong"))
    latched = r"^wrong; output off, read back$"

    def feed() -> None:
        bench.clock.advance(FEED_S)
        bench.rig.step()
        bench.rig.beat()

    calls: dict[str, Callable[[], object]] = {
        "drive": lambda: bench.rig.drive(DRIVE),
        "read_back": bench.rig.read_back,
        "check": feed,
        "carry_on": lambda: (bench.rig.drive(DRIVE), bench.rig.read_back()),
        "vibration_m": lambda: bench.rig.resonance(24_000, lambda _: None),
    }
    with pytest.raises(DeviceError, match=latched):
        calls[call]()
    made = bench.calls()
    assert made.count("send_off") == made.count("confirm_off") == 1
    assert bench.driver.driven is None
    bench.driver.does.clear()
    with pytest.raises(DeviceError, match=latched):
        bench.rig.beat()
    for again in (bench.rig.read_back, lambda: bench.rig.drive(DRIVE)):
        with pytest.raises(DeviceError, match=latched):
            again()
    assert bench.calls() == []
    assert bench.after(FEED_S, beats=False) == []
    assert bench.rig.idle_s() is None
    assert bench.rig.arm() is IDENTITY
    bench.rig.beat()
    assert bench.rig.read_back() is SHOWN


def test_arming_listens_again_after_a_stop(bench: Bench) -> None:
    bench.driver.link.stopped = True
    bench.rig.arm()
    assert not bench.driver.link.stopped


def test_a_rig_that_cannot_be_armed_is_not_armed(bench: Bench) -> None:
    bench.driver.does["arm"] = raising(DeviceError("wrong"))
    with pytest.raises(DeviceError, match=r"^wrong; output off, read back$"):
        bench.rig.arm()
    assert bench.rig.idle_s() is None
    bench.calls()
    assert bench.after(FEED_S, beats=False) == []


def test_what_is_refused_before_anything_is_sent_is_no_fault(driven: Bench) -> None:
    driven.driver.does["drive"] = raising(LimitExceeded("too much"))
    with pytest.raises(LimitExceeded, match=r"^too much$"):
        driven.rig.drive(DRIVE)
    assert driven.calls() == ["drive"]
    driven.rig.beat()
    assert driven.driver.driven == DRIVE


def test_another_device_is_told_nothing(bench: Bench) -> None:
    bench.driver.does["arm"] = raising(ForeignDevice("a kettle"))
    with pytest.raises(ForeignDevice, match=r"^a kettle$"):
        bench.rig.arm()
    assert bench.calls() == ["arm"]
    assert bench.rig.idle_s() is None
    with pytest.raises(ForeignDevice, match=r"^a kettle$"):
        bench.rig.beat()


def test_an_error_of_our_own_turns_off_too(driven: Bench) -> None:
    driven.driver.does["read_back"] = raising(ValueError("a slip"))
    with pytest.raises(DeviceError, match=r"^ValueError: a slip; output off, read back$"):
        driven.rig.read_back()
    assert driven.calls() == ["read_back", "send_off", "confirm_off"]
    with pytest.raises(DeviceError, match=r"^ValueError: a slip"):
        driven.rig.beat()


def test_the_kind_of_an_error_stays(driven: Bench) -> None:
    driven.driver.does["read_back"] = raising(EmergencyStop("stopped"))
    with pytest.raises(EmergencyStop, match=r"^stopped; output off, read back$"):
        driven.rig.read_back()


UNKNOWN = "output state UNKNOWN - cut the amplifier"


def test_an_output_that_is_not_confirmed_is_unknown(driven: Bench) -> None:
    driven.driver.does |= {
        "read_back": raising(DeviceError("wrong")),
        "confirm_off": raising(OutputUnknown("still on")),
    }
    with pytest.raises(OutputUnknown, match=rf"^{UNKNOWN} \(wrong\)$"):
        driven.rig.read_back()


@pytest.mark.parametrize("confirmed", [True, False])
def test_an_output_that_was_unknown_stays_so_and_says_why_at_first(
    driven: Bench, confirmed: bool
) -> None:
    driven.driver.does["read_back"] = raising(OutputUnknown("the relay"))
    if not confirmed:
        driven.driver.does["confirm_off"] = raising(OutputUnknown("still on"))
    with pytest.raises(OutputUnknown, match=rf"^{UNKNOWN} \(the relay\)$"):
        driven.rig.read_back()


def test_a_port_that_takes_no_off_is_asked_all_the_same(driven: Bench) -> None:
    driven.driver.does |= {
        "read_back": raising(DeviceError("wrong")),
        "send_off": raising(DeviceError("no port")),
    }
    with pytest.raises(DeviceError, match=r"^wrong; output off, read back$"):
        driven.rig.read_back()
    assert driven.calls() == ["read_back", "send_off", "confirm_off"]


def test_what_is_foreign_stays_so_and_is_not_turned_off(driven: Bench) -> None:
    driven.driver.foreign = ForeignOutput("a kettle")
    driven.driver.does["read_back"] = raising(DeviceError("wrong"))
    with pytest.raises(ForeignOutput, match=r"\(a kettle\)$"):
        driven.rig.read_back()
    assert driven.calls() == ["read_back"]


def test_a_stop_by_hand_turns_off_at_once_and_latches(driven: Bench) -> None:
    driven.rig.emergency_stop()
    assert driven.calls() == ["send_off", "confirm_off"]
    assert not driven.driver.link.stopped, "the answer to off must be heard"
    assert driven.driver.driven is None
    latched = r"^stopped by hand; output off, read back$"
    with pytest.raises(EmergencyStop, match=latched):
        driven.rig.beat()
    for again in (driven.rig.read_back, lambda: driven.rig.drive(DRIVE)):
        with pytest.raises(EmergencyStop, match=latched):
            again()
    assert driven.after(FEED_S, beats=False) == []
    driven.rig.arm()
    driven.calls()
    assert driven.after(FEED_S) == ["check"], "once armed anew it is not stopped again"


def test_a_stop_by_hand_ends_the_call_that_waits(driven: Bench) -> None:
    """The link is stopped before the owner sees it: whatever waits for an answer ends."""

    def wait_for_an_answer() -> None:
        driven.rig._stopping = True
        driven.driver.link.stop()
        raise EmergencyStop("while it waited")

    driven.driver.does["read_back"] = wait_for_an_answer
    with pytest.raises(EmergencyStop, match=r"^while it waited; output off"):
        driven.rig.read_back()
    assert driven.calls().count("send_off") == 1


def test_a_stop_during_a_call_takes_effect_before_anything_else_is_done(driven: Bench) -> None:
    def stop_meanwhile() -> ReadBack:
        driven.rig._stopping = True
        return SHOWN

    driven.driver.does["read_back"] = stop_meanwhile
    driven.clock.advance(2 * FEED_S)
    driven.rig.beat()
    driven.rig.read_back()
    assert driven.calls() == ["read_back", "send_off", "confirm_off"], "no feed after the stop"


def test_a_stop_comes_before_the_next_call(driven: Bench) -> None:
    driven.rig._stopping = True
    with pytest.raises(EmergencyStop, match="stopped by hand"):
        driven.rig.drive(DRIVE)
    assert driven.calls() == ["send_off", "confirm_off"]


def test_a_stop_interrupts_the_link(driven: Bench) -> None:
    """What stops is a thread of its own: here the owner does nothing before it is looked at."""
    driven.rig._owner = threading.current_thread()
    driven.rig.emergency_stop()
    assert driven.driver.link.stopped
    assert driven.calls() == []
    driven.rig._owner = None
    driven.rig.step()
    assert driven.calls() == ["send_off", "confirm_off"]


def test_closing_turns_off_what_is_on(driven: Bench) -> None:
    driven.rig.close()
    assert driven.calls() == ["off", "close"]
    assert driven.rig.step() is False


def test_closing_leaves_alone_what_is_off(bench: Bench) -> None:
    bench.rig.close()
    assert bench.calls() == ["close"]


def test_closing_gives_the_port_back_also_if_the_output_is_unknown(driven: Bench) -> None:
    driven.driver.does["off"] = raising(OutputUnknown("no answer"))
    with pytest.raises(OutputUnknown, match="no answer"):
        driven.rig.close()
    assert driven.calls() == ["off", "close"]


def test_a_thread_owns_the_port_until_the_rig_is_closed() -> None:
    bench = Bench(RecordedDriver())
    owners: list[threading.Thread] = []

    def read_back() -> ReadBack:
        owners.append(threading.current_thread())
        return SHOWN

    bench.driver.does["read_back"] = read_back
    before = threading.active_count()
    bench.rig.start()
    assert bench.rig.arm() is IDENTITY
    assert bench.rig.read_back() is SHOWN
    assert threading.active_count() == before + 1
    (owner,) = owners
    assert owner.daemon, "a program that dies does not wait for its port"
    bench.rig.close()
    assert not owner.is_alive()
    assert threading.active_count() == before


def test_a_rig_that_is_opened_has_a_thread_that_owns_its_port(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    driver = RecordedDriver()
    monkeypatch.setattr("device.rig.open_link", lambda url: url)
    monkeypatch.setattr("device.rig.driver_of", lambda dialect: lambda *_: driver)
    before = threading.active_count()
    rig = open_rig("somewhere", LIMITS, "board")
    assert threading.active_count() == before + 1
    assert rig.arm() is IDENTITY
    rig.close()
    assert driver.calls == ["arm", "close"]


def test_a_step_without_a_call_does_not_wait(driven: Bench) -> None:
    waiting = threading.Thread(target=driven.rig.step, daemon=True)
    waiting.start()
    waiting.join(0.5)
    assert not waiting.is_alive()


def test_the_watchdog_is_tried_while_the_session_is_looked_after(bench: Bench) -> None:
    assert bench.rig.watchdog_trips() is True
    bench.driver.does["watchdog_trips"] = lambda: False
    assert bench.rig.watchdog_trips() is False


def test_meanwhile_the_session_is_served_and_may_stop_the_trial() -> None:
    bench = Bench(RecordedDriver())
    bench.rig.start()
    bench.rig.arm()
    ended = threading.Event()
    bench.driver.does["watchdog_trips"] = lambda: ended.wait(5)
    served = 0

    def meanwhile() -> None:
        nonlocal served
        served += 1
        if served == 2:
            ended.set()
        assert served < 50

    assert bench.rig.watchdog_trips(meanwhile) is True
    assert served >= 2
    ended.clear()
    with pytest.raises(KeyboardInterrupt, match="stop"):
        bench.rig.watchdog_trips(raising(KeyboardInterrupt("stop")))
    assert bench.driver.link.stopped
    ended.set()
    with pytest.raises(EmergencyStop, match="stopped by hand"):
        bench.rig.read_back()
    bench.rig.close()


@pytest.mark.parametrize("call", ["drive", "watchdog_trips"])
def test_a_call_that_switches_on_is_a_beat(bench: Bench, call: str) -> None:
    beats = bench.rig._beats
    _ = bench.rig.drive(DRIVE) if call == "drive" else bench.rig.watchdog_trips()
    assert bench.rig._beats == beats + 1


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
