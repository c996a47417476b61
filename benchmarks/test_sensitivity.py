"""What M2, the ordinal model of the report, costs beside a maximum without people or intervals."""

from time import process_time

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from scipy.optimize import minimize
from scipy.special import ndtr

from analysis.estimates import FloatArray
from analysis.sensitivity.lines import Ratings
from analysis.sensitivity.ordinal_model import ordinal_lines
from benchmarks.compared import compare

CONDITIONS = 5
PEER = "scipy's BFGS of an ordinal model without people, without intervals"


def drawn_ratings(people: int, scores: int) -> Ratings:
    """Return ratings from 0 to 10 of people whose bias and gain differ, as many from each."""
    draw = np.random.default_rng(people)
    subject, trial = np.divmod(np.arange(people * scores), scores)
    contrast = np.linspace(0.1, 0.7, CONDITIONS)[trial % CONDITIONS]
    bias, gain = draw.normal(4, 1, people), draw.normal(5, 2, people)
    latent = draw.normal(bias[subject] + gain[subject] * contrast, 1.0)
    return Ratings(
        subjects=tuple(f"P{number + 1:02d}" for number in range(people)),
        conditions=tuple(f"condition {number + 1}" for number in range(CONDITIONS)),
        subject=subject,
        condition=trial % CONDITIONS,
        contrast=contrast,
        rating=np.clip(np.round(latent), 0, 10),
    )


def most_likely_gain(contrast: FloatArray, rating: FloatArray) -> float:
    """Return the gain that fits the ratings best: an ordered probit with thresholds between all."""
    values, place = np.unique(rating, return_inverse=True)

    def loss(at: FloatArray) -> float:
        inner = at[1] + np.concatenate([[0.0], np.cumsum(np.exp(at[2:]))])
        ends = np.concatenate([[-np.inf], inner, [np.inf]])
        latent = at[0] * contrast
        share = ndtr(ends[place + 1] - latent) - ndtr(ends[place] - latent)
        return -float(np.log(np.maximum(share, 1e-300)).sum())

    return float(minimize(loss, np.zeros(values.size), method="BFGS").x[0])


@pytest.mark.parametrize(("people", "scores", "rounds"), [(9, 5, 7), (20, 20, 3)])
def test_the_ordinal_model(
    benchmark: BenchmarkFixture, people: int, scores: int, rounds: int
) -> None:
    ratings = drawn_ratings(people, scores)

    def fitted() -> float:
        start_s = process_time()
        ordinal_lines(ratings)
        return process_time() - start_s

    def peer() -> float:
        start_s = process_time()
        most_likely_gain(ratings.contrast, ratings.rating)
        return process_time() - start_s

    fitted()
    pairs = [(fitted(), peer()) for _ in range(rounds)]
    benchmark.pedantic(fitted, rounds=1)
    work = f"M2 of {people} people x {scores} scores, with all intervals"
    compare(benchmark, work, PEER, *zip(*pairs, strict=True))
