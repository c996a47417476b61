"""The closed form of M1's largest likelihood, and the p that it gives a law's gain."""

from itertools import permutations

import numpy as np
import pytest

from analysis.estimates import FloatArray, NotEstimable
from analysis.sensitivity.ratings import Ratings
from analysis.trials.law_comparison import (
    LawLikelihood,
    assignment_p,
    law_likelihoods,
    shared_contrasts,
)

CONTRASTS = np.array([0.10, 0.25, 0.05, 0.40])


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
    found = law_likelihoods(ratings, {"law": contrast})["law"]
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


def test_where_contrasts_cannot_change_places_there_is_no_p() -> None:
    study = a_study(gain=2, gain_sd=1)
    own = study.contrast + 0.01 * study.subject
    reasons = {
        "has not the same contrast for everybody": assignment_p(study, own),
        "every condition equally often": assignment_p(
            study.where(np.arange(28) > 0), study.contrast[1:]
        ),
        "3 to 6 conditions, got 2": assignment_p(
            study.where(study.condition < 2), study.contrast[study.condition < 2]
        ),
    }
    for reason, found in reasons.items():
        assert isinstance(found, NotEstimable)
        assert reason in found.reason


def test_contrasts_are_shared_if_nobody_has_one_of_their_own() -> None:
    study = a_study(gain=2, gain_sd=1)
    assert shared_contrasts(study, study.contrast)
    assert shared_contrasts(study.where(np.arange(28) > 2), study.contrast[3:])
    assert not shared_contrasts(study, study.contrast + 0.01 * study.subject)
    assert not shared_contrasts(study.where(np.zeros(28, dtype=np.bool_)), np.zeros(0))
