"""What the device does during a touch: a soft start, then a hold, ramp or sweep, then off."""

from dataclasses import dataclass
from math import pi

from protocol.rig import Rig
from protocol.touch import Touch, TouchDefaults


@dataclass(frozen=True, kw_only=True)
class Segment:
    """A stretch of a programme over which amplitude and frequency change linearly."""

    kind: str
    duration_s: float
    from_v: float
    to_v: float
    from_hz: float
    to_hz: float


def touch_s(touch: Touch, finger: TouchDefaults) -> float:
    """Return how long the finger is on the beam, s."""
    if touch.duration_s is not None:
        return touch.duration_s
    if touch.place == "smooth":
        return finger.hold_s
    return (finger.path_m[1] - finger.path_m[0]) / finger.sliding_speed_m_s


def segments(touch: Touch, finger: TouchDefaults, rig: Rig) -> tuple[Segment, ...]:
    """Return what the device does for `touch`: rise, the touch's own programme, fall.

    Frequencies in Hz are those at the nominal resonance. At 0 V there is no rise and no fall.
    """
    start_hz = touch.frequency * rig.nominal_resonance_hz
    end_hz = touch.end_frequency * rig.nominal_resonance_hz
    own = Segment(
        kind=touch.programme,
        duration_s=touch_s(touch, finger),
        from_v=touch.voltage_v,
        to_v=touch.end_voltage_v,
        from_hz=start_hz,
        to_hz=end_hz,
    )
    rise = _edge("rise", 0.0, touch.voltage_v, start_hz, rig)
    fall = _edge("fall", touch.end_voltage_v, 0.0, end_hz, rig)
    return (*rise, own, *fall)


def _edge(kind: str, from_v: float, to_v: float, hz: float, rig: Rig) -> tuple[Segment, ...]:
    if from_v == to_v:
        return ()
    duration_s = abs(to_v - from_v) / rig.ramp_v_per_s
    return (
        Segment(kind=kind, duration_s=duration_s, from_v=from_v, to_v=to_v, from_hz=hz, to_hz=hz),
    )


def driven_s(touch: Touch, finger: TouchDefaults, rig: Rig) -> float:
    """Return how long the beam is driven for `touch`, soft start included, s."""
    if touch.peak_voltage_v == 0:
        return 0.0
    return sum(segment.duration_s for segment in segments(touch, finger, rig))


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
