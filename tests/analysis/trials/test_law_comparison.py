"""The evidence of laws, and how they order the conditions, against the order of mean ratings."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy import stats

from analysis.estimates import FloatArray, NotEstimable
from analysis.sensitivity.answers_model import StudyAnswers, answers_model, evidence
from analysis.sensitivity.laplace import LatentField
from analysis.sensitivity.latent_posterior import integrated
from analysis.sensitivity.noticing_stage import NoticingStage
from analysis.sensitivity.rating_stage import (
    START,
    Beside,
    PreparedRatings,
    RatingStage,
    _components,
    _log_prior,
    prepared,
)
from analysis.trials.law_comparison import (
    LawOrder,
    against_best,
    critical_rank_correlation,
    law_order,
)
from analysis.trials.trial_statistics import PAPERS_RANKING
from tests.analysis.reports import made
from tests.analysis.sensitivity.answering_people import people
from tests.analysis.sensitivity.simulated_raters import VirtualPopulation, VirtualStudy

CONDITIONS = ("frequency", "structure", "voltage", "direction", "pressure")
# Column means of the paper's Table 4.
MEANS = np.array([76.0, 80.0, 87.0, 75.0, 56.0]) / 9
PEOPLE = VirtualPopulation(bias=3.0, gain=9.0, gain_sd=3.0)


def log_evidence_of_laws(
    answers: StudyAnswers, laws: Mapping[str, FloatArray]
) -> dict[str, float | NotEstimable]:
    return {law: evidence(with_contrasts(answers, of)) for law, of in laws.items()}


def with_contrasts(answers: StudyAnswers, contrast: FloatArray) -> StudyAnswers:
    ratings = replace(answers.ratings, contrast=contrast)
    asked = answers.answered
    asked = None if asked is None else replace(asked, ratings=ratings)
    return replace(answers, ratings=ratings, answered=asked)


def scores(study: VirtualStudy) -> StudyAnswers:
    return StudyAnswers(ratings=study.ratings, scale=(0.0, 10.0))


def test_the_law_that_people_follow_has_the_highest_evidence(
    extended_study: Callable[..., VirtualStudy],
) -> None:
    answers = scores(extended_study(PEOPLE, seed=1))
    contrast, rng = answers.ratings.contrast, np.random.default_rng(2)
    laws = {
        "true": contrast,
        "flawed": contrast + rng.normal(0.0, 0.05, len(contrast)),
        "unrelated": rng.permutation(contrast),
        "silent": np.full(len(contrast), 0.2),
    }
    found = against_best(log_evidence_of_laws(answers, laws))
    assert found["true"] == 0
    assert isinstance(found["flawed"], float)
    assert isinstance(found["unrelated"], float)
    assert found["unrelated"] < found["flawed"] - 3 < -6
    assert found["silent"] == NotEstimable(
        "all predicted contrasts are equal, so the gain cannot be estimated"
    )


def test_answers_tell_of_a_law_as_well_as_scores() -> None:
    """The evidence is that of both stages."""
    answers = people(2, subjects=10)
    assert answers.answered is not None
    change, contrast = ~answers.answered.catch, answers.ratings.contrast
    shuffled = contrast.copy()
    shuffled[change] = np.random.default_rng(3).permutation(contrast[change])
    laws = {"true": contrast, "unrelated": shuffled}
    both = against_best(log_evidence_of_laws(answers, laws))
    rated = replace(answers, ratings=answers.ratings.where(change), answered=None, selects=False)
    alone = against_best(log_evidence_of_laws(rated, {law: of[change] for law, of in laws.items()}))
    assert both["true"] == alone["true"] == 0
    assert isinstance(both["unrelated"], float)
    assert isinstance(alone["unrelated"], float)
    assert both["unrelated"] < alone["unrelated"] - 8


def test_units_of_a_law_do_not_matter(extended_study: Callable[..., VirtualStudy]) -> None:
    answers = scores(extended_study(PEOPLE, seed=4, subjects=8))
    contrast = answers.ratings.contrast
    laws = {"one": contrast, "other": 40 * contrast - 3}
    found = log_evidence_of_laws(answers, laws)
    assert found["other"] == pytest.approx(found["one"], abs=1e-6)
    asked = people(1, subjects=6)
    laws = {"one": asked.ratings.contrast, "other": 40 * asked.ratings.contrast}
    found = log_evidence_of_laws(asked, laws)
    assert found["other"] == pytest.approx(found["one"], abs=1e-6)


@pytest.mark.parametrize("subjects", [2, 9])
def test_few_points_tell_the_evidence(
    subjects: int, extended_study: Callable[..., VirtualStudy]
) -> None:
    """As the points of the fit itself tell it."""
    answers = scores(extended_study(PEOPLE, seed=5, subjects=subjects))
    ready = prepared(answers.ratings, Beside())
    assert isinstance(ready, PreparedRatings)
    fits = integrated(LatentField(ready.trials), START, _components, _log_prior)
    assert evidence(answers) == pytest.approx(next(fits).points.log_evidence, abs=0.1)


def test_few_points_tell_the_evidence_of_answers() -> None:
    answers = people(3, subjects=9)
    model = answers_model(answers)
    assert isinstance(model.noticing, NoticingStage)
    assert isinstance(model.rating, RatingStage)
    of_fits = [stage.posterior.points.log_evidence for stage in (model.noticing, model.rating)]
    assert evidence(answers) == pytest.approx(sum(of_fits), abs=0.1)


def test_laws_are_compared_on_the_same_trials() -> None:
    table = [[7, 8, 9, 6, 5], [8, 7, 9, 7, 6], [6, 8, 8, 8, 4], [7, 9, 10, 6, 6]]
    trials = made(table, names=CONDITIONS).trials
    assert list(trials.evidence) == ["printed", "consistent", "coulomb", PAPERS_RANKING]
    for law in ("printed", "consistent", "coulomb"):
        assert trials.scored.contrasts[law].shape == trials.scored.ratings.rating.shape
        assert isinstance(trials.evidence[law], float)
    score = {each.law: each for each in trials.laws}
    factors = [score[law].ln_bayes_factor for law in ("printed", "consistent", "coulomb")]
    assert max(factor for factor in factors if isinstance(factor, float)) == 0
    assert score[PAPERS_RANKING].ln_bayes_factor == NotEstimable("the claim predicts no contrasts")


def order_of(predicted: FloatArray, observed: FloatArray) -> LawOrder:
    names = tuple(f"c{number}" for number in range(len(predicted)))
    result = law_order(names, predicted, observed)
    assert isinstance(result, LawOrder)
    return result


def test_five_conditions_are_no_evidence_for_the_consistent_law() -> None:
    # Changes of friction at the smooth place, and of places along the path.
    predicted = np.array([0.050, 0.041, 0.133, 0.326, 0.015])
    result = law_order(CONDITIONS, predicted, MEANS)
    assert isinstance(result, LawOrder)
    assert result.order == ("direction", "voltage", "frequency", "structure", "pressure")
    assert result.spearman == pytest.approx(0.30, abs=1e-12)
    assert isinstance(result.p, float)
    assert result.p > 0.6
    assert result.rated == 5


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=3, max_size=6))
def test_correlations_agree_with_scipy_and_every_order(pairs: list[tuple[int, int]]) -> None:
    predicted, observed = np.array(pairs, dtype=np.float64).T
    assume(np.ptp(predicted) > 0 and np.ptp(observed) > 0)
    result = order_of(predicted, observed)
    assert result.spearman == pytest.approx(stats.spearmanr(predicted, observed)[0], abs=1e-12)

    one, other = stats.rankdata(predicted), stats.rankdata(observed)
    products = [np.dot(np.array(order) - one.mean(), other) for order in permutations(one)]
    reached = np.abs(products) >= abs(np.dot(one - one.mean(), other)) - 1e-9
    assert result.p == pytest.approx(float(reached.mean()), abs=1e-12)


@pytest.mark.parametrize(
    ("pairs", "needed"),
    [(5, 1.0), (6, 0.886), (7, 0.786), (8, 0.738), (9, 0.700), (10, 0.648), (11, 0.618)],
)
def test_what_a_rank_correlation_must_reach(pairs: int, needed: float) -> None:
    """As in the tables of Zar (Biostatistical Analysis, B.20)."""
    assert critical_rank_correlation(pairs) == pytest.approx(needed, abs=5e-4)


@pytest.mark.parametrize("pairs", [3, 4])
def test_no_order_of_four_conditions_is_evidence(pairs: int) -> None:
    assert critical_rank_correlation(pairs) == NotEstimable(
        f"no order of these {pairs} conditions has p < .05"
    )


def test_many_conditions_have_the_t_approximation() -> None:
    rng = np.random.default_rng(1)
    predicted = rng.normal(size=12)
    observed = predicted + rng.normal(size=12)
    expected = stats.spearmanr(predicted, observed)
    assert order_of(predicted, observed).p == pytest.approx(expected.pvalue, rel=1e-9)
    # Its table, Zar's B.17, of twelve pairs.
    assert critical_rank_correlation(12) == pytest.approx(0.576, abs=5e-4)


def test_a_perfect_order_of_nine_conditions_has_the_share_that_it_is_of_all_orders() -> None:
    """2 of 9! orders, 2 * 3! with three tied in the middle; with two at an end none mirrors it."""
    plain, middle, end = (np.arange(9, dtype=np.float64) for _ in range(3))
    middle[3:6], end[:2] = 4, 1
    shares = [order_of(ranks, ranks).p for ranks in (plain, middle, end)]
    assert np.array(shares) * math.factorial(9) == pytest.approx([2, 12, 2])


@pytest.mark.parametrize("count", [9, 10, 11])
def test_a_nearly_perfect_order_is_one_of_as_many_as_there_are_neighbours_to_swap(
    count: int,
) -> None:
    plain = np.arange(count, dtype=np.float64)
    swapped = np.array([1, 0, *range(2, count)], dtype=np.float64)
    assert order_of(plain, swapped).p == pytest.approx(2 * count / math.factorial(count))


def test_conditions_nobody_rated_are_left_out_of_the_correlation() -> None:
    result = order_of(np.array([0.1, 0.3, 0.2, 0.9]), np.array([1.0, 3.0, 2.0, np.nan]))
    assert (result.spearman, result.order[0], result.rated) == (1.0, "c3", 3)


def test_equal_contrasts_are_tied_in_the_order() -> None:
    result = law_order(CONDITIONS, np.array([-0.1, 0.0, -0.2, 0.6, 1e-12]), MEANS)
    assert isinstance(result, LawOrder)
    assert result.tied == (("direction",), ("structure", "pressure"), ("frequency",), ("voltage",))
    assert result.order == ("direction", "structure", "pressure", "frequency", "voltage")


def test_laws_without_an_order_say_why() -> None:
    flat = order_of(np.array([0.2, 0.2, 0.2]), np.array([1.0, 2.0, 3.0]))
    assert isinstance(flat.spearman, NotEstimable)
    assert "contrasts, or all mean ratings, are equal" in flat.spearman.reason
    few = law_order(("a", "b"), np.array([0.1, 0.2]), np.array([1.0, 2.0]))
    assert few == NotEstimable(
        "an order needs at least 3 conditions with a score and a predicted contrast, got 2"
    )
    with pytest.raises(ValueError, match="2 conditions need as many values, got 1"):
        law_order(("a", "b"), np.array([0.1]), np.array([1.0, 2.0]))
