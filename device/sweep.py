"""The search for the resonance of the beam on the rig, at a low amplitude."""

from collections.abc import Callable
from dataclasses import dataclass

from device.errors import DeviceError
from device.records import ReadBack, Setpoint

SWEEP_VOLTAGE_V = 10.0
SWEEP_RAMP_V_PER_S = 200.0
HALF_WIDTH = 0.05
"""How far from the nominal resonance the search goes, as a fraction of it."""
FINEST_STEP = 1e-5
"""Resolution of the search, as a fraction of the nominal resonance: a 500th of a 0.5 % damping."""
_POINTS = 21
_SETTLE_S = 0.1


@dataclass(frozen=True, kw_only=True)
class Resonance:
    """Where the beam answers most, and how much: per volt, at the tip."""

    frequency_hz: float
    tip_m_per_v: float


def resonance(
    drive: Callable[[Setpoint], ReadBack],
    vibration_m: Callable[[], float],
    sleep: Callable[[float], None],
    near_hz: float,
) -> Resonance:
    """Return the resonance within `HALF_WIDTH` of `near_hz`, in Hz, to `FINEST_STEP` of it.

    A coarse sweep finds the peak, finer ones close in on it.

    Raises:
        DeviceError: the largest answer lies at the rim of the range: there is no peak inside.
    """

    def answer(frequency_hz: float) -> float:
        drive(
            Setpoint(
                voltage_v=SWEEP_VOLTAGE_V,
                frequency_hz=frequency_hz,
                ramp_v_per_s=SWEEP_RAMP_V_PER_S,
            )
        )
        sleep(_SETTLE_S)
        return vibration_m()

    centre_hz, half_hz = near_hz, HALF_WIDTH * near_hz
    while True:
        step_hz = 2 * half_hz / (_POINTS - 1)
        frequencies = [centre_hz - half_hz + step_hz * i for i in range(_POINTS)]
        answers = [answer(frequency_hz) for frequency_hz in frequencies]
        best = max(range(_POINTS), key=answers.__getitem__)
        if best in {0, _POINTS - 1}:
            raise DeviceError(
                f"no resonance between {frequencies[0]:.0f} and {frequencies[-1]:.0f} Hz: the "
                f"vibration is largest at the rim; is nominal_resonance_hz = {near_hz:g} right?"
            )
        centre_hz, half_hz = frequencies[best], 2 * step_hz
        if step_hz < FINEST_STEP * near_hz:
            return Resonance(frequency_hz=centre_hz, tip_m_per_v=answers[best] / SWEEP_VOLTAGE_V)
