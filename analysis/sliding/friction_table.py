"""Measured friction as the table of a surface: every drive at every place of the passes.

`[surface] kind = "measured"` reads it back. A quantity that had one value throughout (speed, force,
beam) is no column: nothing is known of how friction depends on it.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from analysis.estimates import FloatArray
from analysis.sliding.experiment import Cell, DrawnSession, SlidingFindings
from analysis.sliding.rig_model import BIN_M, MeanCurve
from device.friction.surfaces import FRICTION, RESONANCE
from protocol.errors import BadInput

_MOST_BINS = 6
"""So many bins may lie between two neighbouring places, and before and after the shortest pass."""


def friction_rows(drawn: DrawnSession, found: SlidingFindings) -> list[list[str]]:
    """Return a header and a row of friction for each combination of drive, way and place.

    Friction without a drive is the same at every frequency.

    Raises:
        BadInput: a pass or a place is missing, or friction is not above 0.
    """
    curves = _curves(drawn, found)
    numbers = _bins(drawn.session, curves)
    several_speeds = len({cell.speed_m_s for cell in curves}) > 1
    speed = ["speed_m_s"] * several_speeds
    rows = [["voltage_v", "frequency", "direction", *speed, "place_m", FRICTION, RESONANCE]]
    frequencies = sorted({cell.frequency for cell in curves if cell.voltage_v})
    for cell in sorted(curves):
        places_m, curve = (numbers + 0.5) * BIN_M, curves[cell]
        friction = np.interp(places_m, curve.x_m, curve.mu)
        if not friction.min() > 0:
            place_mm = 1e3 * places_m[int(np.argmin(friction))]
            raise BadInput(
                f"{drawn.session}: friction must be above 0, got {friction.min():.3g} with "
                f"{_said(cell)} at {place_mm:.1f} mm; exclude the pass and draw it again"
            )
        own_speed = [f"{cell.speed_m_s:g}"] * several_speeds
        driven = [cell.frequency] if cell.voltage_v else frequencies
        rows += [
            [
                *(f"{cell.voltage_v:g}", f"{frequency:.6g}", cell.direction, *own_speed),
                *(f"{place_m:.6g}", f"{value:.6g}", f"{drawn.resonance.frequency_hz:.8g}"),
            ]
            for frequency in driven
            for place_m, value in zip(places_m, friction, strict=True)
        ]
    return rows


def _curves(drawn: DrawnSession, found: SlidingFindings) -> Mapping[Cell, MeanCurve]:
    """Return mean friction by what was planned; raise `BadInput` if some of it was not made.

    Every combination of drive, direction and speed is planned. What was driven as planned is one
    curve, whatever the frequency that a resonance gave it.
    """
    by_cell: dict[Cell, list[int]] = {}
    for at, each in enumerate(drawn.passes):
        by_cell.setdefault(each.cell, []).append(at)
    # A drive that is missing altogether would leave a grid that is whole, but coarser.
    for cell in drawn.planned:
        if cell not in by_cell:
            raise BadInput(
                f"{drawn.session}: no pass counts with {_said(cell)}, and the table needs all of "
                "[slide]; draw the block anew with touchbeam slide --session"
            )
    passes = {cell: tuple(found.binned[at] for at in each) for cell, each in by_cell.items()}
    return {cell: found.curve_of((own[0].setting, own)) for cell, own in passes.items()}


def _bins(session: str, curves: Mapping[Cell, MeanCurve]) -> FloatArray:
    """Return the numbers of the bins that all curves cover; see `_MOST_BINS`."""
    reached = {cell: np.floor(curve.x_m / BIN_M) for cell, curve in curves.items()}
    # Places lie within their bins, so that the middle of an outermost one may lie beyond them.
    firsts, lasts = ([bins[end] for bins in reached.values()] for end in (0, -1))
    for cell, bins in reached.items():
        along = np.array([min(firsts), *bins, max(lasts)])
        at = int(np.argmax(np.diff(along)))
        left, right = along[at : at + 2]
        if right - left > _MOST_BINS:
            raise BadInput(
                f"{session}: friction with {_said(cell)} is missing from {1e3 * BIN_M * left:.1f} "
                f"to {1e3 * BIN_M * right:.1f} mm; draw the block along one whole way each time"
            )
    return np.arange(max(firsts) + 1, min(lasts))


def _said(cell: Cell) -> str:
    drive = f"{cell.voltage_v:g} V at {cell.frequency:g} of the resonance"
    speed = f"{1e3 * cell.speed_m_s:g} mm/s"
    return f"{drive if cell.voltage_v else '0 V'}, to the {cell.direction}, {speed}"


def friction_csv(rows: Sequence[Sequence[str]]) -> str:
    """Return the rows as the text of a file."""
    return "".join(f"{','.join(row)}\n" for row in rows)
