"""The ladder: measured time of each rung, and its error against the top rung."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from statistics import median
from time import perf_counter

import numpy as np

from analysis.report.drawing import Panel, Series
from device.beam.beam import Beam
from device.beam.modes import FloatArray
from device.friction import rungs
from device.friction.coefficient import friction_coefficient
from device.friction.scenes import Scene

POSITIONS = 1000
MODES_SHOWN = "modes:12"
TIMED_RUNGS = (*rungs.MODAL_RUNGS, MODES_SHOWN, *rungs.SEGMENTED_RUNGS)
_ROUNDS = 15


@dataclass(frozen=True, kw_only=True)
class LadderRow:
    """A rung measured in the paper's scene, law `consistent`, at the rung's own resonance.

    `setup_us` is the median time of a set-up of beam and drive, with the search for the resonance,
    and `us_per_1000` that of μ' at 1,000 places after it, each with its lowest and highest time;
    `max_error` is the largest |μ' - μ' of the top rung| over the places, a model-form error, and
    `rms_error` its root mean square.
    """

    rung: str
    setup_us: float
    setup_us_range: tuple[float, float]
    us_per_1000: float
    us_per_1000_range: tuple[float, float]
    max_error: float
    rms_error: float
    resonance_hz: float


def _time_us(work: Callable[[], object]) -> float:
    start = perf_counter()
    work()
    return 1e6 * (perf_counter() - start)


def _round(scene: Scene, places_m: FloatArray) -> dict[str, tuple[float, float]]:
    """Time every rung once, in turn: its set-up and then its places, µs."""
    beam, drive = scene.structure.beam, scene.drive
    times = {}
    for rung in TIMED_RUNGS:
        # A set-up that is remembered would be measured as free of cost.
        rungs.forget_set_ups()
        setup_us = _time_us(partial(rungs.rung_field, rung, beam, drive))
        places = partial(friction_coefficient, scene, rung=rung, x_m=places_m)
        times[rung] = setup_us, _time_us(places)
    return times


def measured_ladder() -> tuple[LadderRow, ...]:
    """Measure every rung in the paper's scene, from the cheapest model to the best.

    The rungs are timed in turn, in several rounds, so that what else the computer does at one
    moment cannot make one rung look slower than another.
    """
    scene, places_m = Scene(), np.linspace(0.0, Beam().length_m, POSITIONS)
    # The reference speeds are cached, so that no rung's set-up includes computing them.
    for rung in TIMED_RUNGS:
        rungs.reference_tip_speed_m_s(rung)
    top = friction_coefficient(scene, rung=rungs.TOP_RUNG, x_m=places_m)
    _round(scene, places_m)  # loads and caches what is not a set-up
    rounds = [_round(scene, places_m) for _ in range(_ROUNDS)]
    rows = []
    for rung in TIMED_RUNGS:
        error = friction_coefficient(scene, rung=rung, x_m=places_m) - top
        setups, places = zip(*(times[rung] for times in rounds), strict=True)
        rows.append(
            LadderRow(
                rung=rung,
                # A median, because the computer may do something else in any single round.
                setup_us=median(setups),
                setup_us_range=(min(setups), max(setups)),
                us_per_1000=median(places),
                us_per_1000_range=(min(places), max(places)),
                max_error=float(np.abs(error).max()),
                rms_error=float(np.sqrt(np.mean(error**2))),
                resonance_hz=rungs.rung_resonance_hz(rung, scene.structure.beam, scene.drive.mode),
            )
        )
    return tuple(rows)


def ladder_lines(rows: tuple[LadderRow, ...]) -> list[list[str]]:
    """Return a header and a row per rung; times are medians, with the lowest and highest."""
    lines = [["rung", "set-up, µs", "µs per 1,000", "max error", "rms error", "resonance, Hz"]]
    for row in rows:
        times = (row.setup_us, row.setup_us_range), (row.us_per_1000, row.us_per_1000_range)
        told = (f"{middle:.0f} ({low:.0f} to {high:.0f})" for middle, (low, high) in times)
        errors = f"{row.max_error:.3f}", f"{row.rms_error:.4f}"
        lines.append([row.rung, *told, *errors, f"{row.resonance_hz:.1f}"])
    return lines


def ladder_panel(rows: tuple[LadderRow, ...]) -> Panel:
    """Return the plot of error against time, for one set-up and 1,000 places."""
    points = Series(
        label="rungs",
        x=np.array([row.setup_us + row.us_per_1000 for row in rows]),
        y=np.array([row.max_error for row in rows]),
        marked=True,
        names=[row.rung for row in rows],
    )
    return Panel(
        title="The ladder at resonance, 100 V, 1,000 places",
        x_label="time for a set-up and 1,000 places, µs",
        y_label="largest error in μ' against the top rung",
        series=(points,),
        logarithmic_x=True,
    )
