"""Coverage of 95% intervals of ratings and of answers over hundreds of studies of each kind.

One cell: `pytest -m soak -s tests/soak/test_sensitivity_coverage.py -k "calibrated and 9x5x1 and
ceiling"`.
"""

from concurrent.futures import ProcessPoolExecutor
from dataclasses import fields, replace
from itertools import repeat

import numpy as np
import pytest

from analysis.estimates import FloatArray
from analysis.sensitivity.answers_model import answers_model
from analysis.sensitivity.lines import Ratings
from analysis.sensitivity.noticing_stage import NoticingStage
from analysis.sensitivity.rating_stage import Beside, RatingStage, rating_stage
from device.friction.changes import CONDITIONS, predicted_contrast
from tests.analysis.sensitivity.answering_people import MEAN_GAIN, NOISE, answered_study
from tests.analysis.sensitivity.calibration import (
    DESIGNS,
    EVEN,
    POPULATIONS,
    Measures,
    held,
    measured,
    width,
)
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

CEILING = VirtualPopulation(bias=6.0, gain=10.0, gain_sd=3.0, discrepancy_sd=0.5)

Task = tuple[VirtualPopulation, FloatArray, int, int]

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


def coverage_of(task: Task) -> list[float]:
    """Coverage of bias and gain, mean and RMS error of gain, width, tens."""
    study = drawn(*task)
    fit = rating_stage(study.ratings, Beside())
    assert isinstance(fit, RatingStage)
    gains = fit.of_subjects("gain")
    error = np.array([gain.value for gain in gains]) - study.gain
    return [
        held(fit.of_subjects("bias"), study.bias + study.discrepancy.mean()),
        held(gains, study.gain),
        float(error.mean()),
        float((error**2).mean()),
        width(gains),
        float((study.ratings.rating == 10).mean()),
    ]


def over_studies(
    name: str, population: VirtualPopulation, contrast: FloatArray, subjects: int
) -> list[float]:
    tasks: list[Task] = [(population, contrast, subjects, s) for s in range(STUDIES)]
    with ProcessPoolExecutor(2) as pool:
        rows = np.array(list(pool.map(coverage_of, tasks, chunksize=25)))
    bias, gain, error, square, wide, tens = rows.mean(axis=0)
    print(
        f"\n{name}: coverage of bias {bias:.4f}, of gain {gain:.4f}; gain error {error:+.3f} on "
        f"average, {np.sqrt(square):.3f} RMS, interval {wide:.2f} wide; {tens:.0%} tens"
    )
    return [float(bias), float(gain), float(error)]


def test_lines_with_a_ceiling_are_covered() -> None:
    bias, gain, error = over_studies("extended, ceiling", CEILING, EXTENDED, 20)
    assert 0.92 < bias < 0.98
    assert 0.92 < gain < 0.98
    assert abs(error) < 1.0


def test_one_rating_per_cell_covers() -> None:
    assert over_studies("paper's design, ceiling", CEILING, ONCE, 9)[1] > 0.9


def calibration(name: str, design: str) -> dict[str, tuple[float, float]]:
    """Return the mean of each measure with its Monte Carlo error, that of the mean over studies."""
    seeds = range(STUDIES_PER_CELL)
    with ProcessPoolExecutor(2) as pool:
        studies = pool.map(measured, repeat(name), repeat(design), seeds, chunksize=10)
        found = [one for one in studies if isinstance(one, Measures)]
    table = {}
    for measure in fields(Measures):
        values = np.array([getattr(one, measure.name) for one in found])
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
def test_ratings_are_calibrated(name: str, design: str) -> None:
    found = calibration(name, design)
    for measure in ("bias", "gain", "relative_gain", "group_gain"):
        coverage, error = found[measure]
        assert coverage >= 0.94 - 2 * error, measure
    false = {"no gain": "group_excludes_0", "equal gains": "differ", "no differences": "differ"}
    if name in false:
        share, _ = found[false[name]]
        assert share <= 0.05 + 2 * np.sqrt(0.05 * 0.95 / STUDIES_PER_CELL)


# People who perceive alike, whose skins differ.
SKIN_STUDIES, PEOPLE, GAIN, MEASURED_ERROR = 100, 20, 8.0, 0.009
NAMES = ("frequency", "structure", "voltage", "direction", "pressure")


