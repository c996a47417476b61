"""Virtual studies of the extended design: five conditions at four levels, rated once each."""

from collections.abc import Callable

import numpy as np
import pytest

from analysis.sensitivity.virtual import VirtualPopulation, VirtualStudy, virtual_study

# Predicted contrasts of the five conditions, and the multiples at which the design presents them.
CONTRASTS = np.array([0.10, 0.15, 0.25, 0.35, 0.05])
LEVELS = np.array([0.25, 0.6, 1.2, 2.0])


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
