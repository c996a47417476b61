"""What a driver makes of a device's answers, at the very edge of what it may believe."""

import math
import re
from dataclasses import replace

import pytest

from device.drivers.board import Board
from device.drivers.driver import MOST_QUEUED_ERRORS, NO_TEMPERATURE, REL_TOL, driver_of
from device.drivers.generator import (
    NO_ERRORS,
    NO_LIMITS,
    NO_WATCHDOG,
)
from device.errors import (
    CannotRecord,
    DeviceError,
    ForeignOutput,
    LinkTimeout,
    OutputLastOff,
    OutputUnknown,
)
from device.link.link import Link
from tests.device.lying import LyingPort, lying, stepped, unarmed
from tests.device.rigs import DRIVE, LIMITS
from tests.device.scripted import ScriptedPort, ticking

GENERATORS = ("keysight", "rigol", "siglent")
STILL = replace(DRIVE, voltage_v=0.0)
COOL = replace(LIMITS, max_temperature_c=60)


@pytest.mark.parametrize("dialect", ["board", *GENERATORS])
def test_a_board_alone_guards_measures_and_ramps_by_itself(dialect: str) -> None:
    driver, _ = lying(LIMITS, dialect)
    is_board = dialect == "board"
    assert (driver.has_watchdog, driver.measures_vibration) == (is_board, is_board)
    driver.drive(DRIVE)
    assert driver.carry_on() is not is_board


@pytest.mark.parametrize("dialect", GENERATORS)
def test_a_generator_refuses_what_only_a_board_can_do(dialect: str) -> None:
    generator, port = lying(LIMITS, dialect)
    port.sent.clear()
    for asked, kind in (
        (generator.watchdog_trips, DeviceError),
        (generator.vibration_m, DeviceError),
        (generator.force_source, CannotRecord),
    ):
        with pytest.raises(kind, match=f"a {dialect} device "):
            asked()
    assert port.sent == []


def test_a_queue_of_errors_without_end_is_read_to_a_limit() -> None:
    port = ScriptedPort({b"SYST:ERR?\n": b'-100,"Command error"\n'})
    board = Board(Link(port, monotonic=ticking()), LIMITS)
    with pytest.raises(DeviceError, match="error queue does not end: -100 Command error"):
        board.drained_errors()
    assert len(port.sent) == MOST_QUEUED_ERRORS == 32


def test_each_error_in_the_queue_is_reported_once() -> None:
    board, port = lying(LIMITS)
    port.lies = {"SYST:ERR?": ['-100,"One"', '-200,"Two"', '0,"No error"']}
    assert board.drained_errors() == ["-100 One", "-200 Two"]
    port.lies = {"SYST:ERR?": ['-100,"One"', '-200,"Two"', '0,"No error"']}
    with pytest.raises(DeviceError, match=r"^VOLT was refused by the device: -100 One; -200 Two$"):
        board.send("VOLT 1")


@pytest.mark.parametrize(("set_to", "kept"), [("100", "100.001"), ("0", "0.5")])
def test_a_value_that_is_kept_a_little_wrong_is_refused(set_to: str, kept: str) -> None:
    board, port = lying(LIMITS)
    port.lies = {"VOLT?": [kept]}
    with pytest.raises(DeviceError, match=f"^VOLT was set to {set_to} and reads back as {kept}$"):
        board.set_number("VOLT", float(set_to))


def test_a_word_that_is_not_kept_is_refused() -> None:
    generator, port = lying(LIMITS, "keysight")
    port.lies = {"SOUR1:FUNC?": ["SQU"]}
    with pytest.raises(DeviceError, match=r"^SOUR1:FUNC was set to SIN and reads back as SQU$"):
        generator.arm()


@pytest.mark.parametrize("end", [1 - REL_TOL, 1 + REL_TOL])
def test_a_frequency_is_right_up_to_the_tolerance_and_no_further(end: float) -> None:
    board, _ = lying(LIMITS)
    board.driven = DRIVE
    edge_hz = DRIVE.frequency_hz * end
    board.require_frequency(edge_hz)
    with pytest.raises(DeviceError, match=r"FREQ was set to 24221\.37 and reads back as"):
        board.require_frequency(math.nextafter(edge_hz, edge_hz * end))
    board.driven = None
    board.require_frequency(0.0)