def of_skins(skin_sd: float, seed: int) -> list[float]:
    """Return coverage of gains, and their SD over the group's gain.

    On predicted contrasts, and then on measured ones.
    """
    rng = np.random.default_rng([77, seed])
    skin = np.exp(rng.normal(0, skin_sd, PEOPLE))
    levels = [0.25, 0.6, 1.2, 2.0]
    once = np.outer([predicted_contrast(CONDITIONS[name]) for name in NAMES], levels).ravel()
    subject, predicted = np.repeat(np.arange(PEOPLE), len(once)), np.tile(once, PEOPLE)
    felt = skin[subject] * predicted
    latent = rng.normal(4, 1, PEOPLE)[subject] + GAIN * felt + rng.normal(0, 1, len(felt))
    ratings = Ratings(
        subjects=tuple(f"s{number}" for number in range(PEOPLE)),
        conditions=NAMES,
        subject=subject,
        condition=np.tile(np.repeat(np.arange(5), len(levels)), PEOPLE),
        contrast=predicted,
        rating=np.searchsorted(EVEN, latent).astype(np.float64),
    )
    found = []
    for contrast in (predicted, felt + rng.normal(0, MEASURED_ERROR, len(felt))):
        fit = rating_stage(replace(ratings, contrast=contrast), Beside())
        assert isinstance(fit, RatingStage)
        (spread,) = fit.posterior.points.quantiles(lambda at: np.exp(at[:, 2]), 0.5)
        spread *= fit.ready.axes.y_sd / fit.ready.axes.x_sd
        found += [held(fit.of_subjects("gain"), GAIN), spread / fit.of_group("gain").value]
    return found


@pytest.mark.parametrize("skin_sd", [0.20, 0.35])
def test_gains_on_predicted_contrasts_mix_skin_with_perception(skin_sd: float) -> None:
    """The numbers of `SKIN` in the report."""
    with ProcessPoolExecutor(2) as pool:
        rows = np.array(list(pool.map(of_skins, repeat(skin_sd), range(SKIN_STUDIES))))
    covered, spread, covered_measured, spread_measured = rows.mean(axis=0)
    print(
        f"\nskins of SD {skin_sd}: on predicted contrasts {covered:.2f} of gains covered, spread "
    )
    print(
        f"{spread:.2f} of the gain; on measured ones {covered_measured:.2f}, {spread_measured:.2f}"
    )
    assert covered_measured >= 0.93
    assert spread > 2 * spread_measured


# People who notice a change first.

ANSWERED = 100


def of_answers(subjects: int, repeats: int, seed: int) -> list[float]:
    """Return coverage of criteria, d, gains, relative gains, and the group's gain."""
    study = answered_study(1000 + seed, subjects, repeats)
    model = answers_model(study.answers)
    first, second = model.noticing, model.rating
    assert isinstance(first, NoticingStage)
    if not isinstance(second, RatingStage):
        return [np.nan] * 5
    d = np.full(subjects, first.answered.unit / NOISE)
    return [
        held(first.criteria[:-1], study.criterion),
        held(first.slopes[:-1], d),
        held(second.of_subjects("gain"), study.gain),
        held(second.of_subjects("relative gain"), study.gain - study.gain.mean()),
        held([second.of_group("gain")], MEAN_GAIN),
    ]


@pytest.mark.parametrize(("subjects", "repeats"), [(9, 3), (9, 8), (20, 12)])
def test_people_who_notice_and_then_rate_are_covered(subjects: int, repeats: int) -> None:
    tasks = repeat(subjects), repeat(repeats), range(ANSWERED)
    with ProcessPoolExecutor(2) as pool:
        rows = np.array(list(pool.map(of_answers, *tasks, chunksize=10)))
    known = np.isfinite(rows[:, 0])
    assert known.mean() >= 0.9
    mean, error = rows[known].mean(axis=0), rows[known].std(axis=0, ddof=1) / np.sqrt(known.sum())
    print(
        f"\n{subjects} people x 6 x {repeats}, {known.sum()} studies: coverage of criterion, d, "
        f"gain, relative gain and the group's gain {mean.round(3)}, each ± {error.round(3)}"
    )
    assert (mean >= 0.93 - 2 * error).all()
