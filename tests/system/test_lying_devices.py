"""A device that reports what cannot be, or must not be: each answer is held against the drive."""

from dataclasses import replace

import pytest

from device.drivers.driver import NO_TEMPERATURE, Driver
from device.errors import DeviceError, LinkTimeout, OutputUnknown
from tests.device.lying import LyingPort, SteppedClock, lying, stepped, unarmed, watched
from tests.device.rigs import DRIVE, LIMITS

FREQ = {"board": "FREQ?", "keysight": "SOUR1:FREQ?"}


@pytest.mark.parametrize("query", ["read_back", "check"])
@pytest.mark.parametrize("shown_v", ["108", "126.5", "500"])
def test_a_board_that_gives_more_than_was_asked_is_not_believed_to_be_right(
    query: str, shown_v: str
) -> None:
    """Both readings agree: a wrong gain inside the board."""
    board, port = lying(LIMITS)
    board.drive(DRIVE)
    port.lies = {"VOLT:INST?": [shown_v], "MEAS:VOLT?": [shown_v]}
    with pytest.raises(DeviceError, match=rf"must not exceed 100\.0 V, got {float(shown_v):.1f} V"):
        getattr(board, query)()


@pytest.mark.parametrize("query", ["read_back", "check"])
def test_two_small_errors_of_a_board_do_not_add_up(query: str) -> None:
    board, port = lying(LIMITS)
    board.drive(DRIVE)
    port.lies = {"VOLT:INST?": ["106"], "MEAS:VOLT?": ["113"]}
    with pytest.raises(DeviceError, match=r"must not exceed 100\.0 V, got 113\.0 V"):
        getattr(board, query)()


def test_a_board_may_give_what_it_comes_down_from_and_no_more_than_it_has_left_of_it() -> None:
    clock = SteppedClock()
    board, port = stepped("board", watchdog_s=5, clock=clock)
    board.drive(DRIVE)
    clock.advance(0.5)
    board.drive(replace(DRIVE, voltage_v=20))
    clock.advance(0.1)
    assert board.read_back().monitor_v == pytest.approx(60, abs=1)
    board.check()
    port.lies = {"VOLT:INST?": ["80"], "MEAS:VOLT?": ["80"]}
    with pytest.raises(DeviceError, match=r"must not exceed 58\.8 V, got 80\.0 V"):
        board.check()


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_a_board_that_does_not_come_down_as_fast_as_it_was_told_is_at_fault(share: float) -> None:
    """It stays where it was, or comes down at half the rate."""
    with watched(LIMITS, "board") as made:
        made.rig.arm()
        made.rig.drive(DRIVE)
        made.live(1)
        begun_s = made.clock()

        def comes_down() -> None:
            made.rig.drive(replace(DRIVE, voltage_v=10))
            while made.clock() < begun_s + 1:
                volts = 100 - share * DRIVE.ramp_v_per_s * (made.clock() - begun_s)
                made.port.lies = {"VOLT:INST?": [f"{volts:g}"], "MEAS:VOLT?": [f"{volts:g}"]}
                made.live(0.02)

        with pytest.raises(DeviceError, match=r"the amplitude must not exceed \d"):
            comes_down()
        assert made.port.off_s is not None
        assert made.port.off_s - begun_s < 0.3


@pytest.mark.parametrize("ramp_v_per_s", [400, 80, 20])
def test_a_board_that_comes_down_as_it_was_told_is_not_at_fault(ramp_v_per_s: float) -> None:
    """However late a ramp is slowed down, and wherever it begins."""
    with watched(LIMITS, "board") as made:
        made.rig.arm()
        made.rig.drive(DRIVE)
        made.live(0.5)
        for volts in (60.0, 30.0, 0.0):
            made.rig.drive(replace(DRIVE, voltage_v=volts, ramp_v_per_s=ramp_v_per_s))
            made.live(0.05)
            made.rig.drive(replace(DRIVE, voltage_v=volts, ramp_v_per_s=ramp_v_per_s / 4))
            made.live(1)
        assert made.rig.read_back().output