def test_a_device_that_does_not_get_into_step_is_not_armed() -> None:
    idn = {b"*IDN?\n": b"touchbeam,BOARD,1,1.2\n"}
    port = ScriptedPort(idn, deaf_to_sync=True)
    board = Board(Link(port, monotonic=ticking()), LIMITS)
    with pytest.raises(LinkTimeout, match=r"step: .* within 5 s \(an earlier answer may be"):
        board.arm()
    assert port.sent.count(b"OUTP OFF\n") == 1


def test_a_device_that_falls_silent_is_given_up_in_time() -> None:
    board, port = stepped()
    board.drive(DRIVE)
    port.line_lie = lambda _: ""
    port.sent.clear()
    begun_s = board.monotonic()
    with pytest.raises(OutputUnknown, match="UNKNOWN - cut the amplifier"):
        board.off()
    assert board.monotonic() - begun_s < 1.0
    assert port.sent.count("OUTP OFF") == 2


def test_the_last_reading_is_that_of_the_drive_and_then_of_the_output_off() -> None:
    board, _ = stepped()
    board.drive(DRIVE)
    board.drive(DRIVE)
    shown = board.reading
    assert shown is not None
    assert (shown.output, shown.frequency_hz) == (True, DRIVE.frequency_hz)
    assert shown.monitor_v == pytest.approx(shown.amplitude_v, abs=0.5)
    assert 0 < shown.amplitude_v < 5, "on its way to 100 V"
    assert (shown.finger_s, shown.force_n is None) == (shown.at_s, False)
    board.check()
    checked = board.reading
    assert checked is not None
    assert checked.at_s > shown.at_s
    assert (checked.force_n, checked.position_m) == (shown.force_n, shown.position_m)
    assert checked.finger_s == shown.finger_s, "a check asks for no sensors"
    board.off()
    off = board.reading
    assert off is not None
    assert off.at_s > checked.at_s
    assert (off.output, off.amplitude_v, off.monitor_v) == (False, 0.0, None)
    assert off.force_n == shown.force_n


def test_a_generator_reads_without_a_finger() -> None:
    generator, _ = lying(LIMITS, "keysight")
    generator.drive(DRIVE)
    assert generator.reading is not None
    assert generator.reading.force_n is None
    assert generator.reading.amplitude_v == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("dialect", "told"),
    [
        ("keysight", (NO_WATCHDOG,)),
        ("keysight-33220A", (NO_WATCHDOG, NO_LIMITS)),
        ("rigol", (NO_WATCHDOG,)),
        ("rigol-DG1062Z", (NO_WATCHDOG, NO_LIMITS)),
        ("siglent", (NO_WATCHDOG, NO_LIMITS, NO_ERRORS)),
        ("board", ()),
    ],
)
def test_the_operator_reads_what_a_device_lacks(dialect: str, told: tuple[str, ...]) -> None:
    for limits, more in ((LIMITS, ()), (COOL, (NO_TEMPERATURE,) * (dialect != "board"))):
        kind = driver_of(dialect.partition("-")[0])
        driver = kind(Link(LyingPort(dialect), monotonic=ticking(1e-3)), limits, ticking(1e-3))
        assert driver.arm().remarks == told + more


# The board


def test_the_identity_has_the_boards_own_time_and_boot() -> None:
    board, port = unarmed(LIMITS)
    port.lies = {"SYST:BOOT?": ["7"], "SYST:TIME?": ["12.5"]}
    identity = board.arm()
    assert (identity.boot, identity.device_time_s) == (7, 12.5)


