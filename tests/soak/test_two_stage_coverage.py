"""Coverage of M3's 95% intervals, and how often the predictive checks reject true models.

One cell: `pytest -m soak -s tests/soak/test_two_stage_coverage.py -k "ceiling and 9x5x4"`.
"""

from concurrent.futures import ProcessPoolExecutor
from itertools import repeat

import numpy as np
import pytest

from analysis.sensitivity.predictive_checks import (
    PredictiveCheck,
    checked_ordinal,
    checked_two_stage,
)
from analysis.sensitivity.two_stage_model import TwoStageSensitivity
from tests.analysis.sensitivity.noticing_people import (
    NoticingPeople,
    noticing_study,
    two_stage_sensitivity,
)
from tests.analysis.sensitivity.people_of_other_kinds import own_people

STUDIES = 200
CEILING = NoticingPeople(bias=6.0)
SPREADS = ("noise_spread", "criterion_spread", "bias_sd", "gain_sd")
PEOPLE = {"middle": 4.5, "ceiling": 6.0, "no differences": 4.5}
# Subjects, and repeats of each condition, one of them in the opposite order.
DESIGNS = {"9x5x2": (9, 2), "9x5x4": (9, 4), "20x5x8": (20, 8)}

pytestmark = pytest.mark.soak


def covered(name: str, design: str, seed: int) -> list[float]:
    """The share of subjects whose gain, d′ and criterion are covered, and d′ over the true one."""
    subjects, repeats = DESIGNS[design]
    spread = {} if name != "no differences" else dict.fromkeys(SPREADS, 0.0)
    people = NoticingPeople(subjects=subjects, bias=PEOPLE[name], **spread)
    study = noticing_study(people, np.random.default_rng([30, seed]), repeats=repeats)
    found = two_stage_sensitivity(study.trials)
    assert isinstance(found, TwoStageSensitivity)
    pairs = [
        (np.array([line.gain_interval for line in found.ratings.lines.subjects]), study.gain),
        (np.array([entry.d_prime_interval for entry in found.detection]), study.d_prime),
        (np.array([entry.criterion_interval for entry in found.detection]), study.criterion),
    ]
    shares = [float(((ends[:, 0] <= true) & (true <= ends[:, 1])).mean()) for ends, true in pairs]
    d_prime = np.mean([entry.d_prime for entry in found.detection])
    return [*shares, float(d_prime / study.d_prime.mean())]


def rejected(seed: int) -> list[bool]:
    own = checked_ordinal(own_people(np.random.default_rng([31, seed]))).check
    study = noticing_study(CEILING, np.random.default_rng([32, seed]))
    checks = (own, checked_two_stage(study.trials).check)
    assert all(isinstance(check, PredictiveCheck) for check in checks)
    return [isinstance(check, PredictiveCheck) and check.refusal is not None for check in checks]


@pytest.mark.parametrize("design", DESIGNS)
@pytest.mark.parametrize("name", PEOPLE)
def test_people_who_notice_and_then_rate_are_covered(name: str, design: str) -> None:
    with ProcessPoolExecutor(2) as pool:
        rows = pool.map(covered, repeat(name), repeat(design), range(STUDIES), chunksize=10)
        shares = np.array(list(rows))
    mean, error = shares.mean(axis=0), shares.std(axis=0, ddof=1) / np.sqrt(STUDIES)
    print(f"\nM3, {design}, {name}: coverage of gain, d', criterion {mean[:3].round(3)}, ", end="")
    print(f"d' over the true one {mean[3]:.3f}, each ± {error.round(3)}")
    assert (mean[:3] >= 0.93 - 2 * error[:3]).all()


def test_true_models_are_seldom_rejected() -> None:
    with ProcessPoolExecutor(2) as pool:
        shares = np.array(list(pool.map(rejected, range(STUDIES)))).mean(axis=0)
    print(f"\nrejected although true: M2 {shares[0]:.3f}, M3 {shares[1]:.3f}")
    assert (shares <= 0.05 + 2 * np.sqrt(0.05 * 0.95 / STUDIES)).all()
