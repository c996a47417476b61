"""The test of the watchdog before a session: when it is made, who confirms it, what it decides."""

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import pytest

from device.drivers.pace import Pace
from device.errors import DeviceError
from protocol.address import SIMULATED
from protocol.journal.events import WatchdogTested
from runner.journal.opening import open_journal
from runner.journal.verification import verdicts
from runner.screens import Note, OperatorView, Order, Response
from runner.session.loop import run
from runner.session.session import SessionContext
from runner.session.waiting import StoppedByOperator
from runner.signals import Stopped, signals_raise
from tests.runner.fakes import FakeClock, FakeDevice, FakeOperator, FakeParticipant, context

RIG = "/dev/ttyUSB0"
DAY_S = 86_400.0


@dataclass
class Study:
    """A study's journal, and sessions that go on until the first touch."""

    path: Path

    def begin(self, device: FakeDevice, at_s: float, address: str = RIG) -> SessionContext:
        """Run a session up to its first touch, `at_s` after noon of the first day."""
        with open_journal(self.path) as journal:
            participant = FakeParticipant(stops_at="touch.smooth")
            made = context(journal, device, participant, address=address)
            assert isinstance(made.clock, FakeClock)
            made.clock.passed_s = DAY_S / 2 + at_s
            with pytest.raises(KeyboardInterrupt, match="Ctrl-C"):
                run(made)
        return made

    def tests(self) -> list[WatchdogTested]:
        """Return what the journal holds of tests."""
        with open_journal(self.path) as journal:
            events = [event.record for event in journal.events_of(WatchdogTested)]
        return [event for event in events if isinstance(event, WatchdogTested)]


@pytest.fixture
def study(tmp_path: Path) -> Iterator[Study]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TZ", "UTC")
        time.tzset()
        yield Study(tmp_path / "study.db")
    time.tzset()


def was_tested(device: FakeDevice) -> bool:
    return "watchdog_trips" in device.calls


def test_the_watchdog_is_tested_once_a_day_before_the_resonance(study: Study) -> None:
    moments = {0.0: True, 3_600.0: False, DAY_S / 2 - 60: False, DAY_S / 2 + 60: True}
    for at_s, due in moments.items():
        device = FakeDevice(has_watchdog=True)
        study.begin(device, at_s)
        assert was_tested(device) is due, at_s
        if due:
            calls = device.calls
            assert calls.index("arm") < calls.index("watchdog_trips") < calls.index("resonance")
    assert study.tests() == 2 * [WatchdogTested(tripped=True, idn="fake", address=RIG)]


def test_each_device_is_tested(study: Study) -> None:
    for idn, address in (("fake", RIG), ("fake", "/dev/ttyUSB1"), ("other", RIG)):
        device = FakeDevice(has_watchdog=True, idn=idn)
        study.begin(device, 0.0, address)
        assert was_tested(device)
    assert len(study.tests()) == 3


def test_a_device_without_a_watchdog_is_not_tested(study: Study) -> None:
    device = FakeDevice()
    study.begin(device, 0.0)
    assert not was_tested(device)
    assert study.tests() == []


@pytest.mark.parametrize("there", [True, False])
def test_the_operator_is_told_of_the_watchdog_and_the_measurement_that_there_are(
    study: Study, there: bool
) -> None:
    made = study.begin(FakeDevice(has_watchdog=there, measures_resonance=there), 0.0)
    assert isinstance(made.operator, FakeOperator)
    assert {view.kept_by for view in made.operator.seen} == {"watchdog" if there else ""}
    measuring = [view for view in made.operator.seen if "measuring the reson" in view.warning]
    assert bool(measuring) is there


def test_the_operator_confirms_that_nobody_touches_a_real_beam(study: Study) -> None:
    for address, asked in ((RIG, True), (SIMULATED, False)):
        made = study.begin(FakeDevice(has_watchdog=True), 0.0, address)
        assert isinstance(made.operator, FakeOperator)
        assert any("nobody may touch the surface" in text for text in made.operator.asked) is asked
        shown = [view.output() for view in made.operator.seen]
        assert shown[shown.index("ON, 0 V, testing the watchdog") + 1] == "off"