@pytest.mark.parametrize("query", ["read_back", "check"])
def test_a_board_may_show_as_much_as_the_tolerance_and_no_more(query: str) -> None:
    board, port = lying(LIMITS)
    board.drive(DRIVE)
    port.lies = {"VOLT:INST?": ["107"], "MEAS:VOLT?": ["107"]}
    getattr(board, query)()
    board.drive(DRIVE)
    port.lies = {"VOLT:INST?": ["100"], "MEAS:VOLT?": ["107"]}
    getattr(board, query)()
    port.lies = {"VOLT:INST?": ["100"], "MEAS:VOLT?": ["92.9"]}
    with pytest.raises(DeviceError, match=r"monitor must show 100\.0 V, got 92\.9 V"):
        getattr(board, query)()


def test_a_board_that_is_driven_higher_may_be_on_its_way_at_once() -> None:
    board, port = lying(LIMITS)
    board.drive(replace(DRIVE, voltage_v=20))
    port.advance(0.2)
    board.check()
    port.lies = {"VOLT:INST?": ["30"], "MEAS:VOLT?": ["30"]}
    assert board.drive(DRIVE).monitor_v == 30


@pytest.mark.parametrize("driven", [True, False])
def test_a_board_at_0_v_may_not_show_3_v(driven: bool) -> None:
    board, port = lying(LIMITS)
    if driven:
        board.drive(STILL)
    port.lies = {"VOLT:INST?": ["3"], "MEAS:VOLT?": ["3"]}
    with pytest.raises(DeviceError, match=r"^the amplitude must not exceed 0\.0 V, got 3\.0 V$"):
        board.check()
    port.lies = {"VOLT:INST?": ["2"], "MEAS:VOLT?": ["2.05"]}
    with pytest.raises(DeviceError, match=r"^the monitor must not exceed 0\.0 V, got 2\.0 V$"):
        board.check()


@pytest.mark.parametrize("query", ["read_back", "check"])
def test_a_boards_target_is_the_drive_to_the_last_digit(query: str) -> None:
    board, port = lying(LIMITS)
    board.drive(DRIVE)
    port.lies = {"VOLT?": ["100.001"]}
    with pytest.raises(DeviceError, match=r"^VOLT was set to 100 and reads back as 100\.001$"):
        getattr(board, query)()


@pytest.mark.parametrize(("query", "set_to"), [("VOLT:LIM", "120"), ("SYST:WATC", "0.5")])
def test_a_board_that_has_lost_its_limits_is_not_switched_on(query: str, set_to: str) -> None:
    board, port = lying(LIMITS)
    port.lies = {f"{query}?": ["0.6"]}
    with pytest.raises(DeviceError, match=f"^{query} was set to {set_to} and reads back as 0.6$"):
        board.drive(DRIVE)
    assert "OUTP ON" not in port.sent


_SILENT = r"its watchdog tripped: it says that it heard nothing for 0\.5 s \(the program may .*"


@pytest.mark.parametrize(
    ("query", "said", "why"),
    [
        ("OUTP:PROT:CAUS?", "WATC", f"the device: {_SILENT}$"),
        ("OUTP:PROT:CAUS?", "TEMP", "the device: its protection tripped: over-temperature$"),
        ("OUTP:PROT:CAUS?", "CURR", "the device: its protection tripped: over-current$"),
        ("OUTP:PROT:CAUS?", "FROB", "the device: FROB$"),
        ("SYST:BOOT?", "9", r"the device restarted \(boot 1, now 9\)"),
    ],
)
def test_the_cause_of_a_trip_is_told_wherever_it_is_met(query: str, said: str, why: str) -> None:
    board, port = lying(LIMITS)
    port.lies = {query: [said]}
    with pytest.raises(DeviceError, match=f"^{why}"):
        board.drive(DRIVE)
    assert "OUTP ON" not in port.sent
    port.lies = {}
    board.drive(DRIVE)
    port.lies = {query: [said], "OUTP?": ["0"]}
    for asked in (board.check, board.read_back):
        with pytest.raises(DeviceError, match=f"^{why}"):
            asked()


