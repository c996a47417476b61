"""Coverage of 95% intervals over hundreds of studies of each kind.

One cell: `pytest -m soak -s tests/soak/test_sensitivity_coverage.py -k "calibrated and 9x5x1 and
ceiling"`.
"""

from concurrent.futures import ProcessPoolExecutor
from dataclasses import fields
from itertools import repeat
from typing import Literal

import numpy as np
import pytest

from analysis.estimates import FloatArray
from analysis.sensitivity.linear_model import LinearSensitivity, linear_sensitivity
from analysis.sensitivity.lines import Lines
from analysis.sensitivity.ordinal_model import OrdinalSensitivity, ordinal_sensitivity
from tests.analysis.sensitivity.calibration import DESIGNS, POPULATIONS, Measures, measured
from tests.analysis.sensitivity.simulated_raters import (
    VirtualPopulation,
    VirtualStudy,
    virtual_study,
)

STUDIES = 1000
STUDIES_PER_CELL = 200
CONTRASTS = np.array([0.10, 0.15, 0.25, 0.35, 0.05])
EXTENDED = np.outer(CONTRASTS, [0.25, 0.6, 1.2, 2.0])
ONCE = CONTRASTS[:, None]

OPEN = VirtualPopulation(bias=3.0, gain=9.0, gain_sd=3.0, discrepancy_sd=0.0, scale=None)
CEILING = VirtualPopulation(bias=6.0, gain=10.0, gain_sd=3.0, discrepancy_sd=0.5)

Model = Literal["M1", "M2"]
Task = tuple[Model, VirtualPopulation, FloatArray, int, int]

pytestmark = pytest.mark.soak


def drawn(
    population: VirtualPopulation, contrast: FloatArray, subjects: int, seed: int
) -> VirtualStudy:
    return virtual_study(
        population,
        subjects=subjects,
        condition=np.repeat(np.arange(5), contrast.shape[1]),
        contrast=contrast.ravel(),
        rng=np.random.default_rng([20, seed]),
    )


def lines_of(model: Model, study: VirtualStudy) -> Lines:
    fit = linear_sensitivity if model == "M1" else ordinal_sensitivity
    result = fit(study.ratings)
    assert isinstance(result, LinearSensitivity | OrdinalSensitivity)
    return result.lines


def coverage_of(task: Task) -> list[float]:
    """Coverage of bias and gain, mean and RMS error of gain, width, own share, tens."""
    model, population, contrast, subjects, seed = task
    study = drawn(population, contrast, subjects, seed)
    lines = lines_of(model, study).subjects
    bias = np.array([line.bias_interval for line in lines])
    gain = np.array([line.gain_interval for line in lines])
    error = np.array([line.gain for line in lines]) - study.gain
    return [
        float(((bias[:, 0] <= study.bias) & (study.bias <= bias[:, 1])).mean()),
        float(((gain[:, 0] <= study.gain) & (study.gain <= gain[:, 1])).mean()),
        float(error.mean()),
        float((error**2).mean()),
        float(np.diff(gain).mean()),
        float(np.mean([line.own_share for line in lines])),
        float((study.ratings.rating == 10).mean()),
    ]


def over_studies(
    name: str, model: Model, population: VirtualPopulation, contrast: FloatArray, subjects: int
) -> list[float]:
    tasks: list[Task] = [(model, population, contrast, subjects, s) for s in range(STUDIES)]
    with ProcessPoolExecutor(2) as pool:
        rows = np.array(list(pool.map(coverage_of, tasks, chunksize=25)))
    bias, gain, error, square, width, share, tens = rows.mean(axis=0)
    print(
        f"\n{name}: coverage of bias {bias:.4f}, of gain {gain:.4f}; gain error {error:+.3f} on "
        f"average, {np.sqrt(square):.3f} RMS, interval {width:.2f} wide; own share {share:.2f}; "
        f"{tens:.0%} tens"
    )
    return [float(bias), float(gain), float(error)]


def test_m1_without_a_ceiling_covers() -> None:
    bias, gain, error = over_studies("M1, extended, open scale", "M1", OPEN, EXTENDED, 20)
    assert 0.92 < bias < 0.98
    assert 0.92 < gain < 0.98
    assert abs(error) < 0.1


def test_m2_with_a_ceiling_covers() -> None:
    bias, gain, error = over_studies("M2, extended, ceiling", "M2", CEILING, EXTENDED, 20)
    assert 0.92 < bias < 0.98
    assert 0.92 < gain < 0.98
    assert abs(error) < 1.0


def test_m1_with_a_ceiling_does_not_cover() -> None:
    _, gain, error = over_studies("M1, extended, ceiling", "M1", CEILING, EXTENDED, 20)
    assert gain < 0.85
    assert error < -1.0


def test_one_rating_per_cell_covers() -> None:
    once = over_studies("M1, paper's design, open scale", "M1", OPEN, ONCE, 9)
    assert 0.9 < once[1] < 0.99
    assert over_studies("M2, paper's design, ceiling", "M2", CEILING, ONCE, 9)[1] > 0.9


def calibration(name: str, design: str) -> dict[str, tuple[float, float]]:
    """Return the mean of each measure with its Monte Carlo error, that of the mean over studies."""
    seeds = range(STUDIES_PER_CELL)
    with ProcessPoolExecutor(2) as pool:
        studies = pool.map(measured, repeat(name), repeat(design), seeds, chunksize=10)
        found = [one for one in studies if isinstance(one, Measures)]
    table = {}
    for measure in fields(Measures):
        values = np.array([getattr(one, measure.name) for one in found])
        values = values[~np.isnan(values)]  # M1 refuses some studies that M2 does not
        table[measure.name] = (float(values.mean()), float(values.std() / np.sqrt(len(values))))
    # Of a share that every study had, the spread between studies says nothing.
    shown = ", ".join(
        f"{key} {mean:.3f} " + (f"± {error:.3f}" if error else "(all)")
        for key, (mean, error) in table.items()
    )
    print(f"\n{design}, {name}, {len(found)} studies: {shown}")
    # Few ratings of which two thirds are the highest tell too little now and then.
    assert len(found) >= 0.8 * STUDIES_PER_CELL
    return table


@pytest.mark.parametrize("design", DESIGNS)
@pytest.mark.parametrize("name", POPULATIONS)
def test_m2_is_calibrated(name: str, design: str) -> None:
    found = calibration(name, design)
    for measure in ("bias", "gain", "relative_gain", "group_gain"):
        coverage, error = found[measure]
        assert coverage >= 0.94 - 2 * error, measure
    false = {"no gain": "group_excludes_0", "equal gains": "differ", "no differences": "differ"}
    if name in false:
        share, _ = found[false[name]]
        assert share <= 0.05 + 2 * np.sqrt(0.05 * 0.95 / STUDIES_PER_CELL)
