"""The ladder measured here and now: what each rung costs, and how far it is from the top rung."""

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
    """A rung as measured in the paper's scene, law `consistent`, at the rung's own resonance.

    Attributes:
        rung: its name.
        setup_us: one set-up of beam and drive, the search for the resonance included.
        us_per_1000: μ' at 1,000 places once that is done.
        max_error: largest |μ' - μ' of the top rung| over the places: a model-form error.
        rms_error: its root mean square.
        resonance_hz: the rung's resonance of mode 6.
    """

    rung: str
    setup_us: float
    us_per_1000: float
    max_error: float
    rms_error: float
    resonance_hz: float


def _quickest_us(work: Callable[[], object], before: Callable[[], object] | None = None) -> float:
    """The shortest of several runs of `work`, µs."""
    times = []
    for _ in range(_REPEATS):
        if before:
            before()
        start = perf_counter()
        work()
        times.append(perf_counter() - start)
    return 1e6 * min(times)


def _set_up_us(rung: str, scene: Scene) -> float:
    beam, drive = scene.structure.beam, scene.drive
    return _quickest_us(lambda: rung_field(rung, beam, drive), before=forget_set_ups)


def _row(rung: str, scene: Scene, places_m: FloatArray, top: FloatArray) -> LadderRow:
    error = friction_coefficient(scene, rung=rung, x_m=places_m) - top
    return LadderRow(
        rung=rung,
        setup_us=_set_up_us(rung, scene),
        us_per_1000=_quickest_us(lambda: friction_coefficient(scene, rung=rung, x_m=places_m)),
        max_error=float(np.abs(error).max()),
        rms_error=float(np.sqrt(np.mean(error**2))),
        resonance_hz=rung_resonance_hz(rung, Beam(), scene.drive.mode),
    )


def measured_ladder() -> tuple[LadderRow, ...]:
    """Every rung, from the cheapest idea to the best, in the paper's scene."""
    scene, places_m = Scene(), np.linspace(0.0, Beam().length_m, POSITIONS)
    for rung in RUNGS:
        reference_tip_speed_m_s(rung)
    top = friction_coefficient(scene, rung=TOP_RUNG, x_m=places_m)
    return tuple(_row(rung, scene, places_m, top) for rung in RUNGS)


def ladder_json(rows: tuple[LadderRow, ...]) -> list[dict[str, object]]:
    """The rows as records."""
    return [asdict(row) for row in rows]


def ladder_lines(rows: tuple[LadderRow, ...]) -> list[list[str]]:
    """Header and a row per rung."""
    header = ["rung", "set-up, µs", "µs per 1,000", "max error", "rms error", "resonance, Hz"]
    return [header, *(_cells(row) for row in rows)]


def _cells(row: LadderRow) -> list[str]:
    return [
        row.rung,
        f"{row.setup_us:.0f}",
        f"{row.us_per_1000:.0f}",
        f"{row.max_error:.3f}",
        f"{row.rms_error:.4f}",
        f"{row.resonance_hz:.1f}",
    ]


def ladder_panel(rows: tuple[LadderRow, ...]) -> Panel:
    """Error against time, for one set-up and 1,000 places; the top rung's error is 0."""
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
