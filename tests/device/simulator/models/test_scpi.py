"""The simulated instruments' grammar: paths, forms, values, registers, and no way to crash it."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from device.simulator.device import SimulatedDevice, dialects
from device.simulator.models.scpi import (
    HERTZ,
    VOLTS,
    ScpiError,
    choice,
    header_pattern,
    messages,
    number,
    quantity,
    split_outside_quotes,
)


@pytest.mark.parametrize(
    ("line", "headers"),
    [
        ("FREQ 1;VOLT 2", ["FREQ", "VOLT"]),
        ("VOLT:LIM:HIGH 5;LOW -5;:OUTP ON", ["VOLT:LIM:HIGH", "VOLT:LIM:LOW", "OUTP"]),
        ("SOUR1:VOLT 1;OFFS 0", ["SOUR1:VOLT", "SOUR1:OFFS"]),
        ("VOLT:RAMP 1;*OPC?;RAMP?", ["VOLT:RAMP", "*OPC?", "VOLT:RAMP?"]),
        (" ; ;outp? ", ["OUTP?"]),
    ],
)
def test_a_header_goes_on_where_the_last_one_stopped(line: str, headers: list[str]) -> None:
    assert [header for header, _ in messages(line)] == headers


def test_quotes_hold_separators() -> None:
    assert split_outside_quotes("""A "x;y";B 'p;q'""", ";") == ['A "x;y"', "B 'p;q'"]


@pytest.mark.parametrize("header", ["SOUR2:VOLT:AMPL?", "VOLT?", "SOURCE:VOLTAGE?"])
def test_what_stands_in_brackets_may_be_left_out(header: str) -> None:
    assert header_pattern("[SOURce#:]VOLTage[:AMPLitude]?").fullmatch(header)


@pytest.mark.parametrize("header", ["VOLTA?", "VOLT", "SOUR:AMPL?", "VOLT:?"])
def test_nothing_between_short_and_long_is_a_header(header: str) -> None:
    assert header_pattern("[SOURce#:]VOLTage[:AMPLitude]?").fullmatch(header) is None


@pytest.mark.parametrize(
    ("text", "value"),
    [("24.5 kHz", 24_500.0), ("1E3", 1e3), ("+.5MHZ", 5e5), ("#HFF", 255.0), ("#B101", 5.0)],
)
def test_numbers_have_units_and_bases(text: str, value: float) -> None:
    assert number(text, HERTZ) == pytest.approx(value)


def test_milli_and_mega_are_told_apart() -> None:
    assert (number("5 MV", VOLTS), number("5 MHZ", HERTZ)) == (0.005, 5e6)


@pytest.mark.parametrize(
    ("text", "code"),
    [("", -109), ("x", -104), ("1,2", -108), ("1 V", -131), ("NAN", -104), ("1_0", -104)],
)
def test_what_is_no_number_has_its_error(text: str, code: int) -> None:
    with pytest.raises(ScpiError, match=rf"^{code},"):
        number(text, HERTZ)


def test_ranges_and_words_have_theirs() -> None:
    with pytest.raises(ScpiError, match=r"^-222,"):
        quantity("11", HERTZ, 0, 10)
    with pytest.raises(ScpiError, match=r"^-138,"):
        number("1 V")
    with pytest.raises(ScpiError, match=r"^-224,"):
        choice("COS", ("SINusoid",))
    assert quantity("MAX", HERTZ, 0, 10) == 10


SCPI = [dialect for dialect in dialects() if dialect != "siglent"]


@pytest.fixture(params=SCPI)
def device(request: pytest.FixtureRequest) -> SimulatedDevice:
    return SimulatedDevice(seed=1, wall_s=lambda: 0.0, dialect=request.param)


def test_every_dialect_has_the_registers_of_ieee_488(device: SimulatedDevice) -> None:
    asked = [int(device.answer(line, 0.0) or "-1") for line in ("*ESR?", "*ESR?", "*STB?")]
    assert asked == [128, 0, 0], "power on"
    device.answer("*ESE 32;*SRE 32;FROB", 0.0)
    asked = [int(device.answer(line, 0.0) or "-1") for line in ("*STB?", "*ESR?", "*TST?")]
    assert asked == [32 + 4 + 64, 32, 0]
    device.answer("*OPC;*WAI", 0.0)
    assert int(device.answer("*ESR?", 0.0) or "-1") == 1
    device.answer("*CLS", 0.0)
    assert (device.answer("SYST:ERR?", 0.0) or "").lstrip("+").startswith("0,")


def test_a_full_error_queue_says_so(device: SimulatedDevice) -> None:
    for _ in range(30):
        device.answer("FROB", 0.0)
    errors = [device.answer("SYST:ERR?", 0.0) or "" for _ in range(21)]
    assert errors[19] == '-350,"Queue overflow"'
    assert errors[20].lstrip("+") == '0,"No error"'


VOCABULARY = """FREQ VOLT OUTP SYST :WATC :ERR? :RAMP :LIM SOUR1
: ; ? , * ' " # MIN MAX ON INF 1E9 -1
KHZ VPP *RST *ESE :LOAD :UNIT :OFFS :HIGH SWE :STAT BURS APPL :SIN DBM MOD SUM VOLL COMB :FEED CH2
C1: C2: BSWV MDWV AMP FRQ WVTP STATE CMBN SINE HZ"""
WORDS = st.lists(st.sampled_from(VOCABULARY.split()), max_size=12).map(" ".join)


@given(st.one_of(st.text(max_size=60), WORDS, WORDS.map(lambda text: text.replace(" ", ""))))
def test_no_line_makes_a_device_do_more_than_complain(line: str) -> None:
    for dialect in dialects():
        device = SimulatedDevice(seed=1, wall_s=lambda: 0.0, dialect=dialect)
        device.answer_bytes(line.encode("utf-8", "replace"), 0.0)
        assert 0 <= device.instrument.output_v <= 200
        assert device.answer("*IDN?", 0.0) is not None


def test_lines_that_are_not_text_are_errors(device: SimulatedDevice) -> None:
    assert device.answer_bytes(random.Random(1).randbytes(20) + b"\xff", 0.0) is None
    assert (device.answer("SYST:ERR?", 0.0) or "") == '-101,"Invalid character"'


def test_a_generator_believes_in_its_load() -> None:
    device = SimulatedDevice(seed=1, wall_s=lambda: 0.0, dialect="keysight")
    device.answer("VOLT 5;:OUTP:LOAD INF", 0.0)
    assert float(device.answer("VOLT?", 0.0) or "nan") == pytest.approx(10)
    device.answer("VOLT 30", 0.0)
    assert float(device.answer("VOLT?", 0.0) or "nan") == pytest.approx(20), "clipped, as they do"
    assert "clipped to upper limit" in (device.answer("SYST:ERR?", 0.0) or "")


def test_the_limits_of_a_generator_hold() -> None:
    device = SimulatedDevice(seed=1, wall_s=lambda: 0.0, dialect="keysight")
    device.answer("OUTP:LOAD INF;:VOLT 4;:VOLT:LIM:HIGH 1;LOW -1;STAT ON", 0.0)
    assert "exceeds the voltage limits" in (device.answer("SYST:ERR?", 0.0) or "")
    device.answer("VOLT 1;:VOLT:LIM:STAT ON;:VOLT 3", 0.0)
    assert float(device.answer("VOLT?", 0.0) or "nan") == pytest.approx(2)
    assert "clipped" in (device.answer("SYST:ERR?", 0.0) or "")
    old = SimulatedDevice(seed=1, wall_s=lambda: 0.0, dialect="keysight-33220A")
    old.answer("VOLT:LIM:STAT ON", 0.0)
    assert old.answer("SYST:ERR?", 0.0) == '-113,"Undefined header"'
