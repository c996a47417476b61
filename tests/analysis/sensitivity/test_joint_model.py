"""The joint model (M3): recovery of known detection, and the reasons it gives."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.estimates import IntArray, NotEstimable
from analysis.sensitivity.joint_model import JointSensitivity, joint_sensitivity
from analysis.sensitivity.ratings import Ratings
from tests.analysis.sensitivity.simulated_raters import (
    VirtualPopulation,
    VirtualStudy,
    virtual_study,
)

NOTICED, REVERSED, NOISE = 2.5, -0.5, 1.2
# Six catch trials, six of the opposite direction, twenty of the expected change.
CONTRAST = np.concatenate([np.zeros(6), np.repeat([-0.5, -1.0], 3), np.linspace(0.2, 2.0, 20)])


def a_study(seed: int, subjects: int = 12) -> tuple[VirtualStudy, Ratings, IntArray]:
    """A study that asks for a score only if the answer agrees."""
    study = virtual_study(
        VirtualPopulation(bias=1.0, discrepancy_sd=0.2, noise_sd=NOISE),
        subjects=subjects,
        condition=np.arange(len(CONTRAST)) % 4,
        contrast=CONTRAST,
        rng=np.random.default_rng(seed),
    )
    answer = np.where(study.latent > NOTICED, 1, np.where(study.latent < REVERSED, -1, 0))
    rating = np.where(answer == 1, study.ratings.rating, np.nan)
    return study, replace(study.ratings, rating=rating), answer.astype(np.int64)


def fit(ratings: Ratings, answer: IntArray) -> JointSensitivity:
    result = joint_sensitivity(ratings, answer)
    assert isinstance(result, JointSensitivity)
    return result


def test_detection_and_gain_are_recovered_and_covered() -> None:
    covered, errors = [], []
    for seed in range(8):
        study, ratings, answer = a_study(seed)
        result = fit(ratings, answer)
        d_prime = study.gain * result.reference_contrast / NOISE
        criterion = (NOTICED - study.bias) / NOISE
        for row, (found, line) in enumerate(
            zip(result.detection, result.ratings.lines.subjects, strict=True)
        ):
            pairs = [
                (found.d_prime_interval, d_prime[row]),
                (found.criterion_interval, criterion[row]),
                (line.gain_interval, study.gain[row]),
            ]
            covered.append([low <= truth <= high for (low, high), truth in pairs])
            errors.append(
                [found.d_prime - d_prime[row], found.criterion - criterion[row]],
            )
    assert (np.mean(covered, axis=0) > 0.9).all()
    assert (np.mean(covered, axis=0) < 0.99).all()
    assert np.abs(np.mean(errors, axis=0)).max() < 0.2


def test_false_alarms_agree_with_the_criterion() -> None:
    _, ratings, answer = a_study(1, subjects=80)
    result = fit(ratings, answer)
    from scipy.special import ndtr

    predicted = np.mean([ndtr(-found.criterion) for found in result.detection])
    observed = np.mean(answer[ratings.contrast == 0] == 1)
    assert predicted == pytest.approx(observed, abs=0.04)
    assert result.ratings.categories[:2] == ("opposite", "same")
    assert result.ratings.thresholds[:2] == pytest.approx((REVERSED, NOTICED), abs=0.4)


def test_withheld_scores_are_answers_and_narrow_the_gain() -> None:
    _, ratings, answer = a_study(3)
    whole = fit(ratings, answer)
    fewer = fit(ratings.where(ratings.contrast >= 0), answer[ratings.contrast >= 0])
    widths = [
        np.mean([np.diff(line.gain_interval)[0] for line in result.ratings.lines.subjects])
        for result in (whole, fewer)
    ]
    assert widths[0] < widths[1]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ("no catch", "no catch or opposite trials"),
        ("no signal", "no trial has an expected change"),
        ("always", "every answer was the expected change"),
        ("one rating", "at least 3 different ratings are needed, got 1"),
    ],
)
def test_designs_without_detection_give_the_reason(change: str, reason: str) -> None:
    _, ratings, answer = a_study(0)
    keep = np.ones(len(answer), dtype=np.bool_)
    if change == "no catch":
        keep = ratings.contrast > 0
    elif change == "no signal":
        keep = ratings.contrast <= 0
    elif change == "always":
        keep = answer == 1
    else:
        ratings = replace(ratings, rating=np.where(answer == 1, 7.0, np.nan))
    result = joint_sensitivity(ratings.where(keep), answer[keep])
    assert isinstance(result, NotEstimable)
    assert reason in result.reason


def test_invalid_answers_are_refused() -> None:
    _, ratings, answer = a_study(0)
    with pytest.raises(ValueError, match="an answer must be -1, 0 or 1, got 2"):
        joint_sensitivity(ratings, answer + 1)
    with pytest.raises(ValueError, match="answers must have 384 trials, got 3"):
        joint_sensitivity(ratings, answer[:3])
