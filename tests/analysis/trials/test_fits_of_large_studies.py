"""Fits of large studies, which processes of their own make."""

from functools import partial

import numpy as np
import pytest

from analysis.kept import Kept
from analysis.sensitivity.laplace import LARGE
from analysis.sensitivity.latent_posterior import LARGE_EFFECTIVE, MODE_TRIALS
from analysis.sensitivity.linear_model import linear_sensitivity
from analysis.sensitivity.ordinal_model import (
    OrdinalSensitivity,
    PreparedTrials,
    ordinal_sensitivity,
    prepared_ratings,
)
from tests.analysis.sensitivity.people_of_other_kinds import own_people
from tests.analysis.sensitivity.simulated_raters import VirtualPopulation, virtual_study


def test_fits_that_others_made_ahead_are_taken_and_have_the_same_numbers() -> None:
    keep, ratings = Kept(), own_people(np.random.default_rng(1))
    keep.ahead([[partial(linear_sensitivity, ratings)]], 2)

    def never() -> None:
        raise AssertionError("it is known")

    found = keep.made(never, linear_sensitivity, (ratings,), {})
    assert repr(found) == repr(linear_sensitivity(ratings))


@pytest.mark.parametrize(
    ("subjects", "conditions", "seed", "least", "apart"),
    [(800, 5, 1, LARGE, 1.2), (300, 4, 2, MODE_TRIALS, 1.3)],
)
def test_a_large_study_has_sensitivities(
    subjects: int, conditions: int, seed: int, least: int, apart: float
) -> None:
    """Its standard deviations are so certain that a fixed step to their mode misses it."""
    people = VirtualPopulation(bias=4, gain=5, gain_sd=2, discrepancy_sd=0.3, noise_sd=1)
    condition, contrast = np.arange(20) % conditions, np.linspace(0.1, 0.7, conditions)
    ratings = virtual_study(
        people,
        subjects=subjects,
        condition=condition,
        contrast=contrast[condition],
        rng=np.random.default_rng(seed),
    ).ratings
    prepared = prepared_ratings(ratings)
    assert isinstance(prepared, PreparedTrials)
    assert len(prepared.trials.x) > least
    fit = ordinal_sensitivity(ratings)
    assert isinstance(fit, OrdinalSensitivity), fit
    assert fit.effective_points >= LARGE_EFFECTIVE
    low, high = fit.lines.gain_sd_interval
    assert low < 2.0 < high < apart * low
