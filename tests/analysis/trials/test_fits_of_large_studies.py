"""Fits of large studies, which processes of their own make."""

from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import pytest

from analysis.sensitivity.laplace import LARGE
from analysis.sensitivity.latent_posterior import LARGE_EFFECTIVE, MODE_TRIALS
from analysis.sensitivity.ordinal_model import (
    OrdinalSensitivity,
    PreparedTrials,
    ordinal_sensitivity,
    prepared_ratings,
)
from analysis.trials import trial_statistics
from analysis.trials.trial_statistics import LINKS, TrialStatistics
from tests.analysis.reports import study_report
from tests.analysis.sensitivity.simulated_raters import VirtualPopulation, virtual_study


@pytest.mark.parametrize("models", [("M3", *LINKS, "M2 at places"), LINKS])
def test_fits_that_processes_make_ahead_are_taken_and_have_the_same_numbers(
    models: Sequence[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trial_statistics, "laplace", SimpleNamespace(LARGE=1))
    monkeypatch.setattr(trial_statistics, "FEWEST_AT_PLACES", 1)
    monkeypatch.setattr(trial_statistics, "PROCESSES", 2)
    given = study_report()
    ahead, anew = (TrialStatistics(data=given.loaded, study=given.study) for _ in range(2))
    ahead.fit_ahead(models)
    names = {"_m2", "_m3", "ordinal", "place_m2"} if "M3" in models else {"_m2", "ordinal"}
    assert names <= vars(ahead).keys()
    for name in names:
        assert repr(vars(ahead)[name]) == repr(getattr(anew, name))


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
