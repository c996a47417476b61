"""The simulated board: its language, its limits, its watchdog, and the beam under it."""

import json
import math
from collections.abc import Callable

import pytest

from device.simulator.device import SimulatedDevice
from device.simulator.hardware.power_stage import Instrument


@pytest.fixture
def wall() -> list[float]:
    return [0.0]


@pytest.fixture
def device(wall: list[float]) -> SimulatedDevice:
    return SimulatedDevice(seed=1, wall_s=lambda: wall[0])


@pytest.fixture
def ask(device: SimulatedDevice, wall: list[float]) -> Callable[[str], str | None]:
    return lambda line: device.answer(line, wall[0])


Ask = Callable[[str], str | None]


@pytest.mark.parametrize("spelling", ["FREQ?", "freq?", ":FREQuency?", "FREQUENCY?"])
def test_long_and_short_forms_in_any_case(ask: Ask, spelling: str) -> None:
    ask("FREQ 24.22137 KHZ")
    assert ask(spelling) == "24221.37"


@pytest.mark.parametrize(
    ("line", "error"),
    [
        ("FROB 1", '-113,"Undefined header"'),
        ("VOLT 201", '-222,"Data out of range"'),
        ("VOLT -1", '-222,"Data out of range"'),
        ("VOLT ten", '-104,"Data type error"'),
        ("FREQ 1 KG", '-131,"Invalid suffix"'),
        ("OUTP MAYBE", '-104,"Data type error"'),
        ("OUTP ON", '-221,"Settings conflict; no watchdog"'),
    ],
)
def test_what_is_wrong_stands_in_the_error_queue(ask: Ask, line: str, error: str) -> None:
    assert ask(line) is None
    assert ask("SYST:ERR?") == error
    assert ask("SYST:ERR?") == '0,"No error"'


def test_compound_lines_answer_in_order(ask: Ask) -> None:
    assert ask("VOLT 5;VOLT?;VOLT? MAX;OUTP?") == "5;200;0"


def test_the_amplitude_moves_on_its_slew(ask: Ask, wall: list[float]) -> None:
    ask("SYST:WATC 10;:VOLT:RAMP 100;:VOLT 100;OUTP ON")
    wall[0] = 0.5
    assert float(ask("MEAS:VOLT?") or "nan") == pytest.approx(50, abs=0.3)
    wall[0] = 2.0
    assert float(ask("MEAS:VOLT?") or "nan") == pytest.approx(100, abs=0.3)


def test_a_sweep_moves_the_frequency_and_ends_at_its_end(ask: Ask, wall: list[float]) -> None:
    ask("FREQ:SWE:STAR 24 KHZ;STOP 24.4 KHZ;TIME 2;STAT ON")
    wall[0] = 1.0
    assert ask("FREQ?;FREQ:SWE:STAT?") == "24200;1"
    wall[0] = 3.0
    assert ask("FREQ?") == "24400"
    ask("FREQ 24 KHZ")
    assert ask("FREQ?;FREQ:SWE:STAT?") == "24000;0"


def test_the_watchdog_turns_a_silent_host_off(
    device: SimulatedDevice, ask: Ask, wall: list[float]
) -> None:
    ask("SYST:WATC 0.5;:VOLT 100;OUTP ON")
    wall[0] = 0.4
    device.instrument.watch(wall[0])
    assert device.instrument.output
    wall[0] = 1.0
    device.instrument.watch(wall[0])
    assert ask("OUTP?;OUTP:PROT:TRIP?") == "0;1"
    ask("OUTP ON")
    assert ask("OUTP?") == "0", "a trip latches until it is cleared"


def test_reset_leaves_it_off(ask: Ask) -> None:
    ask("SYST:WATC 1;:VOLT 100;OUTP ON;*RST")
    assert ask("OUTP?;VOLT?;SYST:BOOT?") == "0;0;1"


def test_the_vibration_peaks_at_the_hidden_resonance(device: SimulatedDevice, ask: Ask) -> None:
    resonance_hz = device.beam.resonance_hz
    ask("SYST:WATC 10;:VOLT:RAMP 2000;:VOLT 100;OUTP ON")
    device.answer_control("advance 1")

    def tip_m(frequency_hz: float) -> float:
        ask(f"FREQ {frequency_hz}")
        return float(ask("MEAS:VIBR?") or "nan")

    assert tip_m(resonance_hz) > 5 * max(tip_m(0.97 * resonance_hz), tip_m(1.03 * resonance_hz))


def test_a_finger_feels_less_friction_at_the_smooth_place(
    device: SimulatedDevice, ask: Ask
) -> None:
    resting = json.loads(device.answer_control("touch 0.5 0.0414 right"))["friction_coefficient"]
    resonance_hz = device.beam.resonance_hz
    ask(f"SYST:WATC 10;:FREQ {resonance_hz};VOLT:RAMP 2000;:VOLT 200;OUTP ON")
    device.answer_control("advance 1")
    driven = json.loads(device.answer_control("touch 0.5 0.0414 right"))["friction_coefficient"]
    assert resting == pytest.approx(0.4)
    assert driven < 0.8 * resting


def test_control_says_what_is_wrong(device: SimulatedDevice) -> None:
    assert "unknown command 'frob'" in device.answer_control("frob")
    assert "error" in json.loads(device.answer_control("touch 0.5 0.2 right"))
    assert "got 'up'" in device.answer_control("touch 0.5 0.04 up")
    assert "0 s or more" in device.answer_control("advance -1")


def test_stepped_time_stands_still_between_steps(
    device: SimulatedDevice, wall: list[float]
) -> None:
    device.answer_control("advance 2")
    wall[0] = 100.0
    assert json.loads(device.answer_control("state"))["time_s"] == pytest.approx(2.0)


def test_noise_is_the_same_however_often_one_looks() -> None:
    instrument = Instrument(voltage_v=10.0)
    beams = [SimulatedDevice(seed=3).beam for _ in range(2)]
    readings = {beams[0].monitor_v(instrument), *(beams[1].monitor_v(instrument) for _ in range(3))}
    assert len(readings) == 1
    assert not math.isclose(readings.pop(), 10.0, abs_tol=1e-9)
