"""Fits of large studies: laws in processes of their own, and components that are known well."""

from types import SimpleNamespace

import numpy as np
import pytest

from analysis.sensitivity.laplace import LARGE
from analysis.sensitivity.latent_posterior import LARGE_EFFECTIVE, MODE_TRIALS
from analysis.sensitivity.rating_stage import Beside, RatingStage, rating_stage
from analysis.trials import trial_statistics
from analysis.trials.trial_statistics import TrialStatistics
from tests.analysis.reports import study_report
from tests.analysis.sensitivity.simulated_raters import VirtualPopulation, virtual_study


def test_laws_that_processes_compare_have_the_same_evidence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    given = study_report()
    one, other = (TrialStatistics(data=given.loaded, study=given.study) for _ in range(2))
    expected = one.evidence
    monkeypatch.setattr(trial_statistics, "laplace", SimpleNamespace(LARGE=1))
    monkeypatch.setattr(trial_statistics, "PROCESSES", 2)
    assert other.evidence == expected
    assert list(other.evidence) == list(expected)


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
    stage = rating_stage(ratings, Beside())
    assert isinstance(stage, RatingStage), stage
    assert len(stage.ready.trials.x) > least
    points = stage.posterior.points
    assert points.effective >= LARGE_EFFECTIVE
    unit = stage.ready.axes.y_sd / stage.ready.axes.x_sd
    low, high = points.quantiles(lambda at: unit * np.exp(at[:, 2]), 0.025, 0.975)
    assert low < 2.0 < high < apart * low
    assert low < stage.gain_sd_upper < high
