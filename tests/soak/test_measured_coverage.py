"""Errors of measured contrasts, and coverage of gains on them, over hundreds of sessions.

One part: `pytest -m soak -s tests/soak/test_measured_coverage.py -k contrasts`.
"""

from concurrent.futures import ProcessPoolExecutor
from dataclasses import astuple, fields
from functools import cache, partial
from itertools import repeat

import numpy as np
import pytest

from analysis.estimates import FloatArray
from tests.analysis.friction.measured_gains import GainMeasures, gain_measures, rated
from tests.analysis.friction.recorded_sessions import MeasuredStudy, measured_study
from tests.analysis.friction.simulated_touches import Sensor
from tests.analysis.reports import EXTENDED, PAPER

DESIGNS = {"paper": PAPER, "extended": EXTENDED}
STUDIES, PEOPLE = 25, 20
TARGET, Z95 = 0.01, 1.96
REQUIRED, ROUGH = Sensor(), Sensor(jitter_sd=0.2)

pytestmark = pytest.mark.soak


@cache
def studies(sensor: Sensor, design: str = "extended") -> tuple[MeasuredStudy, ...]:
    one = partial(measured_study, DESIGNS[design], PEOPLE, sensor=sensor)
    with ProcessPoolExecutor(2) as pool:
        return tuple(pool.map(_called, repeat(one), range(STUDIES)))


def _called(one: "partial[MeasuredStudy]", seed: int) -> MeasuredStudy:
    return one(seed=seed)


def rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize("design", ["paper", "extended"])
def test_measured_contrasts_are_true_to_a_hundredth_and_errors_are_honest(design: str) -> None:
    rows, names = [], []
    for study in studies(REQUIRED, design):
        found, of = study.found, study.scored
        alone, best = found.value - study.true, found.best - study.true
        rows.append(np.array([alone, alone / found.error, best, best / found.best_error])[:, of])
        names.append(study.data.trials["condition"].to_numpy()[of])
    table, name = np.hstack(rows), np.concatenate(names)
    print(f"\n{STUDIES * PEOPLE} sessions, {len(name)} trials: one alone, then the best estimate")
    for condition in np.unique(name):
        for error, score in table[:, name == condition].reshape(2, 2, -1):
            held = np.abs(score) < Z95
            print(
                f"{condition}: RMS error {rms(error):.4f}, bias {error.mean():+.4f}, "
                f"error over standard error {rms(score):.2f}, covered {held.mean():.3f}"
            )
            chance = 2 * held.std() / np.sqrt(len(held))
            assert 0.93 - chance <= held.mean() <= 0.99, condition
            assert abs(error.mean()) <= 0.002 + 2 * error.std() / np.sqrt(len(error)), condition
    assert rms(table[2]) <= TARGET


def draw(study: MeasuredStudy, gain_sd: float, seed: int) -> dict[str, GainMeasures | None]:
    ratings, gain = rated(study, gain_sd, np.random.default_rng([5, seed]))
    contrasts = {
        "measured": study.found.best[study.scored],
        "predicted": study.predicted[study.scored],
    }
    return {kind: gain_measures(ratings, of, gain) for kind, of in contrasts.items()}


def coverage(
    sensor: Sensor, gain_sd: float, design: str
) -> dict[str, dict[str, tuple[float, float]]]:
    """Return each measure's mean over draws, with its Monte Carlo error, by kind of contrast."""
    with ProcessPoolExecutor(2) as pool:
        jobs = [
            pool.submit(draw, study, gain_sd, 100 * number)
            for number, study in enumerate(studies(sensor, design))
        ]
        found = [job.result() for job in jobs]
    table = {}
    for kind in found[0]:
        fits = [fit for one in found if (fit := one[kind]) is not None]
        rows = np.array([astuple(fit) for fit in fits])
        errors = rows.std(axis=0) / np.sqrt(len(rows))
        names = [measure.name for measure in fields(GainMeasures)]
        table[kind] = dict(zip(names, zip(rows.mean(axis=0), errors, strict=True), strict=True))
        shown = ", ".join(f"{name} {m:.3f} ± {e:.3f}" for name, (m, e) in table[kind].items())
        print(f"\n{design}, {kind} contrasts, spread {gain_sd:g}, {len(rows)} fits: {shown}")
    return table


@pytest.mark.parametrize("design", DESIGNS)
@pytest.mark.parametrize("gain_sd", [0.0, 2.0])
@pytest.mark.parametrize("sensor", [REQUIRED, ROUGH], ids=["as required", "rough"])
def test_intervals_on_measured_contrasts_hold_gains(
    sensor: Sensor, gain_sd: float, design: str
) -> None:
    found = coverage(sensor, gain_sd, design)["measured"]
    covered, error = found["gain"]
    assert covered >= 0.93 - 2 * error
    if not gain_sd:
        share, error = found["claimed"]
        assert share <= 0.05 + 2 * max(error, np.sqrt(0.05 * 0.95 / STUDIES))
