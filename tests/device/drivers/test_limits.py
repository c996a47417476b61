"""The driver's limits: what lies on a limit is let through, what lies beyond it is not."""

import re
from dataclasses import replace
from math import inf, nan, nextafter

import pytest

from device.drivers.limits import SLOWEST_RAMP_V_PER_S, Amplifier, Limits, Setpoint
from device.errors import LimitExceeded, OutOfRangeError

LIMITS = Limits(max_voltage_v=120, max_frequency_hz=40_000, ramp_v_per_s=400, watchdog_s=0.5)
DRIVE = Setpoint(voltage_v=100, frequency_hz=24_000, ramp_v_per_s=200)


@pytest.mark.parametrize(
    ("name", "lowest", "highest"),
    [
        ("voltage_v", 0, 120),
        ("frequency_hz", 1, 40_000),
        ("ramp_v_per_s", SLOWEST_RAMP_V_PER_S, 400),
    ],
)
def test_a_limit_is_let_through_and_nothing_beyond_it(
    name: str, lowest: float, highest: float
) -> None:
    for value in (lowest, highest):
        drive = replace(DRIVE, **{name: value})
        assert drive.checked(LIMITS) is drive
    for value in (nextafter(lowest, -inf), nextafter(highest, inf), nan, inf, -inf):
        message = rf"{name} must lie in \[{lowest:.12g}, {highest:.12g}\], got {value:.12g}"
        with pytest.raises(LimitExceeded, match=f"^{message}$"):
            replace(DRIVE, **{name: value}).checked(LIMITS)


def test_a_ramp_of_1_mv_per_s_is_the_slowest() -> None:
    assert SLOWEST_RAMP_V_PER_S == 0.001


AT_10_KHZ = 2e-6 * 3.141592653589793 * 10_000 * 100
"""The slope of 100 V at 10 kHz, V/us."""


@pytest.mark.parametrize(
    ("amplifier", "message"),
    [
        (Amplifier(max_slew_v_per_us=6.28318530717), "slew_v_per_us must not exceed 6.28.*"),
        (
            Amplifier(max_current_a=6.28318530717e-3, load_f=1e-9),
            "current_a must not exceed 0.006283.*",
        ),
        (
            Amplifier(gain=20, max_vpp=9.99),
            "peak-to-peak voltage must not exceed 9.99, got 10",
        ),
    ],
)
def test_what_the_amplifier_cannot_follow_is_refused(amplifier: Amplifier, message: str) -> None:
    drive = replace(DRIVE, frequency_hz=10_000)
    with pytest.raises(LimitExceeded, match=f"^{message}$"):
        drive.checked(replace(LIMITS, amplifier=amplifier))


@pytest.mark.parametrize(
    "amplifier",
    [
        Amplifier(),
        Amplifier(max_slew_v_per_us=AT_10_KHZ),
        Amplifier(max_current_a=1e6 * AT_10_KHZ * 1e-9, load_f=1e-9),
        Amplifier(max_current_a=1e-12),
        Amplifier(gain=20, max_vpp=10),
        Amplifier(max_vpp=1e-3),
    ],
    ids=["unknown", "slew", "current", "no load", "peak-to-peak", "no gain"],
)
def test_what_the_amplifier_just_follows_is_let_through(amplifier: Amplifier) -> None:
    drive = replace(DRIVE, frequency_hz=10_000)
    assert drive.checked(replace(LIMITS, amplifier=amplifier)) is drive


def test_an_amplifiers_load_is_none_unless_somebody_says_so() -> None:
    assert Amplifier().load_f == 0


def test_peak_to_peak_is_twice_the_amplitude_over_the_gain_and_back() -> None:
    amplifier = Amplifier(gain=20)
    assert amplifier.vpp(150) == 15
    assert amplifier.amplitude_v(15) == 150


@pytest.mark.parametrize("asked", ["vpp", "amplitude_v"])
def test_without_a_gain_nothing_is_converted(asked: str) -> None:
    with pytest.raises(LimitExceeded, match=r"a generator needs rig\.amplifier_gain"):
        getattr(Amplifier(), asked)(1.0)


@pytest.mark.parametrize("name", ["gain", "max_vpp", "max_slew_v_per_us", "max_current_a"])
@pytest.mark.parametrize("value", [0.0, -1.0, nan, inf])
def test_an_amplifier_is_a_possible_one(name: str, value: float) -> None:
    rule = f"amplifier {name} must be a finite number above 0"
    with pytest.raises(OutOfRangeError, match=re.escape(rule)):
        Amplifier(**{name: value})


@pytest.mark.parametrize("value", [-1e-9, nan, inf])
def test_a_load_is_not_negative(value: float) -> None:
    with pytest.raises(OutOfRangeError, match="load_f must be a finite number of at least 0"):
        Amplifier(load_f=value)