@pytest.mark.parametrize("query", ["read_back", "check"])
def test_a_board_that_switches_by_itself_is_told_of_by_what_it_did(query: str) -> None:
    board, port = lying(LIMITS)
    port.lies = {"OUTP?": ["1"]}
    with pytest.raises(DeviceError, match=r"^the device's output is on, and nobody here switched"):
        getattr(board, query)()
    port.lies = {}
    board.drive(DRIVE)
    port.lies = {"OUTP?": ["0"]}
    with pytest.raises(DeviceError, match=r"^the device turned its output off by itself$"):
        getattr(board, query)()


def test_a_board_is_not_off_at_the_tolerance_itself() -> None:
    board, port = lying(LIMITS)
    port.lies = {"MEAS:VOLT?": ["2"]}
    with pytest.raises(OutputUnknown, match=r"its monitor still shows 2\.0 V after 0\.5 s\)$"):
        board.off()


def test_a_board_has_half_a_second_to_discharge() -> None:
    board, port = lying(LIMITS)
    port.sent.clear()
    port.lies = {"MEAS:VOLT?": ["150"]}
    moments_s = iter([0.0, 0.25, 0.5])
    board.monotonic = lambda: next(moments_s)
    with pytest.raises(OutputUnknown, match=r"still shows 150\.0 V after 0\.5 s"):
        board.off()
    assert len(port.sent) == 1 + 2, "off, and two looks"


def test_a_board_that_says_on_is_not_off() -> None:
    board, port = lying(LIMITS)
    port.lies = {"OUTP?": ["1"]}
    with pytest.raises(OutputUnknown, match=r"told OUTP OFF and says that its output is on\)$"):
        board.off()


@pytest.mark.parametrize("dialect", ["board", *GENERATORS])
def test_an_output_that_is_on_the_second_time_it_is_asked_is_not_off(dialect: str) -> None:
    driver, port = stepped(dialect)
    driver.drive(DRIVE)
    port.device.answer_control("fault off-ignored on")
    port.sent.clear()
    answers = iter([""])
    port.line_lie = lambda line: next(answers, line)
    told = f"told {driver.off_command} and says that its output is on)"
    with pytest.raises(OutputUnknown, match=re.escape(told)):
        driver.off()
    assert port.sent.count(driver.off_command) == 2


@pytest.mark.parametrize("dialect", ["board", *GENERATORS])
def test_a_device_that_is_not_ours_is_told_off_once_and_left_alone(dialect: str) -> None:
    driver, port = unarmed(LIMITS, dialect)
    port.lies = {"*IDN?": ["ACME,Toaster,1,2"]}
    why = f"expected {re.escape(driver.expected)}, got 'ACME,Toaster,1,2'; nothing else was sent"
    with pytest.raises(ForeignOutput, match=why):
        driver.arm()
    assert port.sent == [driver.off_command, "*IDN?"]
    with pytest.raises(ForeignOutput, match=why):
        driver.off()
    assert port.sent == [driver.off_command, "*IDN?"]
    port.lies = {}
    driver.arm()
    driver.off()


def test_an_off_that_cannot_be_sent_is_unknown_whatever_the_device_says() -> None:
    board, port = lying(LIMITS)
    board.drive(DRIVE)
    send = port.send

    def cut(data: bytes) -> None:
        if data == b"OUTP OFF\n":
            raise OSError("the cable is cut")
        send(data)

    port.send = cut  # type: ignore[method-assign]
    port.lies = {"OUTP?": ["0"], "MEAS:VOLT?": ["0"]}
    with pytest.raises(OutputUnknown, match="cannot send 'OUTP OFF' to the device: the cable is"):
        board.off()
    assert board.driven is None


def test_an_off_without_an_answer_is_unknown() -> None:
    board, port = lying(LIMITS)
    board.drive(DRIVE)
    port.line_lie = lambda _: ""
    with pytest.raises(OutputUnknown, match=r"^output state UNKNOWN - cut the .* may be outst"):
        board.confirm_off()


def test_an_off_without_an_answer_is_the_last_state_if_nothing_was_on() -> None:
    board, port = lying(LIMITS)
    port.line_lie = lambda _: ""
    for _ in range(2):
        with pytest.raises(OutputLastOff, match=r"; the output was off when it was last read back"):
            board.off()
    port.line_lie = str
    port.lies = {"OUTP?": ["1"]}  # somebody switched it on by hand
    with pytest.raises(OutputUnknown, match=r"UNKNOWN .*says that its output is on"):
        board.off()
    port.line_lie = lambda _: ""
    with pytest.raises(OutputUnknown, match=r"^output state UNKNOWN"):
        board.off()


