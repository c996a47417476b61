"""Exported columns of measured friction: filled where touches were recorded, else missing."""

from functools import cache

import numpy as np

from analysis.export.dataset import Dataset, dataset
from tests.analysis.friction.recorded_sessions import recorded_cohort
from tests.analysis.reports import PAPER, cohort

SKIPPED = 3


@cache
def recorded() -> Dataset:
    chains, _ = recorded_cohort(PAPER, 2, skipped=SKIPPED)
    return dataset(chains, PAPER, "0", rehearsals=False)


def test_trials_have_their_contrast_and_touches_their_measures() -> None:
    trials = recorded().trials
    scored = trials["trial_kind"].eq("trial")
    known = trials["measured_contrast"].notna()
    skipped = trials["trial_index"].eq(SKIPPED)
    assert (known | skipped)[scored].all()
    assert not known[skipped].any()
    assert trials["measured_contrast_error"][known & scored].between(0.005, 0.05).all()
    for friction, errors in zip(trials["friction"], trials["friction_error"], strict=True):
        for value, error in zip(friction, errors, strict=True):
            assert value is None or (0.05 < value < 1.5 and 0 < error < 0.05 * value)


def test_without_recordings_the_columns_are_missing() -> None:
    trials = dataset(cohort(PAPER, 1), PAPER, "0", rehearsals=False).trials
    assert trials["measured_contrast"].isna().all()
    assert all(value is None for values in trials["friction"] for value in values)
    assert np.isfinite(trials["touches"].astype(float)).all()
