"""The closed form of M1's largest likelihood, and the p that it gives a law's gain."""

from itertools import permutations

import numpy as np
import pytest

from analysis.estimates import FloatArray, NotEstimable
from analysis.sensitivity.lines import Ratings
from analysis.trials.law_likelihood import (
    LawLikelihood,
    PredictionError,
    assignment_p,
    law_likelihoods,
    prediction_error,
    shared_contrasts,
)

CONTRASTS = np.array([0.10, 0.25, 0.05, 0.40])
SCALE = (-100.0, 100.0)


def a_study(
    *, gain: float, gain_sd: float, noise: float = 1.0, repeats: int = 1, seed: int = 1
) -> Ratings:
    """Seven subjects who rated four conditions, each equally often."""
    rng = np.random.default_rng(seed)
    subject = np.repeat(np.arange(7), 4 * repeats)
    condition = np.tile(np.arange(4), 7 * repeats)
    slopes = rng.normal(gain, gain_sd, 7)[subject]
    level = rng.normal(5, 1, 7)[subject]
    rating = level + slopes * CONTRASTS[condition] + rng.normal(0, noise, len(subject))
    return Ratings(
        subjects=tuple("abcdefg"),
        conditions=tuple("wxyz"),
        subject=subject,
        condition=condition,
        contrast=CONTRASTS[condition],
        rating=rating,
    )


def gain(ratings: Ratings, contrast: FloatArray) -> float:
    found = law_likelihoods(ratings, {"law": contrast}, SCALE)["law"]
    assert isinstance(found, LawLikelihood)
    return found.gain_over_none


@pytest.mark.parametrize(
    "study",
    [
        # A large spread of slopes, none at all, and levels that differ less than chance makes them.
        a_study(gain=8, gain_sd=6, repeats=2),
        a_study(gain=0, gain_sd=0, repeats=2, seed=3),
        a_study(gain=4, gain_sd=0, noise=3, seed=5),
    ],
)
def test_the_closed_form_orders_assignments_as_the_fitted_likelihood_does(study: Ratings) -> None:
    study = study.where(study.condition < 3)
    orders = permutations(CONTRASTS[:3])
    gains = np.array([gain(study, np.array(x)[study.condition]) for x in orders])
    found = assignment_p(study, study.contrast)
    assert found == pytest.approx(float((gains >= gains[0] - 1e-4).mean()), abs=1e-12)


def test_a_gain_that_any_contrasts_would_give_has_a_large_p() -> None:
    noise = a_study(gain=0, gain_sd=0, noise=2)
    found = [assignment_p(noise, np.array(x)[noise.condition]) for x in permutations(CONTRASTS)]
    p = [share for share in found if isinstance(share, float)]
    # Over all assignments p is uniform: each is as extreme as its rank says.
    assert sorted(p) == pytest.approx(np.arange(1, 25) / 24)


def explained(trials: Ratings, contrast: FloatArray) -> float:
    """Squares that a common slope takes from a regression on subjects, from the trials."""
    levels = (trials.subject[:, None] == np.arange(7)).astype(np.float64)
    squares = []
    for design in (levels, np.column_stack([levels, contrast])):
        fitted = design @ np.linalg.lstsq(design, trials.rating)[0]
        squares.append(float(((trials.rating - fitted) ** 2).sum()))
    return squares[0] - squares[1]


def test_with_scores_missing_p_is_over_what_a_common_slope_explains() -> None:
    trials = a_study(gain=5, gain_sd=2).where(np.arange(28) % 9 > 0)
    assigned = np.array(list(permutations(CONTRASTS)))
    found = np.array([explained(trials, x[trials.condition]) for x in assigned])
    expected = float((found >= found[0] - 1e-9).mean())
    assert assignment_p(trials, trials.contrast) == pytest.approx(expected, abs=1e-12)
    assert 1 / 24 <= expected < 1


def test_measured_contrasts_change_places_subject_by_subject() -> None:
    study = a_study(gain=5, gain_sd=2)
    own = study.contrast + 0.01 * study.subject * (1 + study.condition)
    table = own.reshape(7, 4)
    orders = [list(order) for order in permutations(range(4))]
    found = np.array([explained(study, table[:, order].ravel()) for order in orders])
    expected = float((found >= found[0] - 1e-9).mean())
    assert assignment_p(study, own) == pytest.approx(expected, abs=1e-12)


def test_p_with_scores_missing_is_uniform_without_an_effect() -> None:
    low = 0
    for seed in range(400):
        trials = a_study(gain=0, gain_sd=0, seed=seed).where(np.arange(28) % 9 > 0)
        p = assignment_p(trials, trials.contrast)
        assert isinstance(p, float)
        low += p <= 0.25
    assert 70 <= low <= 130


def test_each_condition_is_predicted_from_the_others() -> None:
    trials = a_study(gain=5, gain_sd=2, repeats=2).where(np.arange(56) % 9 > 0)
    levels = (trials.subject[:, None] == np.arange(7)).astype(np.float64)
    design, errors = np.column_stack([levels, trials.contrast]), []
    for condition in range(4):
        left = trials.condition == condition
        fits = [np.linalg.lstsq(d[~left], trials.rating[~left])[0] for d in (design, levels)]
        errors.append(
            [
                (trials.rating - d @ b)[left].mean()
                for d, b in zip((design, levels), fits, strict=True)
            ]
        )
    expected = np.sqrt((np.array(errors) ** 2).mean(axis=0))
    found = prediction_error(trials, trials.contrast, SCALE)
    assert isinstance(found, PredictionError)
    assert (found.with_law, found.without) == pytest.approx(tuple(expected), rel=1e-9)
    assert found.outside_scale == ()


def test_a_prediction_far_beyond_the_scale_counts_as_its_end() -> None:
    study = a_study(gain=0, gain_sd=0, noise=0.1)
    far = np.array([0.0, 0.0005, 0.001, 0.6])[study.condition]
    without_bounds, bounded = (
        prediction_error(study, far, scale) for scale in ((-1e9, 1e9), (0.0, 10.0))
    )
    assert isinstance(without_bounds, PredictionError)
    assert isinstance(bounded, PredictionError)
    assert without_bounds.with_law > 10 > bounded.with_law > bounded.without
    assert bounded.outside_scale == ("z",)
    assert bounded.without == without_bounds.without


def test_two_conditions_give_the_reason() -> None:
    study = a_study(gain=2, gain_sd=1)
    two = study.where(study.condition < 2)
    for reason, found in {
        "3 to 6 conditions, got 2": assignment_p(two, two.contrast),
        "from at least 2 others, got 1": prediction_error(two, two.contrast, SCALE),
    }.items():
        assert isinstance(found, NotEstimable)
        assert reason in found.reason


def test_contrasts_are_shared_if_nobody_has_one_of_their_own() -> None:
    study = a_study(gain=2, gain_sd=1)
    assert shared_contrasts(study, study.contrast)
    assert shared_contrasts(study.where(np.arange(28) > 2), study.contrast[3:])
    assert not shared_contrasts(study, study.contrast + 0.01 * study.subject)
    assert not shared_contrasts(study.where(np.zeros(28, dtype=np.bool_)), np.zeros(0))
