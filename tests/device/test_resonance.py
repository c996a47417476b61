"""The search for the resonance: recovery under noise, and an error if there is no resonance."""

import math
import random

import pytest

from device.drivers.limits import Limits, Setpoint
from device.errors import DeviceError
from device.resonance import SWEEP_VOLTAGE_V, resonance
from protocol.journal.records import ReadBack

LIMITS = Limits(max_voltage_v=200, max_frequency_hz=40_000, ramp_v_per_s=400, watchdog_s=0.5)


class Resonator:
    """A beam that responds like a damped resonator, with noise."""

    def __init__(self, resonance_hz: float, seed: int) -> None:
        self.resonance_hz = resonance_hz
        self.frequency_hz = 0.0
        self.highest_v = 0.0
        self._random = random.Random(seed)

    def drive(self, setpoint: Setpoint) -> ReadBack:
        self.frequency_hz = setpoint.frequency_hz
        self.highest_v = max(self.highest_v, setpoint.voltage_v)
        return ReadBack(
            output=True,
            voltage_v=setpoint.voltage_v,
            frequency_hz=setpoint.frequency_hz,
            monitor_v=setpoint.voltage_v,
            force_n=0.0,
            position_m=0.0,
            device_time_s=0.0,
        )

    def vibration_m(self) -> float:
        ratio = self.frequency_hz / self.resonance_hz
        amplitude = 1e-7 / math.hypot(1 - ratio**2, 2 * 0.005 * ratio)
        return amplitude * (1 + self._random.gauss(0, 0.005))


@pytest.mark.parametrize("seed", range(20))
def test_the_resonance_is_found_under_noise(seed: int) -> None:
    true_hz = random.Random(seed).uniform(0.96, 1.04) * 24_221
    beam = Resonator(true_hz, seed)
    found = resonance(beam.drive, beam.vibration_m, lambda _: None, 24_221, LIMITS)
    assert found.frequency_hz == pytest.approx(true_hz, abs=0.0005 * true_hz)
    assert found.tip_m_per_v == pytest.approx(1e-7 / 0.01 / SWEEP_VOLTAGE_V, rel=0.02)
    assert beam.highest_v == SWEEP_VOLTAGE_V


@pytest.mark.parametrize("seed", range(20))
def test_a_resonance_outside_the_range_is_not_invented(seed: int) -> None:
    beam = Resonator(48_000, seed)
    with pytest.raises(DeviceError, match=r"no resonance between 23010 and 25432 Hz.*24221"):
        resonance(beam.drive, beam.vibration_m, lambda _: None, 24_221, LIMITS)


def test_a_dead_sensor_is_not_taken_for_a_beam() -> None:
    beam = Resonator(24_221, seed=1)
    readings = iter([1.0 if i == 10 else 0.1 for i in range(21)] + [0.0] * 21)
    with pytest.raises(DeviceError, match="above 0 m, got 0 m"):
        resonance(beam.drive, lambda: next(readings), lambda _: None, 24_221, LIMITS)


def test_the_search_keeps_the_limits_of_the_rig() -> None:
    beam = Resonator(24_221, seed=1)
    driven: list[Setpoint] = []

    def drive(setpoint: Setpoint) -> ReadBack:
        driven.append(setpoint.checked(tight))
        return beam.drive(setpoint)

    tight = Limits(max_voltage_v=5, max_frequency_hz=24_500, ramp_v_per_s=50, watchdog_s=0.5)
    found = resonance(drive, beam.vibration_m, lambda _: None, 24_221, tight)
    assert found.frequency_hz == pytest.approx(24_221, abs=12)
    assert max(setpoint.frequency_hz for setpoint in driven) == 24_500
