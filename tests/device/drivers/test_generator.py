"""What the driver of a generator makes of its settings, and how it ramps."""

import re
from dataclasses import replace

import pytest

from device.drivers.driver import Driver
from device.drivers.generator import AMPLITUDE_REL_TOL, Generator, Ramp
from device.drivers.limits import Setpoint
from device.errors import DeviceError
from tests.device.lying import LyingPort, lying, stepped
from tests.device.rigs import DRIVE, LIMITS

GENERATORS = ("keysight", "rigol", "siglent")


def test_a_ramp_ends_at_its_end_to_the_last_bit() -> None:
    up = Ramp(from_v=36.35, to_v=109.02, begin_s=0, v_per_s=1)
    assert up.from_v + (up.to_v - up.from_v) != up.to_v, "rounded"
    assert up.at(up.to_v - up.from_v) == up.to_v
    down = Ramp(from_v=100, to_v=20, begin_s=5, v_per_s=40)
    assert down.at(7.5) == 20


def vpp(generator: Driver, voltage_v: float) -> float:
    return generator.limits.amplifier.vpp(voltage_v)


def on_at(dialect: str, setpoint: Setpoint = DRIVE) -> tuple[Generator, LyingPort]:
    """A generator that has reached its amplitude."""
    driver, port = lying(LIMITS, dialect)
    assert isinstance(driver, Generator)
    driver.drive(setpoint)
    moment_s = driver.monotonic()
    driver.monotonic = lambda: moment_s + 10
    assert driver.carry_on() is False
    return driver, port


@pytest.mark.parametrize("query", ["read_back", "check"])
def test_an_amplitude_is_right_to_a_thousandth(query: str) -> None:
    generator, port = on_at("keysight")
    told = vpp(generator, DRIVE.voltage_v)
    port.lies = {"SOUR1:VOLT?": [f"{told * (1 + 0.9 * AMPLITUDE_REL_TOL):.8g}"]}
    getattr(generator, query)()
    port.lies = {"SOUR1:VOLT?": [f"{told * (1 + 1.2 * AMPLITUDE_REL_TOL):.8g}"]}
    with pytest.raises(DeviceError, match=r"^the amplitude was set to 100 V and reads back as 100"):
        getattr(generator, query)()


@pytest.mark.parametrize("dialect", ["rigol", "siglent"])
def test_a_small_amplitude_is_right_to_its_resolution(dialect: str) -> None:
    small = replace(DRIVE, voltage_v=0.5)
    for off_vpp, is_right in ((0.0009, True), (0.0012, False)):
        generator, port = on_at(dialect, small)
        told = vpp(generator, small.voltage_v) + off_vpp
        wave = f"C1:BSWV WVTP,SINE,FRQ,24221.37HZ,AMP,{told:.6f}V,OFST,0V"
        port.lies = {"C1:BSWV?": [wave], "SOUR1:VOLT?": [f"{told:.6f}"]}
        if is_right:
            generator.check()
        else:
            with pytest.raises(DeviceError, match=r"the amplitude was set to 0\.5 V"):
                generator.check()


@pytest.mark.parametrize("dialect", GENERATORS)
def test_the_least_amplitude_itself_can_be_driven(dialect: str) -> None:
    generator, _ = lying(LIMITS, dialect)
    assert isinstance(generator, Generator)
    least = replace(DRIVE, voltage_v=generator.least_v)
    assert generator.drive(least).output is True
    assert generator.drive(replace(DRIVE, voltage_v=0.0)).output is True, (
        "until the ramp to 0 V has ended"
    )
    assert generator.carry_on() is False
    assert generator.reading is not None
    assert generator.reading.output is False
    assert generator.driven is None
    assert generator.carry_on() is False


@pytest.mark.parametrize("dialect", GENERATORS)
def test_a_drive_after_off_begins_its_ramp_anew(dialect: str) -> None:
    """Else the output would jump to where the old ramp would be by now."""
    generator, port = stepped(dialect)
    assert isinstance(generator, Generator)
    slow = replace(DRIVE, ramp_v_per_s=50)
    generator.drive(slow)
    assert generator.carry_on() is True
    generator.off()
    generator.link.stay_silent(10)
    assert generator.drive(slow).voltage_v == pytest.approx(generator.least_v)
    assert generator.carry_on() is True
    assert generator.amplitude_v < 5
    assert port.device.instrument.output