@pytest.mark.parametrize("driven", [True, False])
def test_an_amplitude_below_zero_is_a_fault(driven: bool) -> None:
    with watched(LIMITS, "board") as made:
        made.rig.arm()
        if driven:
            made.rig.drive(DRIVE)
        made.live(1)
        if not driven:  # within the tolerance
            made.port.lies = {"VOLT:INST?": ["-2"], "MEAS:VOLT?": ["-2"]}
            made.live(0.3)
        made.port.lies = {"VOLT:INST?": ["-38"], "MEAS:VOLT?": ["-38"]}
        with pytest.raises(DeviceError, match=r"the amplitude must not be below 0 V, got -38\.0 V"):
            made.live(0.3)


@pytest.mark.parametrize("dialect", ["board", "keysight", "rigol", "siglent"])
def test_the_last_answers_say_on_while_the_output_is_switched(
    dialect: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    driver, port = lying(LIMITS, dialect)
    send, seen = port.send, []

    def looked(data: bytes) -> None:
        send(data)
        if port.device.instrument.output:
            seen.append(driver.reading is None or driver.reading.output)

    monkeypatch.setattr(port, "send", looked)
    for _ in range(2):
        driver.drive(DRIVE)
        driver.check()
        driver.off()
        assert driver.reading is not None
        assert not driver.reading.output
    assert len(seen) > 5
    assert all(seen)


def test_a_board_that_was_off_comes_down_from_nothing() -> None:
    board, port = lying(LIMITS)
    board.drive(DRIVE)
    port.advance(1)
    board.off()
    board.drive(replace(DRIVE, voltage_v=20))
    port.lies = {"VOLT:INST?": ["80"], "MEAS:VOLT?": ["80"]}
    with pytest.raises(DeviceError, match=r"must not exceed 20\.0 V, got 80\.0 V"):
        board.read_back()


@pytest.mark.parametrize("query", ["read_back", "check"])
def test_a_generator_that_reports_another_amplitude_than_was_set_is_at_fault(query: str) -> None:
    generator, port = lying(LIMITS, "keysight")
    generator.drive(DRIVE)
    port.lies = {"SOUR1:VOLT?": ["10"]}
    with pytest.raises(DeviceError, match=r"amplitude was set to 0\.02 V and reads back as 100"):
        getattr(generator, query)()


@pytest.mark.parametrize("query", ["read_back", "check"])
@pytest.mark.parametrize("dialect", FREQ)
def test_a_frequency_that_was_not_commanded_is_a_fault(dialect: str, query: str) -> None:
    driver, port = lying(LIMITS, dialect)
    driver.drive(DRIVE)
    port.lies = {FREQ[dialect]: ["99000"]}
    with pytest.raises(DeviceError, match=r"FREQ was set to 24221\.37 and reads back as 99000"):
        getattr(driver, query)()


@pytest.mark.parametrize("dialect", FREQ)
def test_a_stepped_frequency_is_held_against_its_last_step(dialect: str) -> None:
    driver, port = lying(LIMITS, dialect)
    for frequency_hz in (24_000.0, 24_100.0):
        read_back = driver.drive(replace(DRIVE, frequency_hz=frequency_hz))
        assert read_back.frequency_hz == frequency_hz
        driver.check()
    port.lies = {FREQ[dialect]: ["24000"]}
    with pytest.raises(DeviceError, match="FREQ was set to 24100 and reads back as 24000"):
        driver.check()


def test_a_poll_of_a_board_is_one_question() -> None:
    board, port = lying(LIMITS)
    board.drive(DRIVE)
    port.sent.clear()
    board.check()
    assert len(port.sent) == 1


def off_at_first(*monitors: str) -> tuple[Driver, LyingPort]:
    """A board that was driven, and its monitor's answers from then on."""
    board, port = lying(LIMITS)
    board.drive(DRIVE)
    port.advance(1)
    port.lies = {"MEAS:VOLT?": list(monitors)}
    return board, port


def test_a_board_is_off_when_its_output_has_discharged() -> None:
    board, port = off_at_first("100", "60", "20", "2.1", "1.9")
    port.sent.clear()
    board.off()
    assert len(port.sent) == 1 + 5, "off, and a look at each of the five"


@pytest.mark.parametrize("monitor_v", ["150", "2.1", "-150"])
def test_a_board_that_does_not_discharge_is_not_off(monitor_v: str) -> None:
    """A shorted stage, or a relay that is stuck."""
    board, port = off_at_first(monitor_v)
    shown = float(monitor_v)
    with pytest.raises(OutputUnknown, match=rf"UNKNOWN - cut .*monitor still shows {shown:.1f} V"):
        board.off()
    assert len(port.sent) < 1000, "it does not look for ever"


def test_a_line_before_the_answer_does_not_make_a_board_off() -> None:
    """The device says `0` unasked and then that it is on."""
    board, port = lying(LIMITS)
    board.drive(DRIVE)
    port.lies = {"OUTP?": ["0\n1"]}
    with pytest.raises(OutputUnknown, match="UNKNOWN - cut the amplifier"):
        board.off()


@pytest.mark.parametrize("query", ["read_back", "check"])
def test_the_monitor_of_a_board_is_looked_at_while_it_is_off(query: str) -> None:
    board, port = off_at_first()
    board.off()
    getattr(board, query)()
    port.lies = {"MEAS:VOLT?": ["150"]}
    with pytest.raises(DeviceError, match=r"the monitor must show 0\.0 V, got 150\.0 V"):
        getattr(board, query)()


def test_a_board_that_is_off_and_means_to_give_something_is_at_fault() -> None:
    board, port = off_at_first()
    board.off()
    port.lies = {"VOLT:INST?": ["150"], "MEAS:VOLT?": ["150"]}
    with pytest.raises(DeviceError, match=r"must not exceed 0\.0 V, got 150\.0 V"):
        board.check()


def test_arming_does_not_go_on_while_the_output_has_voltage() -> None:
    board, port = off_at_first("150")
    port.sent.clear()
    with pytest.raises(OutputUnknown, match=r"monitor still shows 150\.0 V"):
        board.arm()
    assert not any(line.startswith("SYST:WATC") for line in port.sent)


COOL = replace(LIMITS, max_temperature_c=60)


def test_a_board_that_gets_too_hot_is_at_fault_in_one_question() -> None:
    board, port = lying(COOL)
    board.drive(DRIVE)
    board.check()
    port.lies = {"MEAS:TEMP?": ["60.0", "60.1"]}
    port.sent.clear()
    board.check()
    assert len(port.sent) == 1
    with pytest.raises(DeviceError, match=r"not be hotter than 60 °C, got 60\.1 °C"):
        board.check()


@pytest.mark.parametrize("answer", ["NAN", "9.91E37", ""])
def test_a_temperature_that_is_no_number_is_a_fault(answer: str) -> None:
    board, port = lying(COOL)
    port.lies = {"MEAS:TEMP?": [answer]}
    with pytest.raises(DeviceError, match="must answer with a number"):
        board.check()


def test_a_board_that_is_hot_is_not_armed() -> None:
    board, port = unarmed(COOL)
    port.lies = {"MEAS:TEMP?": ["900"]}
    with pytest.raises(DeviceError, match=r"not be hotter than 60 °C, got 900\.0 °C"):
        board.arm()


def test_a_board_without_a_thermometer_says_that_nothing_keeps_the_limit() -> None:
    board, port = unarmed(COOL)
    port.unknown = {"MEAS:TEMP?"}
    assert board.arm().remarks == (NO_TEMPERATURE,)
    board.drive(DRIVE)
    board.check()


def test_a_board_that_does_not_say_its_temperature_is_not_one_without_a_thermometer() -> None:
    board, port = unarmed(COOL)
    port.silent = {"MEAS:TEMP?"}
    with pytest.raises(LinkTimeout, match=r"no answer to 'MEAS:TEMP\?' in time"):
        board.arm()


def test_nobody_asks_for_a_temperature_that_is_not_limited() -> None:
    board, port = lying(LIMITS)
    board.check()
    assert not any("TEMP" in line for line in port.sent)


def test_a_generator_says_that_nothing_keeps_the_temperature() -> None:
    assert NO_TEMPERATURE in unarmed(COOL, "keysight")[0].arm().remarks
    assert NO_TEMPERATURE not in unarmed(LIMITS, "keysight")[0].arm().remarks


@pytest.mark.parametrize("dialect", ["keysight", "rigol", "siglent"])
def test_a_generator_without_a_calibration_is_refused_before_it_is_driven(dialect: str) -> None:
    with watched(LIMITS, dialect) as watched_rig:
        watched_rig.rig.arm()
        with pytest.raises(DeviceError, match=r"measures no vibration: .* output off, read back"):
            watched_rig.rig.resonance(24_221, lambda _: None)
        assert not any(line.endswith(("OUTP ON", "OUTP1 ON")) for line in watched_rig.port.sent)
        watched_rig.rig.off()
