"""The search for the beam's resonance on the rig, at a low amplitude."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from device.drivers.limits import Limits, Setpoint
from device.errors import DeviceError
from protocol.journal.records import ReadBack

SWEEP_VOLTAGE_V = 10.0
SWEEP_RAMP_V_PER_S = 200.0
HALF_WIDTH = 0.05
"""Half the width of the searched range, as a fraction of the nominal resonance."""
LEAST_RISE = 2.0
"""Least ratio of a peak to the median of the range, so that noise is not taken for a peak."""
_POINTS = 21
_SETTLE_S = 0.1


@dataclass(frozen=True, kw_only=True)
class Resonance:
    """The resonance frequency, the tip's amplitude per volt there, and the coarse sweep, if any."""

    frequency_hz: float
    tip_m_per_v: float
    curve: tuple[tuple[float, float], ...] = field(default=(), compare=False, repr=False)


def resonance(
    drive: Callable[[Setpoint], ReadBack],
    vibration_m: Callable[[], float],
    sleep: Callable[[float], None],
    near_hz: float,
    limits: Limits,
) -> Resonance:
    """Return the resonance within `HALF_WIDTH` of `near_hz` and within `limits`.

    A coarse sweep finds the peak. A fine sweep about it is fitted by a parabola in 1/amplitude²,
    the form of a resonance near its peak, so that noise averages out. Raise `DeviceError` without a
    peak.
    """
    # A rig may allow less than the usual amplitude of the search.
    voltage_v = min(SWEEP_VOLTAGE_V, limits.max_voltage_v)
    ramp_v_per_s = min(SWEEP_RAMP_V_PER_S, limits.ramp_v_per_s)

    def answer(frequency_hz: float) -> float:
        read_back = drive(
            Setpoint(voltage_v=voltage_v, frequency_hz=frequency_hz, ramp_v_per_s=ramp_v_per_s)
        )
        # The first step begins at 0 V and waits for the soft start, the later ones for the beam.
        shown_v = read_back.voltage_v if read_back.monitor_v is None else read_back.monitor_v
        sleep(_SETTLE_S + max(voltage_v - shown_v, 0.0) / ramp_v_per_s)
        return vibration_m() / voltage_v

    # The beam must not be driven above the rig's limit even to look for its resonance.
    highest_hz = min((1 + HALF_WIDTH) * near_hz, limits.max_frequency_hz)
    coarse = np.linspace((1 - HALF_WIDTH) * near_hz, highest_hz, _POINTS)
    answers = np.array([answer(frequency_hz) for frequency_hz in coarse])
    best = int(np.argmax(answers))
    # A peak at an end may be the flank of a resonance outside the range.
    if best in {0, _POINTS - 1} or answers[best] < LEAST_RISE * np.median(answers):
        cut = limits.max_frequency_hz < (1 + HALF_WIDTH) * near_hz
        ends = f" (the search ends at max_frequency_hz = {limits.max_frequency_hz:g})"
        raise DeviceError(
            f"no resonance between {coarse[0]:.0f} and {coarse[-1]:.0f} Hz{ends if cut else ''}: "
            f"the vibration has no peak there; is nominal_resonance_hz = {near_hz:g} correct?"
        )
    fine = np.linspace(coarse[best - 1], coarse[best + 1], _POINTS)
    peak = _peak(fine, np.array([answer(frequency_hz) for frequency_hz in fine]))
    return replace(peak, curve=tuple(zip(coarse.tolist(), answers.tolist(), strict=True)))


def _peak(frequencies_hz: NDArray[np.float64], tips_m: NDArray[np.float64]) -> Resonance:
    """Return the resonance at the vertex of the parabola fitted to 1/amplitude²."""
    if not (tips_m > 0).all():
        raise DeviceError(f"the vibration must be above 0 m, got {tips_m.min():g} m")
    middle_hz, tip_m = float(frequencies_hz.mean()), float(tips_m.max())
    # About the middle and relative: polynomials in 24,000 Hz and 1e-7 m lose digits.
    curve, slope, lowest = np.polyfit(frequencies_hz - middle_hz, (tip_m / tips_m) ** 2, 2)
    vertex_hz = -slope / (2 * curve)
    level = lowest - slope**2 / (4 * curve)
    # A parabola that opens downwards, or crosses 0, is that of no resonance.
    if curve <= 0 or level <= 0 or abs(vertex_hz) > np.ptp(frequencies_hz) / 2:
        raise DeviceError(f"no resonance near {middle_hz:.0f} Hz: the vibration has no clear peak")
    return Resonance(
        frequency_hz=middle_hz + float(vertex_hz), tip_m_per_v=tip_m / math.sqrt(level)
    )
