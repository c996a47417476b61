"""The thread that owns the port, and what it does meanwhile."""

import threading
from types import SimpleNamespace
from unittest.mock import Mock

import pytest

from device.errors import (
    EmergencyStop,
)
from device.rig import open_rig
from protocol.journal.records import ReadBack
from tests.device.rig.bench import (
    IDENTITY,
    LIMITS,
    SHOWN,
    Bench,
    RecordedDriver,
    raising,
)


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
    port = SimpleNamespace(shared=None)
    made = Mock(return_value=driver, has_watchdog=True, off_command="OUTP OFF")
    monkeypatch.setattr("device.rig.open_port", lambda url: port)
    monkeypatch.setattr("device.rig.driver_of", lambda dialect: made)
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
