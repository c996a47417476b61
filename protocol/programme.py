"""How long the device drives a touch, and what its amplifier has to give for it."""

from math import pi

from protocol.rig import Rig
from protocol.touch import Touch, TouchDefaults


def touch_s(touch: Touch, finger: TouchDefaults) -> float:
    """Return how long the finger is on the beam, s."""
    if touch.duration_s is not None:
        return touch.duration_s
    if touch.place == "smooth":
        return finger.hold_s
    return (finger.path_m[1] - finger.path_m[0]) / finger.sliding_speed_m_s


def on_s(touch: Touch, finger: TouchDefaults, rig: Rig) -> float:
    """Return how long the device is busy with `touch`: the soft start, then the touch itself, s.

    At its end the output goes off at once.
    """
    return touch.voltage_v / rig.ramp_v_per_s + touch_s(touch, finger)


def driven_s(touch: Touch, finger: TouchDefaults, rig: Rig) -> float:
    """Return how long the beam is driven for `touch`, soft start included, s."""
    return on_s(touch, finger, rig) if touch.peak_voltage_v > 0 else 0.0


def slew_v_per_us(voltage_v: float, frequency_hz: float) -> float:
    """Return the largest slope of a sine of this amplitude, 2 pi f V, in V/us.

    >>> round(slew_v_per_us(200, 24_221), 1)
    30.4
    """
    return 2 * pi * frequency_hz * voltage_v * 1e-6


def current_ma(voltage_v: float, frequency_hz: float, capacitance_nf: float) -> float:
    """Return the amplitude of the current into a capacitance, 2 pi f C V, in mA.

    >>> round(current_ma(200, 24_221, 1.0))
    30
    """
    return slew_v_per_us(voltage_v, frequency_hz) * capacitance_nf
