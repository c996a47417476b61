"""The ladder: measured time of each rung, and its error against the top rung."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from time import perf_counter

import numpy as np

from analysis.report.drawing import Panel, Series
from device.beam.beam import Beam
from device.beam.modes import FloatArray
from device.friction.coefficient import friction_coefficient
from device.friction.rungs import (
    MODAL_RUNGS,
    SEGMENTED_RUNGS,
    TOP_RUNG,
    forget_set_ups,
    reference_tip_speed_m_s,
    rung_field,
    rung_resonance_hz,
)
from device.friction.scenes import Scene

POSITIONS = 1000
MODES_SHOWN = "modes:12"
RUNGS = (*MODAL_RUNGS, MODES_SHOWN, *SEGMENTED_RUNGS)
_REPEATS = 15


@dataclass(frozen=True, kw_only=True)
class LadderRow:
    """A rung measured in the paper's scene, law `consistent`, at the rung's own resonance.

    Attributes:
        rung: name.
        setup_us: time of a set-up of beam and drive, including the search for the resonance.
        us_per_1000: time of μ' at 1,000 places after the set-up.
        max_error: largest |μ' - μ' of the top rung| over the places, a model-form error.
        rms_error: root mean square of that error.
        resonance_hz: resonance of mode 6.
    """

    rung: str
    setup_us: float
    us_per_1000: float
    max_error: float
    rms_error: float
    resonance_hz: float


def _quickest_us(work: Callable[[], object], before: Callable[[], object] | None = None) -> float:
    """Return the shortest time of several runs of `work`, µs."""
    times = []
    for _ in range(_REPEATS):
        if before:
            before()
        start = perf_counter()
        work()
        times.append(perf_counter() - start)
    return 1e6 * min(times)


def _row(rung: str, scene: Scene, places_m: FloatArray, top: FloatArray) -> LadderRow:
    beam, drive = scene.structure.beam, scene.drive
    error = friction_coefficient(scene, rung=rung, x_m=places_m) - top
    return LadderRow(
        rung=rung,
        setup_us=_quickest_us(lambda: rung_field(rung, beam, drive), before=forget_set_ups),
        us_per_1000=_quickest_us(lambda: friction_coefficient(scene, rung=rung, x_m=places_m)),
        max_error=float(np.abs(error).max()),
        rms_error=float(np.sqrt(np.mean(error**2))),
        resonance_hz=rung_resonance_hz(rung, beam, drive.mode),
    )


def measured_ladder() -> tuple[LadderRow, ...]:
    """Measure every rung in the paper's scene, from the cheapest model to the best."""
    scene, places_m = Scene(), np.linspace(0.0, Beam().length_m, POSITIONS)
    # The reference speeds are cached, so that no rung's set-up includes computing them.
    for rung in RUNGS:
        reference_tip_speed_m_s(rung)
    top = friction_coefficient(scene, rung=TOP_RUNG, x_m=places_m)
    return tuple(_row(rung, scene, places_m, top) for rung in RUNGS)


def ladder_json(rows: tuple[LadderRow, ...]) -> list[dict[str, object]]:
    """Return the rows as JSON records."""
    return [asdict(row) for row in rows]


def ladder_lines(rows: tuple[LadderRow, ...]) -> list[list[str]]:
    """Return a header and a row per rung."""
    header = ["rung", "set-up, µs", "µs per 1,000", "max error", "rms error", "resonance, Hz"]
    formats = "{}", "{:.0f}", "{:.0f}", "{:.3f}", "{:.4f}", "{:.1f}"
    lines = [
        [text.format(value) for text, value in zip(formats, asdict(row).values(), strict=True)]
        for row in rows
    ]
    return [header, *lines]


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
