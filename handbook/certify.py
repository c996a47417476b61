"""Generator of the table of certified bounds, from which cheap rungs' errors are bounded.

`python -m handbook.certify > device/friction/certified_bounds.json` writes the table again.
For each mode at resonance, the top rung is solved over the damping ratios of the domain; the table
contains the ranges of its zone edges, its running area ∫|W|, and its tip speed and inertia relative
to those of the rung `mode`. For a drive at a given frequency it contains upper bounds on the top
rung's motion and on the errors of `timoshenko-modes` per frequency bin.
`tests/device/friction/test_coefficient.py` and `test_modes_rung.py` check on new random scenes that
nothing exceeds the bounds.
"""

import json
import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import cast

import numpy as np

from device.beam.beam import Beam
from device.beam.modal_pattern import ModalPattern, modal_sum_field
from device.beam.modes import modal_displacement_m, mode_constants, natural_frequency_hz
from device.beam.motion import MotionPattern, direction, motion_pattern, segmented_motion
from device.beam.timoshenko import (
    segmented_natural_frequencies_hz,
    segmented_natural_frequency_hz,
)

DAMPING_RATIOS = np.geomspace(0.002, 0.02, 9)
MODES = range(1, 21)
AREA_CELLS = 128
LOW_HZ, HIGH_HZ, BIN_GROWTH = 200.0, 100e3, 1.01
_SAMPLES_PER_BIN = 20
_MARGIN = 0.02  # of each range, for damping ratios between those solved


def _range(values: Sequence[float]) -> list[float]:
    """Return the range of values, widened by the margin."""
    low, high = min(values), max(values)
    widening = _MARGIN * (high - low) + 1e-6 * abs(high)
    return [low - widening, high + widening]


def _ratios(
    summary: MotionPattern, frequency_hz: float, beam: Beam, mode: int
) -> tuple[float, float]:
    """Return the top rung's tip speed and ω² rms|W| over those of `mode`, both at resonance."""
    own_hz = natural_frequency_hz(beam, mode)
    displacement_m = float(modal_displacement_m(beam, mode, 1.0, own_hz))
    own = own_hz * displacement_m * mode_constants(mode).root / beam.length_m
    inertia = summary.rms_m_per_v * frequency_hz**2 / (own_hz**2 * displacement_m)
    return summary.rotation_per_v * frequency_hz / own, inertia


def _mode_row(mode: int) -> dict[str, object] | None:
    """Return one mode's row, or None if its number of zones varies over the domain."""
    frequency_hz = segmented_natural_frequency_hz(Beam(), mode, patched=True, shear=True)
    beams = [replace(Beam(), damping_ratio=float(ratio)) for ratio in DAMPING_RATIOS]
    motions = [segmented_motion(beam, frequency_hz, patched=True, shear=True) for beam in beams]
    solved = [motion_pattern(motion) for motion in motions]
    if len({summary.edges_m.size for summary in solved}) > 1:
        return None
    ratios = [_ratios(s, frequency_hz, beam, mode) for s, beam in zip(solved, beams, strict=True)]
    speed_ratios, inertia_ratios = zip(*ratios, strict=True)
    edges = np.array([summary.edges_m for summary in solved])
    fine = np.linspace(0.0, Beam().length_m, 20 * AREA_CELLS + 1)
    # the running areas ∫₀ˣ|W|dx / rms, m
    areas = np.array([s.window(fine, fine[-1]).mean * fine for s in solved])
    middle = (areas.max(axis=0) + areas.min(axis=0)) / 2
    coarse = middle[::20]
    off = np.abs(areas - np.interp(fine, fine[::20], coarse)).max()
    return {
        "edges_m": ((edges.max(axis=0) + edges.min(axis=0)) / 2).tolist(),
        "slack_m": ((0.5 + _MARGIN) * np.ptp(edges, axis=0) + 1e-8).tolist(),
        "moves_right": solved[0].moves_right.tolist(),
        "area_m": coarse.tolist(),
        "area_slack_m": float(off * (1 + _MARGIN)),
        "speed_ratio": _range(speed_ratios),
        "inertia_ratio": _range(inertia_ratios),
    }


def _reach(frequency_hz: float, damping_ratio: float) -> tuple[float, float]:
    """Return the top rung's tip speed per volt and metre of lever, and ω² max|W| per volt."""
    beam = replace(Beam(), damping_ratio=damping_ratio)
    motion = segmented_motion(beam, frequency_hz, patched=True, shear=True)
    (deflection,), (rotation,) = np.abs(motion.state(np.linspace(0.0, beam.length_m, 401), 1))
    omega = 2 * math.pi * frequency_hz
    speed = math.sqrt(2 * float(np.mean(rotation**2))) * omega
    return speed, omega**2 * float(deflection.max())


