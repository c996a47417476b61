"""A study on the beam that there is: its limits hold at the resonance that a session measures."""

from collections.abc import Iterable
from math import inf

from protocol.limits import limit_problems
from protocol.problem import Problem
from protocol.programme import slew_v_per_us
from protocol.study import Study
from protocol.touch import Touch


def problems_at(study: Study, resonance_hz: float) -> list[Problem]:
    """Return what `study` may not ask of a rig whose beam has its resonance there, in Hz."""
    rig = study.rig.model_copy(update={"nominal_resonance_hz": resonance_hz})
    return limit_problems(study.model_copy(update={"rig": rig}))


def max_resonance_hz(study: Study, touches: Iterable[Touch]) -> float:
    """Return the highest resonance at which `touches` keep all limits of the rig, Hz."""
    return min((_highest_hz(study, touch) for touch in touches), default=inf)


def _highest_hz(study: Study, touch: Touch) -> float:
    """Drive, slew and current are all proportional to the resonance."""
    rig = study.rig
    slew = slew_v_per_us(touch.peak_voltage_v, touch.peak_frequency)
    limits = [rig.max_frequency_hz / touch.peak_frequency]
    if slew > 0:
        limits.append(rig.max_slew_v_per_us / slew)
        if rig.max_current_ma is not None and rig.capacitance_nf:
            limits.append(rig.max_current_ma / (slew * rig.capacitance_nf))
    return min(limits)
