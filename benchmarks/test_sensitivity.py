"""What the model of the answers costs beside a maximum without people or intervals."""

from time import process_time

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from scipy.optimize import minimize
from scipy.special import ndtr

from analysis.estimates import FloatArray, NotEstimable
from analysis.sensitivity.answers_model import StudyAnswers, sensitivity
from analysis.sensitivity.lines import Ratings
from analysis.sensitivity.noticing_stage import Answered
from benchmarks.compared import compare

CONDITIONS = 5
PEER = "scipy's BFGS of an ordinal model without people, without intervals"


def drawn_answers(people: int, trials: int) -> StudyAnswers:
    """Return answers and ratings from 0 to 10 of people whose bias and gain differ.

    Of each person's `trials` one in five is a catch trial; a change that is not felt is not rated.
    """
    draw = np.random.default_rng(people)
    subject, trial = np.divmod(np.arange(people * trials), trials)
    catch = trial % CONDITIONS == CONDITIONS - 1
    contrast = np.where(catch, 0.0, np.linspace(0.1, 0.7, CONDITIONS)[trial % CONDITIONS])
    felt = contrast + draw.normal(0, 0.15, len(contrast))
    answer = np.select([felt > 0.15, felt < -0.15], [1, -1], 0)
    bias, gain = draw.normal(4, 1, people), draw.normal(5, 2, people)
    latent = draw.normal(bias[subject] + gain[subject] * felt, 1.0)
    rated = (answer == 1) & ~catch
    ratings = Ratings(
        subjects=tuple(f"P{number + 1:02d}" for number in range(people)),
        conditions=tuple(f"condition {number + 1}" for number in range(CONDITIONS)),
        subject=subject,
        condition=trial % CONDITIONS,
        contrast=contrast,
        rating=np.where(rated, np.clip(np.round(latent), 0, 10), np.nan),
    )
    return StudyAnswers(
        ratings=ratings,
        scale=(0.0, 10.0),
        answered=Answered(
            ratings=ratings,
            answer=answer,
            two_sided=np.ones(len(answer), dtype=np.bool_),
            first=trial % 2 == 0,
            catch=catch,
        ),
        selects=True,
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


@pytest.mark.parametrize(("people", "trials", "rounds"), [(9, 10, 7), (20, 25, 3)])
def test_the_model_of_the_answers(
    benchmark: BenchmarkFixture, people: int, trials: int, rounds: int
) -> None:
    answers = drawn_answers(people, trials)
    given = answers.rated.given

    def fitted() -> float:
        start_s = process_time()
        found = sensitivity(answers)
        took_s = process_time() - start_s
        assert not isinstance(found.rating, NotEstimable), found.rating
        return took_s

    def peer() -> float:
        start_s = process_time()
        most_likely_gain(given.contrast, given.rating)
        return process_time() - start_s

    fitted()
    pairs = [(fitted(), peer()) for _ in range(rounds)]
    benchmark.pedantic(fitted, rounds=1)
    work = f"noticing and rating of {people} people x {trials} trials, with all intervals"
    compare(benchmark, work, PEER, *zip(*pairs, strict=True))
