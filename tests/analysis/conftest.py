"""Virtual studies of the extended design: five conditions at four levels, rated once each."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from analysis.estimates import FloatArray, ScoreTable
from analysis.trials import trial_statistics
from tests.analysis.sensitivity.simulated_raters import (
    VirtualPopulation,
    VirtualStudy,
    virtual_study,
)

# Predicted contrasts of the five conditions, and the multiples at which the design presents them.
CONTRASTS = np.array([0.10, 0.15, 0.25, 0.35, 0.05])
LEVELS = np.array([0.25, 0.6, 1.2, 2.0])


@pytest.fixture(autouse=True)
def fits_in_one_process() -> Iterator[None]:
    """Start no processes for fits, because other tests have the other cores."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(trial_statistics, "PROCESSES", 1)
        yield


@pytest.fixture(scope="session")
def extended_study() -> Callable[..., VirtualStudy]:
    def draw(population: VirtualPopulation, *, seed: int, subjects: int = 20) -> VirtualStudy:
        return virtual_study(
            population,
            subjects=subjects,
            condition=np.repeat(np.arange(5), len(LEVELS)),
            contrast=np.outer(CONTRASTS, LEVELS).ravel(),
            rng=np.random.default_rng(seed),
        )

    return draw


TABLE_4 = """
10  8 10 10 5
10 10 10  8 7
 8  8  8  7 4
10 10 10 10 8
 8  8 10  8 5
 8 10 10 10 7
 7 10  9  8 7
 7  8 10  7 8
 8  8 10  7 5
"""


@pytest.fixture
def published() -> ScoreTable:
    rows = [line.split() for line in TABLE_4.strip().splitlines()]
    return ScoreTable(
        subjects=tuple(f"S{number}" for number in range(1, 10)),
        conditions=("frequency", "structure", "voltage", "direction", "pressure"),
        scores=np.array(rows, dtype=np.float64),
    )


@pytest.fixture(scope="session")
def table_of() -> Callable[[FloatArray], ScoreTable]:
    def build(scores: FloatArray) -> ScoreTable:
        subjects, conditions = np.shape(scores)
        return ScoreTable(
            subjects=tuple(f"s{row}" for row in range(subjects)),
            conditions=tuple(f"c{column}" for column in range(conditions)),
            scores=np.asarray(scores, dtype=np.float64),
        )

    return build
