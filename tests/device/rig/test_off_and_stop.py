"""Off, a stop by hand, and closing."""

import threading

import pytest

from device.errors import (
    DeviceError,
    EmergencyStop,
    OutputUnknown,
)
from protocol.journal.records import ReadBack
from tests.device.rig.bench import (
    DRIVE,
    FEED_S,
    SHOWN,
    Bench,
    raising,
)


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