@pytest.mark.parametrize(("on", "state"), [(True, "off"), (False, "on")])
def test_a_generator_switched_by_somebody_is_told_of_by_its_state(on: bool, state: str) -> None:
    generator, port = on_at("keysight")
    if not on:
        generator.off()
    port.lies = {"OUTP1?": ["0" if on else "1"]}
    with pytest.raises(DeviceError, match=f"^the generator's output is {state}, and nobody here "):
        generator.check()


WAVE = "C1:BSWV WVTP,SINE,FRQ,24221.37HZ,AMP,10V,OFST,0V"
FAULTS = (
    ("keysight", {"OUTP1:LOAD?": "50"}, "load must be INF, got 50: twice the voltage"),
    (
        "keysight",
        {"SOUR1:VOLT:UNIT?": "VRMS", "SOUR1:VOLT:OFFS?": "1.5", "SOUR1:FUNC?": "SQU"},
        "unit, offset and function must be VPP, 0 and SIN, got VRMS, 1.5 and SQU",
    ),
    (
        "keysight",
        {"SOUR1:VOLT:LIM:STAT?": "0", "SOUR1:VOLT:LIM:HIGH?": "9", "SOUR1:VOLT:LIM:LOW?": "-8"},
        "limits must be on at -6 and 6 V, got off at -8 and 9 V",
    ),
    (
        "keysight",
        {"SOUR1:VOLT:LIM:HIGH?": "6.001"},
        "limits must be on at -6 and 6 V, got on at -6 and 6.001 V",
    ),
    (
        "keysight",
        {"SOUR1:VOLT:LIM:LOW?": "-6.001"},
        "limits must be on at -6 and 6 V, got on at -6.001 and 6 V",
    ),
    ("keysight", {"SOUR1:AM:STAT?": "1"}, "AM must be off, got 1"),
    ("keysight", {"SOUR1:FREQ:MODE?": "LIST"}, "frequency mode must be CW, got LIST"),
    ("keysight", {"OUTP2?": "1"}, "second channel must be off, got 1"),
    ("rigol", {"SOUR1:HARM?": "ON"}, "harmonics must be off, got ON"),
    (
        "siglent",
        {"C1:OUTP?": "C1:OUTP ON,LOAD,50,PLRT,NOR"},
        "load must be HZ, got 50: twice the voltage",
    ),
    (
        "siglent",
        {"C1:BSWV?": WAVE.replace("OFST,0V", "OFST,1500MV")},
        "wave and offset must be SINE and 0, got SINE and 1.5",
    ),
    (
        "siglent",
        {"C1:BSWV?": WAVE.replace("SINE", "RAMP")},
        "wave and offset must be SINE and 0, got RAMP and 0",
    ),
    ("siglent", {"C1:SWWV?": "C1:SWWV STATE,ON"}, "sweep must be off, got STATE,ON"),
    ("siglent", {"C1:BTWV?": "C1:BTWV STATE,PERHAPS"}, "burst must be off, got STATE,PERHAPS"),
    (
        "siglent",
        {"COUP?": f"COUP TRACE,OFF,FCOUP,ON,{'X' * 40}"},
        f"coupling of channels must be off, got TRACE,OFF,FCOUP,ON,{'X' * 21}",
    ),
)


_OF_A_KEYSIGHT = {
    "FM": "FM:STAT", "PM": "PM:STAT", "PWM": "PWM:STAT", "FSK": "FSK:STAT", "BPSK": "BPSK:STAT",
    "sweep": "SWE:STAT", "burst": "BURS:STAT", "sum": "SUM:STAT",
}  # fmt: skip
_OF_A_RIGOL = {"modulation": "MOD", "sweep": "SWE:STAT", "burst": "BURS", "sum": "SUM"}
_OF_A_SIGLENT = {
    "modulation": "C1:MDWV STATE,ON", "harmonics": "C1:HARM HARMSTATE,ON",
    "combined channel": "C1:CMBN ON", "second channel": "C2:OUTP ON,LOAD,HZ,PLRT,NOR",
}  # fmt: skip
SECOND_SOURCES = (
    *(
        ("keysight", {f"SOUR1:{header}?": "1"}, f"{name} must be off, got 1")
        for name, header in _OF_A_KEYSIGHT.items()
    ),
    ("keysight", {"SOUR1:COMB:FEED?": "CH2"}, "combined channel must be NONE, got CH2"),
    *(
        ("rigol", {f"SOUR1:{header}?": "ON"}, f"{name} must be off, got ON")
        for name, header in _OF_A_RIGOL.items()
    ),
    *(
        ("siglent", {f"{said.split()[0]}?": said}, f"{name} must be off, got {said.split()[1]}")
        for name, said in _OF_A_SIGLENT.items()
    ),
)
"""What else could drive the output, on each, and the names that the operator reads."""


