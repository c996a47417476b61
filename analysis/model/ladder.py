"""The ladder: measured time of each rung and tolerance on a beam, and the error in μ' of each."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from statistics import median
from time import perf_counter

import numpy as np

from analysis.report.drawing import Panel, Series
from device.arrays import FloatArray
from device.errors import OutOfRangeError
from device.friction.calibration import Calibration
from device.friction.coefficient import friction_coefficient
from device.friction.fineness import TOLERANCE, TOLERANCES, fineness_for
from device.friction.rungs import RUNG_NAMES, TOP_RUNG, rung_field, rung_resonance_hz
from device.friction.scenes import Drive, FingerContact, Scene
from device.friction.surfaces import BeamSurface
from protocol.errors import BadInput
from protocol.study.study import Study

POSITIONS = 1000
_ROUNDS = 15
_ANOTHER = 1e-13
"""Part by which the beam of each round differs, so that no set-up is remembered from another."""


@dataclass(frozen=True, kw_only=True)
class LadderRow:
    """A rung measured in a scene, law `consistent`; `tolerance` is None but on the rung `beam`.

    `setup_us` is the median time of a set-up of beam and drive, with the search for the resonance,
    and `us_per_1000` that of μ' at 1,000 places after it, each with its lowest and highest time.
    `max_error` is the largest difference of μ' over the places, and `rms_error` its root mean
    square: of `beam` from `beam` at the finest tolerance, a numerical error; of another rung from
    `beam` at the default tolerance, an error of the model.
    """

    rung: str
    tolerance: float | None
    setup_us: float
    setup_us_range: tuple[float, float]
    us_per_1000: float
    us_per_1000_range: tuple[float, float]
    max_error: float
    rms_error: float
    resonance_hz: float


Step = tuple[str, float | None]
"""A rung, and on the rung `beam` a tolerance."""
STEPS: tuple[Step, ...] = (
    *((rung, None) for rung in RUNG_NAMES if rung != TOP_RUNG),
    *((TOP_RUNG, tolerance) for tolerance in TOLERANCES),
)


def _time_us(work: Callable[[], object]) -> float:
    start = perf_counter()
    work()
    return 1e6 * (perf_counter() - start)


def _friction(scene: Scene, step: Step, places_m: FloatArray) -> FloatArray:
    rung, tolerance = step
    return friction_coefficient(scene, rung=rung, x_m=places_m, tolerance=tolerance or TOLERANCE)


def study_scene(study: Study, rig: Calibration) -> Scene:
    """Return the study's finger on its beam as calibrated, driven with 100 V at resonance.

    Raise `BadInput` for a surface whose friction no model predicts.
    """
    if not isinstance(rig.surface, BeamSurface):
        raise BadInput(
            f"the surface of {study.study.name} has kind {study.surface.kind}: no model predicts "
            "its friction; leave the study out for the paper's beam"
        )
    touch = study.touch
    return Scene(
        structure=rig.structure,
        drive=Drive(mode=rig.mode),
        touch=FingerContact(
            x_m=0.0,
            contact_m=touch.contact_m,
            finger_load_n=touch.force_n,
            sliding_speed_m_s=touch.sliding_speed_m_s,
        ),
    )


def refused_rungs(scene: Scene) -> dict[str, str]:
    """Return why the scene does not allow some rungs, by their names."""
    refused = {}
    for rung in RUNG_NAMES:
        try:
            _friction(scene, (rung, None), _places_m(scene))
        except OutOfRangeError as error:
            refused[rung] = str(error)
    return refused


def _places_m(scene: Scene) -> FloatArray:
    return np.linspace(0.0, scene.structure.beam.length_m, POSITIONS)


def _round(
    scene: Scene, steps: tuple[Step, ...], places_m: FloatArray, number: int
) -> dict[Step, tuple[float, float]]:
    """Time every step once, in turn: its set-up and then its places, µs."""
    times = {}
    for at, step in enumerate(steps):
        rung, tolerance = step
        beam, drive = scene.structure.beam, scene.drive
        part = 1 + _ANOTHER * (len(STEPS) * number + at + 1)
        beam = replace(beam, youngs_modulus_pa=beam.youngs_modulus_pa * part)
        own = replace(scene, structure=replace(scene.structure, beam=beam))
        fineness = fineness_for(tolerance or TOLERANCE)
        # As `friction_coefficient` asks for it, which then finds it in the cache.
        set_up = partial(rung_field, rung, beam, drive, "first", fineness)
        times[step] = _time_us(set_up), _time_us(partial(_friction, own, step, places_m))
    return times


def measured_ladder(scene: Scene | None = None) -> tuple[LadderRow, ...]:
    """Measure every step that a scene allows, from the cheapest to the finest.

    The scene is by default the paper's. The steps are timed in turn, in several rounds, so that
    what else the computer does at one moment cannot make one of them look slower than another.
    """
    scene = scene or Scene()
    beam, mode = scene.structure.beam, scene.drive.mode
    places_m, refused = _places_m(scene), refused_rungs(scene)
    if TOP_RUNG in refused:
        raise BadInput(f"no friction can be predicted on this beam: {refused[TOP_RUNG]}")
    steps = tuple(step for step in STEPS if step[0] not in refused)
    _round(scene, steps, places_m, 0)  # loads and caches what is not a set-up
    rounds = [_round(scene, steps, places_m, number) for number in range(1, _ROUNDS + 1)]
    model = _friction(scene, (TOP_RUNG, TOLERANCE), places_m)
    finest = _friction(scene, (TOP_RUNG, TOLERANCES[-1]), places_m)
    rows = []
    for step in steps:
        rung, tolerance = step
        due = finest if rung == TOP_RUNG else model
        error = _friction(scene, step, places_m) - due
        setups, places = zip(*(times[step] for times in rounds), strict=True)
        rows.append(
            LadderRow(
                rung=rung,
                tolerance=tolerance,
                # A median, because the computer may do something else in any single round.
                setup_us=median(setups),
                setup_us_range=(min(setups), max(setups)),
                us_per_1000=median(places),
                us_per_1000_range=(min(places), max(places)),
                max_error=float(np.abs(error).max()),
                rms_error=float(np.sqrt(np.mean(error**2))),
                resonance_hz=rung_resonance_hz(rung, beam, mode),
            )
        )
    return tuple(rows)


def ladder_lines(rows: tuple[LadderRow, ...]) -> list[list[str]]:
    """Return a header and a line per row; times are medians, with the lowest and highest.

    The finest tolerance has no errors: those of the others are from it.
    """
    titles = ["rung", "tolerance", "set-up, µs", "µs per 1,000", "max error", "rms error"]
    lines = [[*titles, "resonance, Hz"]]
    for row in rows:
        times = (row.setup_us, row.setup_us_range), (row.us_per_1000, row.us_per_1000_range)
        ranges = (f"{middle:.0f} ({low:.0f} to {high:.0f})" for middle, (low, high) in times)
        tolerance = "" if row.tolerance is None else f"{row.tolerance:g}"
        finest = row.tolerance == TOLERANCES[-1]
        errors = ("", "") if finest else (f"{row.max_error:.2g}", f"{row.rms_error:.2g}")
        lines.append([row.rung, tolerance, *ranges, *errors, f"{row.resonance_hz:.1f}"])
    return lines


def ladder_words(scene: Scene, rows: tuple[LadderRow, ...]) -> list[str]:
    """Return what the rows say of a scene's beam, in sentences."""
    beam, by_step = scene.structure.beam, {(row.rung, row.tolerance): row for row in rows}
    full = by_step[TOP_RUNG, TOLERANCE]
    supports = " and ".join(dict.fromkeys(beam.supports))
    ends = f"{supports} at both ends" if beam.supports[0] == beam.supports[1] else supports
    driven = f"mode {scene.drive.mode} at {full.resonance_hz:.0f} Hz"
    words = [
        f"The beam: {1e3 * beam.length_m:g} mm, {ends}, {driven}, driven with "
        f"{scene.drive.voltage_v:g} V at resonance.",
        f"The whole beam at the default tolerance, {TOLERANCE:g}, takes "
        f"{full.setup_us / 1e3:.2g} ms once per beam and drive, and then "
        f"{full.us_per_1000:.0f} µs for 1,000 places.",
    ]
    words += [
        f"The rung {row.rung} takes {row.us_per_1000:.0f} µs for 1,000 places and errs by up to "
        f"{row.max_error:.2g} in μ'."
        for row in rows
        if row.rung in {"mode", "own-mode"}
    ]
    return [*words, *(f"Not on this beam: {why}." for why in refused_rungs(scene).values())]


def ladder_panel(rows: tuple[LadderRow, ...]) -> Panel:
    """Return the plot of error against time, for one set-up and 1,000 places."""
    shown = [row for row in rows if row.tolerance != TOLERANCES[-1]]
    points = Series(
        label="rungs",
        x=np.array([row.setup_us + row.us_per_1000 for row in shown]),
        y=np.array([row.max_error for row in shown]),
        marked=True,
        names=[
            row.rung if row.tolerance is None else f"{row.rung} {row.tolerance:g}" for row in shown
        ],
    )
    return Panel(
        title="The ladder, 1,000 places",
        x_label="time for a set-up and 1,000 places, µs",
        y_label="largest error in μ'",
        series=(points,),
        logarithmic=True,
    )
