"""How well laws explain who felt what."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from analysis.estimates import FloatArray, NotEstimable
from analysis.sensitivity.lines import Ratings
from analysis.trials.law_likelihood import LawLikelihood, law_likelihoods
from tests.analysis.sensitivity.simulated_raters import VirtualPopulation, VirtualStudy

StudyOf = Callable[..., VirtualStudy]
SCALE = (0.0, 10.0)
OPEN = VirtualPopulation(bias=3.0, gain=9.0, gain_sd=3.0, scale=None)


def likelihood(ratings: Ratings, contrast: FloatArray) -> LawLikelihood:
    result = law_likelihoods(ratings, {"law": contrast}, SCALE)["law"]
    assert isinstance(result, LawLikelihood)
    return result


def test_the_law_people_follow_is_the_likeliest(extended_study: StudyOf) -> None:
    ratings = extended_study(OPEN, seed=1).ratings
    rng = np.random.default_rng(2)
    laws = {
        "true": ratings.contrast,
        "flawed": ratings.contrast + rng.normal(0.0, 0.05, len(ratings.contrast)),
        "unrelated": rng.permutation(ratings.contrast),
        "silent": np.full(len(ratings.contrast), 0.2),
    }
    found = law_likelihoods(ratings, laws, SCALE)
    assert isinstance(found["silent"], NotEstimable)
    known = [found[name] for name in ("true", "flawed", "unrelated")]
    values = [law.log_likelihood for law in known if isinstance(law, LawLikelihood)]
    assert values == sorted(values, reverse=True)
    assert len(values) == 3
    assert isinstance(known[2], LawLikelihood)
    assert 0 <= known[2].gain_over_none < 6


def test_the_likelihood_is_a_maximum(extended_study: StudyOf) -> None:
    ratings = extended_study(OPEN, seed=3, subjects=6).ratings
    best = likelihood(ratings, ratings.contrast).log_likelihood
    design = np.stack([np.ones(len(ratings.rating)), ratings.contrast], axis=1)
    same = ratings.subject[:, None] == ratings.subject
    for bias_sd, gain_sd, noise_sd in [(1.0, 3.0, 1.2), (0.8, 2.5, 1.15), (1.2, 3.5, 1.25)]:
        spread = np.diag([bias_sd**2, gain_sd**2])
        covariance = same * (design @ spread @ design.T) + noise_sd**2 * np.eye(len(design))
        inverse = np.linalg.inv(covariance)
        line = np.linalg.solve(design.T @ inverse @ design, design.T @ inverse @ ratings.rating)
        value = stats.multivariate_normal(design @ line, covariance).logpdf(ratings.rating)
        assert best - 12 < value < best + 1e-6


def test_units_of_a_law_do_not_matter(extended_study: StudyOf) -> None:
    ratings = extended_study(OPEN, seed=4, subjects=8).ratings
    one = likelihood(ratings, ratings.contrast)
    other = likelihood(replace(ratings), 40 * ratings.contrast - 3)
    assert other.log_likelihood == pytest.approx(one.log_likelihood, abs=1e-4)
    assert one.gain_over_none > 10


@pytest.mark.parametrize(
    "scores",
    [
        [[7, 4, 7, 8, 10]],
        [[3, 7, 8, 9, 9], [6, 6, 10, 6, 10], [5, 5, 5, 8, 10]],
        [[9, 10, 8, 6, 8]] * 2,
    ],
)
def test_rounding_of_the_contrasts_does_not_move_the_maximum(scores: list[list[int]]) -> None:
    people = len(scores)
    ratings = Ratings(
        subjects=tuple(map(str, range(people))),
        conditions=tuple("abcde"),
        subject=np.repeat(np.arange(people), 5),
        condition=np.tile(np.arange(5), people),
        contrast=np.zeros(5 * people),
        rating=np.ravel(scores).astype(float),
    )
    contrast = np.tile([0.1, 0.05, 0.35, 0.3, 0.06], people)
    expected = likelihood(ratings, contrast).log_likelihood
    for seed in range(4):
        nudge = 1 + 1e-13 * np.random.default_rng(seed).normal(size=5)
        found = likelihood(ratings, contrast * np.tile(nudge, people))
        assert found.log_likelihood == pytest.approx(expected, abs=1e-10, rel=0)


def test_contrasts_must_be_as_many_as_trials(extended_study: StudyOf) -> None:
    ratings = extended_study(OPEN, seed=1, subjects=2).ratings
    with pytest.raises(ValueError, match="coulomb needs 40 contrasts, got 3"):
        law_likelihoods(ratings, {"coulomb": np.zeros(3)}, SCALE)


def test_ratings_on_lines_have_no_likelihood() -> None:
    """It grows without end as the noise falls: what a search came to depended on the processor."""
    ratings = Ratings(
        subjects=("a", "b"),
        conditions=("voltage", "pressure"),
        subject=np.array([0, 0, 1, 1]),
        condition=np.array([0, 1, 0, 1]),
        contrast=np.array([0.4, 0.1, 0.4, 0.1]),
        rating=np.array([7.0, 3.0, 9.0, 2.0]),
    )
    found = law_likelihoods(ratings, {"law": ratings.contrast}, SCALE)["law"]
    assert isinstance(found, NotEstimable)
    assert "lie exactly on a line" in found.reason