@pytest.mark.parametrize(("dialect", "says", "fault"), [*FAULTS, *SECOND_SOURCES])
def test_a_setting_that_was_changed_is_named(
    dialect: str, says: dict[str, str], fault: str
) -> None:
    generator, port = on_at(dialect)
    port.lies = {query: [answer] for query, answer in says.items()}
    with pytest.raises(DeviceError, match=f"^the generator's {re.escape(fault)}$"):
        generator.check()


@pytest.mark.parametrize(
    "wave",
    [
        WAVE,
        "C1:BSWV WVTP,SINE,FRQ,24.22137KHZ,AMP,10000MV,OFST,0MV",
        "C1:BSWV WVTP, SINE, FRQ,0.02422137MHZ,AMP,1.0E+1V,OFST,-0.0",
        "C1:BSWV OFST,0,AMP,10,FRQ,24221.37,WVTP,SINE",
    ],
)
def test_a_siglent_may_answer_in_any_of_its_units(wave: str) -> None:
    generator, port = on_at("siglent")
    port.lies = {"C1:BSWV?": [wave]}
    shown = generator.read_back()
    assert shown.frequency_hz == pytest.approx(24221.37)
    assert shown.voltage_v == pytest.approx(100)


@pytest.mark.parametrize(
    ("says", "why"),
    [
        ({"C1:BSWV?": "C1:BSWV"}, "must answer with C1:BSWV and its values, got 'C1:BSWV'"),
        ({"C1:BSWV?": WAVE.replace("C1", "C2")}, "must answer with C1:BSWV and its values"),
        ({"C1:BSWV?": WAVE.replace("AMP,10V,", "")}, "must answer with its AMP, got 'WVTP"),
        ({"C1:BSWV?": WAVE.replace("OFST,0V", "OFST")}, "must answer with its OFST, got 'WVTP"),
        ({"C1:BSWV?": WAVE.replace("10V", "10VRMS")}, "a number for AMP, got '10VRMS'"),
        ({"C1:BSWV?": WAVE.replace("10V", "V")}, "a number for AMP, got 'V'"),
        ({"C1:OUTP?": "C1:OUTP ON,PLRT,NOR"}, "must answer with its LOAD, got 'ON,PLRT,NOR'"),
    ],
)
def test_an_answer_of_a_siglent_that_is_incomplete_is_not_believed(
    says: dict[str, str], why: str
) -> None:
    generator, port = on_at("siglent")
    port.lies = {query: [answer] for query, answer in says.items()}
    with pytest.raises(DeviceError, match=why):
        generator.check()


def test_a_siglent_that_does_not_keep_its_wave_is_refused() -> None:
    for wave, told in (
        (WAVE.replace("AMP,10V", "AMP,0.0055V"), "AMP was set to 0.004 and reads back as 0.0055"),
        (WAVE.replace("24221.37", "24222"), "FRQ was set to 24221.4 and reads back as 24222"),
    ):
        generator, port = lying(LIMITS, "siglent")
        port.lies = {"C1:BSWV?": [WAVE, wave] if "AMP" in told else [wave]}
        with pytest.raises(DeviceError, match=f"^{told}$"):
            generator.drive(DRIVE)
        assert "C1:OUTP ON" not in port.sent


@pytest.mark.parametrize("gain", [20, 23, 35])
@pytest.mark.parametrize("dialect", GENERATORS)
def test_limits_agree_that_come_back_with_seven_digits(dialect: str, gain: float) -> None:
    """120 V / 23 is 5.217391 V in the generator's answer, above the line and below it."""
    amplifier = replace(LIMITS.amplifier, gain=gain)
    generator, _ = lying(replace(LIMITS, amplifier=amplifier), dialect)
    generator.check()
