"""The axis of contrast: the voltage at which the predicted friction differs so much."""

from collections.abc import Callable
from math import isnan

from device.friction.calibration import NOMINAL, Calibration
from device.friction.changes import friction_difference
from protocol.errors import Problem
from protocol.study.study import Study
from protocol.study_file.limits import level_problems

_PROBES = 24
_CLOSE = 1e-9
"""Of a voltage, relative to the largest."""


def voltages(
    study: Study, number: int, rig: Calibration = NOMINAL
) -> tuple[tuple[float, ...], list[Problem]]:
    """Return the voltage of each level of a track on the axis of contrast, and what is wrong.

    Contrast is |ln(mu / mu')| of the standard against the comparison, by the law and the rung of
    every prediction. Voltages rise from the standard's, as far as the contrast rises with them.
    """
    track, limit_v = study.track[number], study.rig.max_voltage_v
    standard = track.standard
    assert standard is not None  # the study was checked
    first_v = standard.voltage_v
    probed = [first_v + (limit_v - first_v) * probe / _PROBES for probe in range(_PROBES + 1)]
    signed = [friction_difference(study, standard, track.at(0, probe), rig) for probe in probed]
    if isnan(signed[0]):
        where, path = f"track {track.name}, axis", ("track", number, "axis")
        hint = 'take axis = "voltage"'
        return (), [Problem(where, "needs friction, also of the standard", "none", hint, path)]
    side = -1 if signed[1] < signed[0] else 1
    found = [side * value for value in signed]
    # Without a friction above 0 the law gives nan, which rises to nothing.
    rising = next((at for at in range(1, len(found)) if not found[at] > found[at - 1]), len(found))
    largest, least = max(track.values), min(track.values)
    if largest > found[rising - 1] or least < found[0]:
        reached, last_v = found[rising - 1], probed[rising - 1]
        there = f"{abs(found[0]):.3g} at {first_v:g} V to {reached:.3g} at {last_v:.4g} V"
        why = "where it no longer rises" if rising < len(found) else "the limit of the rig"
        rule = f"must lie within the contrasts predicted for this rig, {there}, {why}"
        hint = 'take levels within it, other touches, or axis = "voltage"'
        where, path = f"track {track.name}, levels", ("track", number, "levels")
        return (), [Problem(where, rule, f"{least:g} to {largest:g}", hint, path)]

    def contrast(voltage_v: float) -> float:
        return side * friction_difference(study, standard, track.at(0, voltage_v), rig)

    solved = []
    for value in track.values:
        # Beyond the place where it no longer rises the same contrast could be found again.
        cell = next(at for at in range(1, rising) if found[at] >= value)
        ends = slice(cell - 1, cell + 1)
        solved.append(_solved(contrast, value, probed[ends], found[ends]))
    touches = (track.at(0, voltage_v) for voltage_v in solved)
    return tuple(solved), list(level_problems(study, number, touches))


def _solved(
    contrast: Callable[[float], float], value: float, ends: list[float], told: list[float]
) -> float:
    """Return the voltage of a contrast between two that enclose it (false position, Illinois)."""
    (low, high), (under, over) = ends, (told[0] - value, told[1] - value)
    middle, side = high, 0
    while over > 0 and high - low > _CLOSE * ends[1]:
        middle = high - over * (high - low) / (over - under)
        rest = contrast(middle) - value
        if abs(rest) < _CLOSE:
            break
        # An end that stays twice counts half, so that the other one moves.
        if rest > 0:
            high, over, under, side = middle, rest, under / (1 + (side > 0)), 1
        else:
            low, under, over, side = middle, rest, over / (1 + (side < 0)), -1
    return middle