class Gone(Exception):
    """Nobody is there."""


def test_a_real_beam_is_left_alone_until_the_operator_confirms(study: Study) -> None:
    class Away(FakeOperator):
        def answered(self) -> str | None:
            raise Gone

    device = FakeDevice(has_watchdog=True)
    with open_journal(study.path) as journal, pytest.raises(Gone):
        run(context(journal, device, FakeParticipant(), operator=Away(device), address=RIG))
    assert not was_tested(device)


def test_a_session_does_not_start_on_a_watchdog_that_does_not_trip(study: Study) -> None:
    for _ in range(2):  # a failed test is no reason not to test again
        device = FakeDevice(has_watchdog=True, trips=False)
        with open_journal(study.path) as journal:
            made = context(journal, device, FakeParticipant(), address=RIG)
            with pytest.raises(
                DeviceError, match=r"watchdog did not trip .*have the device repair"
            ):
                run(made)
            assert device.calls[-1] == "off"
            assert device.driven == []
            assert all(verdict.ok for verdict in verdicts(journal))
    study.begin(FakeDevice(has_watchdog=True), 0.0)
    assert [test.tripped for test in study.tests()] == [False, False, True]


class SlowDevice(FakeDevice):
    """A device whose watchdog takes a while, unless it is stopped."""

    def watchdog_trips(self, meanwhile: Callable[[], None]) -> bool:
        self.on = True
        try:
            for _ in range(1000):
                meanwhile()
        except BaseException:
            self.emergency_stop()
            raise
        return super().watchdog_trips(meanwhile)


@pytest.mark.parametrize("order", ["stop", "emergency stop"])
def test_the_operator_can_end_the_test(study: Study, order: Order) -> None:
    device = SlowDevice(has_watchdog=True)

    class Operator(FakeOperator):
        def order(self) -> Order | Note | None:
            return order if device.on else None

        def show(self, view: OperatorView) -> None: ...

    with open_journal(study.path) as journal:
        made = context(journal, device, FakeParticipant(), operator=Operator(device))
        begun_s = time.monotonic()
        with pytest.raises(StoppedByOperator, match="stop"):
            run(made)
        assert time.monotonic() - begun_s < 1
    assert study.tests() == []
    assert device.calls[-1] == "off"


def test_a_window_that_dies_ends_the_test(study: Study) -> None:
    device = SlowDevice(has_watchdog=True)

    class Dying(FakeParticipant):
        def poll(self) -> Response | None:
            if device.on:
                raise Gone
            return super().poll()

    with open_journal(study.path) as journal, pytest.raises(Gone):
        run(context(journal, device, Dying()))
    assert study.tests() == []
    assert device.calls[-2:] == ["emergency stop", "off"]


def test_a_signal_that_foreign_code_took_ends_the_test(study: Study) -> None:
    class Foreign(SlowDevice):
        def watchdog_trips(self, meanwhile: Callable[[], None]) -> bool:
            with suppress(Stopped):
                signal.raise_signal(signal.SIGTERM)
            return super().watchdog_trips(meanwhile)

    device = Foreign(has_watchdog=True)
    with open_journal(study.path) as journal, signals_raise(), pytest.raises(Stopped):
        run(context(journal, device, FakeParticipant()))
    assert study.tests() == []
    assert device.calls[-2:] == ["emergency stop", "off"]


@pytest.mark.parametrize("answer_s", [0.02, 0.03])
def test_a_device_at_which_touches_would_end_late_is_refused_before_anything_is_driven(
    study: Study, answer_s: float
) -> None:
    pace = Pace(answer_s=answer_s, watch_s=0.1, begin_s=0.1, end_s=0.1, late_s=40 * answer_s)
    device = FakeDevice(pace=pace)
    if answer_s == 0.02:
        study.begin(device, 0.0)
        return
    late = r"^the device takes 30 ms .* up to 1\.3 s longer than planned.*; nothing was driven\n"
    with pytest.raises(DeviceError, match=late):
        study.begin(device, 0.0)
    assert not device.driven
    assert "resonance" not in device.calls
