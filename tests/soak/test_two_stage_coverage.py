"""Coverage of M3's 95 % intervals, and how often the predictive checks reject true models."""

from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest

from analysis.sensitivity.predictive_checks import (
    PredictiveCheck,
    checked_ordinal,
    checked_two_stage,
)
from analysis.sensitivity.two_stage_model import TwoStageSensitivity, two_stage_sensitivity
from tests.analysis.sensitivity.noticing_people import NoticingPeople, noticing_study
from tests.analysis.sensitivity.people_of_other_kinds import own_people

STUDIES = 120
CEILING = NoticingPeople(bias=6.0)

pytestmark = pytest.mark.soak


def covered(seed: int) -> list[float]:
    study = noticing_study(CEILING, np.random.default_rng([30, seed]))
    found = two_stage_sensitivity(study.trials)
    assert isinstance(found, TwoStageSensitivity)
    pairs = [
        (np.array([line.gain_interval for line in found.ratings.lines.subjects]), study.gain),
        (np.array([entry.d_prime_interval for entry in found.detection]), study.d_prime),
        (np.array([entry.criterion_interval for entry in found.detection]), study.criterion),
    ]
    return [float(((ends[:, 0] <= true) & (true <= ends[:, 1])).mean()) for ends, true in pairs]


def rejected(seed: int) -> list[bool]:
    own = checked_ordinal(own_people(np.random.default_rng([31, seed]))).check
    study = noticing_study(CEILING, np.random.default_rng([32, seed]))
    checks = (own, checked_two_stage(study.trials).check)
    assert all(isinstance(check, PredictiveCheck) for check in checks)
    return [isinstance(check, PredictiveCheck) and check.refusal is not None for check in checks]


def test_people_who_notice_and_then_rate_are_covered() -> None:
    with ProcessPoolExecutor(2) as pool:
        shares = np.array(list(pool.map(covered, range(STUDIES))))
    mean, error = shares.mean(axis=0), shares.std(axis=0, ddof=1) / np.sqrt(STUDIES)
    print(f"\nM3, coverage of gain, d', criterion: {mean.round(3)}, each ± {error.round(3)}")
    assert (mean >= 0.93 - 2 * error).all()


def test_true_models_are_seldom_rejected() -> None:
    with ProcessPoolExecutor(2) as pool:
        shares = np.array(list(pool.map(rejected, range(STUDIES)))).mean(axis=0)
    print(f"\nrejected although true: M2 {shares[0]:.3f}, M3 {shares[1]:.3f}")
    assert (shares <= 0.05 + 2 * np.sqrt(0.05 * 0.95 / STUDIES)).all()