@pytest.mark.parametrize("dialect", ["board", "keysight", "siglent"])
def test_an_output_that_a_poll_saw_on_may_be_on(dialect: str) -> None:
    driver, port = lying(LIMITS, dialect)
    port.device.answer_control("fault panel-on on")
    with pytest.raises(DeviceError, match="nobody here switched it"):
        driver.check()
    port.line_lie = lambda _: ""
    with pytest.raises(OutputUnknown, match=r"^output state UNKNOWN"):
        driver.off()


def test_closing_gives_the_port_back() -> None:
    board, port = lying(LIMITS)
    closed: list[bool] = []
    port.close = lambda: closed.append(True)  # type: ignore[method-assign]
    board.close()
    assert closed == [True]


def test_a_watchdog_has_tripped_if_the_output_is_off_because_of_it() -> None:
    for after, cause, tripped in (("0", "WATC", True), ("1", "WATC", False), ("0", "CURR", False)):
        board, port = stepped()
        port.lies = {"OUTP?": ["1", after, "0"], "OUTP:PROT:CAUS?": ["NONE", cause]}
        assert board.watchdog_trips() is tripped
        assert port.sent.count("OUTP:PROT:CLE") == 2, "as it was armed, and after the test"


@pytest.mark.parametrize("watchdog_s", [0.5, 5.0])
def test_the_test_of_a_watchdog_is_silent_a_fifth_longer_than_it_takes(watchdog_s: float) -> None:
    board, _ = stepped(watchdog_s=watchdog_s)
    begun_s = board.monotonic()
    assert board.watchdog_trips()
    assert board.monotonic() - begun_s == pytest.approx(1.2 * watchdog_s, abs=0.05 + 0.01)


@pytest.mark.parametrize("firmware", ["1.2", "1.10", "2.0", "1.2-beta"])
def test_a_board_of_this_firmware_records(firmware: str) -> None:
    board, port = unarmed(LIMITS)
    port.lies = {"*IDN?": [f"touchbeam,BOARD,7,{firmware}"], "TRAC:SCAL?": ["0.001,0.002,3E-06"]}
    board.arm()
    source = board.force_source()
    assert isinstance(source, Board)
    assert source.start_sampling(1000) == (0.001, 0.002, 3e-6)


@pytest.mark.parametrize("firmware", ["1.1", "0.9", "beta", "x1.2"])
def test_a_board_of_an_older_firmware_records_nothing(firmware: str) -> None:
    board, port = unarmed(LIMITS)
    port.lies = {"*IDN?": [f"touchbeam,BOARD,7,{firmware}"]}
    board.arm()
    with pytest.raises(CannotRecord, match=rf"\(firmware {firmware}\) records no forces"):
        board.force_source()


@pytest.mark.parametrize("scale", ["0.01,0.01,0", "0.01,0.01", "0.01,0.01,1E-4,0"])
def test_a_scale_must_have_three_sizes(scale: str) -> None:
    board, port = lying(LIMITS)
    port.lies = {"TRAC:SCAL?": [scale]}
    with pytest.raises(DeviceError, match="must measure up to"):
        board.force_source().start_sampling(1000)


def test_other_errors_than_an_unknown_question_do_not_hide_a_thermometer() -> None:
    for queued, has_none in ((['-113,"Undefined header"', '-350,"Full"'], True), (["0,"], False)):
        board, port = unarmed(COOL)
        port.silent = {"MEAS:TEMP?"}
        port.lies = {"SYST:ERR?": ['0,"No error"'] * 5 + queued + ['0,"No error"']}
        if has_none:
            assert board.arm().remarks == (NO_TEMPERATURE,)
        else:
            with pytest.raises(DeviceError, match="must answer with an error"):
                board.arm()


# Generators
