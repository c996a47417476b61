"""What a fault does to the output, and what is said of it."""

from collections.abc import Callable

import pytest

from device.errors import (
    DeviceError,
    EmergencyStop,
    ForeignDevice,
    ForeignOutput,
    LimitExceeded,
    OutputUnknown,
)
from tests.device.rig.bench import DRIVE, FEED_S, IDENTITY, SHOWN, Bench, raising


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