def _envelope() -> dict[str, object]:
    """Return the largest motion of the top rung within each bin of drive frequency."""
    bins = math.ceil(math.log(HIGH_HZ / LOW_HZ) / math.log(BIN_GROWTH))
    steps = np.arange(bins * _SAMPLES_PER_BIN + 1) / _SAMPLES_PER_BIN
    reach = np.array(
        [
            np.max([_reach(float(hz), damping) for damping in (0.002, 0.02)], axis=0)
            for hz in LOW_HZ * BIN_GROWTH**steps
        ]
    )
    parts = [reach[k * _SAMPLES_PER_BIN : (k + 1) * _SAMPLES_PER_BIN + 1] for k in range(bins)]
    most = 1.02 * np.array([part.max(axis=0) for part in parts])
    return {
        "low_hz": LOW_HZ,
        "growth": BIN_GROWTH,
        "speed_per_v_m": most[:, 0].tolist(),
        "acceleration_per_v": most[:, 1].tolist(),
    }


_BY_BIN, _NEIGHBOURS = 4, 3.0  # drives per bin, and the factor on the worst of a bin's neighbours
_SUM_DAMPING = (0.002, 0.006, 0.02)


def _sum_errors(frequency_hz: float, damping_ratio: float) -> tuple[float, float, float]:
    """Return the errors of `timoshenko-modes` against the top rung for one drive.

    They are those of the direction -Re(W ψ*) relative to rms|W| rms|ψ|, of ∫|W|dx/rms between two
    places, m, and of rms|ψ|, relative.
    """
    beam = replace(Beam(), damping_ratio=damping_ratio)
    motion = segmented_motion(beam, frequency_hz, patched=True, shear=True)
    top = motion_pattern(motion)
    everywhere = np.zeros(1, dtype=np.intp)
    field = modal_sum_field(beam, everywhere, np.array([frequency_hz]), np.array([damping_ratio]))
    places, found = cast(ModalPattern, field.pattern).direction()
    exact = direction(motion.state(places, 1))[0]
    ends = np.linspace(0.0, beam.length_m, 1500)
    ours = field.displacement_m[0] * field.pattern.window(ends, ends[-1]).mean
    area = ends * (ours / top.rms_m_per_v - top.window(ends, ends[-1]).mean)
    return (
        float(np.abs(found - exact).max() / (top.rms_m_per_v * top.rotation_per_v)),
        float(np.ptp(area)),
        abs(float(field.rotation[0]) / top.rotation_per_v - 1),
    )


def _modal_sum() -> dict[str, object]:
    """Return the largest errors of `timoshenko-modes` within each bin of drive frequency.

    Those of the two bins beside it count for a bin too.
    """
    count = math.ceil(math.log(HIGH_HZ / LOW_HZ) / math.log(BIN_GROWTH))
    resonances_hz = segmented_natural_frequencies_hz(Beam(), 30, patched=True, shear=True)
    even_hz = LOW_HZ * BIN_GROWTH ** (np.arange(count * _BY_BIN + 1) / _BY_BIN)
    drives_hz = np.concatenate([even_hz, resonances_hz[resonances_hz < HIGH_HZ]])
    errors = np.array(
        [
            np.max([_sum_errors(float(hz), damping) for damping in _SUM_DAMPING], axis=0)
            for hz in drives_hz
        ]
    )
    bins = np.log(drives_hz / LOW_HZ) / math.log(BIN_GROWTH)
    most = [errors[np.abs(bins - (k + 0.5)) <= 1.5 + 1e-9].max(axis=0) for k in range(count)]
    names = ("direction", "area_m", "rotation")
    return dict(zip(names, (_NEIGHBOURS * np.array(most)).T.tolist(), strict=True))


def certified_bounds() -> dict[str, object]:
    """Return the whole table."""
    rows = {str(mode): _mode_row(mode) for mode in MODES}
    return {
        "damping_ratio": [float(DAMPING_RATIOS[0]), float(DAMPING_RATIOS[-1])],
        "modes": {mode: row for mode, row in rows.items() if row is not None},
        "envelope": _envelope(),
        "modal_sum": _modal_sum(),
    }


if __name__ == "__main__":
    # Nine digits keep the table readable.
    text = json.dumps(certified_bounds())
    rounded = json.loads(text, parse_float=lambda number: float(f"{float(number):.9g}"))
    json.dump(rounded, sys.stdout, indent=1)
    sys.stdout.write("\n")
