"""The random level of subject × condition: against other quadrature, and known differences."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize, stats

from analysis.estimates import FloatArray, IntArray, NotEstimable
from analysis.statistics.ordinal import (
    Interaction,
    Link,
    OrdinalEffects,
    ScoreCounts,
    log_likelihood,
    ordinal_effects_of_trials,
    score_counts,
    start_of,
)

LINKS: tuple[Link, ...] = ("probit", "logit")
EDGES = np.array([-0.8, 0.0, 0.6, 1.3, 2.0])
# Scores 0 to 2 of four subjects under two conditions, four times each.
SMALL = np.array(
    [
        [[0, 0, 1, 1], [2, 2, 1, 1]],
        [[1, 2, 2, 1], [0, 1, 0, 2]],
        [[0, 1, 0, 0], [1, 0, 1, 0]],
        [[1, 2, 1, 2], [2, 2, 2, 1]],
    ]
)


def fit(scores: IntArray, link: Link) -> OrdinalEffects:
    """The fit of scores (subjects, conditions, repeats)."""
    subject, condition, _ = np.indices(scores.shape).reshape(3, -1)
    result = ordinal_effects_of_trials(
        scores=scores.ravel().astype(np.float64),
        subject=subject,
        condition=condition,
        conditions=tuple("abcde"[: scores.shape[1]]),
        link=link,
    )
    assert isinstance(result, OrdinalEffects)
    return result


def interaction(scores: IntArray, link: Link = "probit") -> Interaction:
    found = fit(scores, link).interaction
    assert isinstance(found, Interaction)
    return found


def counted(scores: IntArray, link: Link) -> ScoreCounts:
    subject, condition, _ = np.indices(scores.shape).reshape(3, -1)
    given = scores.ravel().astype(np.float64)
    counts = score_counts(given, subject, condition, scores.shape[1])
    assert not isinstance(counts, NotEstimable)
    return ScoreCounts(counts=counts, link=link)


def drawn(seed: int, *, interaction_sd: float, subjects: int = 20, repeats: int = 4) -> IntArray:
    """Scores of five conditions whose effects differ by 1.6 at most."""
    rng = np.random.default_rng([7, seed])
    level = rng.normal(0, 0.8, subjects)[:, None] + np.linspace(0, 1.6, 5)
    level += rng.normal(0, interaction_sd, level.shape)
    return np.searchsorted(EDGES, level[..., None] + rng.normal(size=(*level.shape, repeats)))


def by_gauss_hermite(parameters: FloatArray, scores: IntArray, link: Link) -> float:
    """Log-likelihood of two thresholds, an effect and two SDs, by nested Gauss-Hermite rules."""
    cdf = stats.norm.cdf if link == "probit" else stats.logistic.cdf
    low, high, effect, subject_sd, own_sd = parameters
    edges = np.array([-np.inf, low, high, np.inf])
    nodes, weights = np.polynomial.hermite_e.hermegauss(64)
    weights = weights / weights.sum()
    total = 0.0
    for subject in scores:
        given_level = np.ones(len(nodes))
        for place, cell in enumerate(subject):
            level = effect * place + subject_sd * nodes[:, None] + own_sd * nodes
            p = [cdf(edges[score + 1] - level) - cdf(edges[score] - level) for score in cell]
            given_level *= np.prod(p, axis=0) @ weights
        total += float(np.log(given_level @ weights))
    return total


def largest(scores: IntArray, link: Link, own_sd: float | None = None) -> float:
    """The maximum of that log-likelihood, with `own_sd` if it is given."""

    def cost(free: FloatArray) -> float:
        values = np.append(free, own_sd) if own_sd is not None else free
        in_order = values[0] < values[1]
        return -by_gauss_hermite(np.asarray(values), scores, link) if in_order else 1e3

    start = [-0.5, 0.8, 0.5, 0.5, 0.8][: 4 if own_sd is not None else 5]
    return -float(optimize.minimize(cost, start, method="BFGS").fun)


@pytest.mark.parametrize("link", LINKS)
def test_the_fit_is_that_of_another_quadrature(link: Link) -> None:
    found = interaction(SMALL, link)
    assert found.log_likelihood == pytest.approx(largest(SMALL, link), abs=2e-5)
    rise = found.log_likelihood - largest(SMALL, link, 0.0)
    assert found.likelihood_ratio == pytest.approx(2 * rise, abs=1e-4)
    assert found.p == pytest.approx(stats.chi2.sf(2 * rise, 1) / 2, abs=1e-4)
    assert largest(SMALL, link, found.sd) == pytest.approx(found.log_likelihood, abs=2e-5)


@pytest.mark.parametrize("link", LINKS)
def test_the_likelihood_has_fallen_at_the_ends_of_the_interval(link: Link) -> None:
    found = interaction(SMALL, link)
    assert isinstance(found.sd_interval, tuple)
    fall = stats.chi2.ppf(0.95, 1) / 2
    for end in found.sd_interval:
        fallen = found.log_likelihood - largest(SMALL, link, end)
        assert fallen == pytest.approx(fall, abs=2e-3) or (end == 0 and fallen < fall)


@pytest.mark.parametrize("seed", [1, 18])
def test_no_other_parameters_are_likelier_at_the_ends_of_the_interval(seed: int) -> None:
    """A search for them stopped at .26 and .35, where .08 and .19 are as likely."""
    scores = drawn(seed, interaction_sd=0.3, subjects=30, repeats=3)
    found = interaction(scores, "logit")
    assert isinstance(found.sd_interval, tuple)
    data = counted(scores, "logit")

    def cost(others: FloatArray, end: float) -> tuple[float, FloatArray]:
        value, slope = log_likelihood(np.append(others, end), data, 82)
        return -value, -slope[:-1]

    for end in found.sd_interval:
        best = optimize.minimize(cost, start_of(data), args=(end,), jac=True, method="L-BFGS-B")
        fallen = found.log_likelihood + float(best.fun)
        assert fallen == pytest.approx(stats.chi2.ppf(0.95, 1) / 2, abs=2e-3)


def test_the_likelihood_of_many_people_is_that_of_a_few_at_a_time() -> None:
    """With many scores each it is so narrow that it fell between Gauss and Hermite's points."""
    scores = drawn(2, interaction_sd=3.0, subjects=200, repeats=20)[:, :2]
    data = counted(scores, "probit")
    packed = np.append(start_of(data), 3.0)
    halves = [replace(data, counts=data.counts[part]) for part in (slice(100), slice(100, 200))]
    few = sum(log_likelihood(packed, half, 164)[0] for half in halves)
    assert log_likelihood(packed, data, 164)[0] == pytest.approx(few, abs=1e-3)


def test_differences_between_people_are_found_and_widen_the_errors() -> None:
    without = fit(drawn(0, interaction_sd=0.8), "probit")
    found = without.interaction
    assert isinstance(found, Interaction)
    assert isinstance(found.sd_interval, tuple)
    assert found.p < 1e-4
    assert found.sd_interval[0] < 0.8 < found.sd_interval[1]
    assert found.standard_errors["e"] > 1.5 * without.standard_errors["e"]
    assert found.log_likelihood > without.log_likelihood


def test_without_differences_the_interval_starts_at_0() -> None:
    without = fit(drawn(0, interaction_sd=0.0), "probit")
    found = without.interaction
    assert isinstance(found, Interaction)
    assert isinstance(found.sd_interval, tuple)
    assert found.p > 0.05
    assert (found.sd_interval[0], found.sd_interval[1] < 0.7) == (0.0, True)
    assert found.effects["e"] == pytest.approx(without.effects["e"], abs=0.1)


def test_a_search_that_stops_where_a_deviation_of_0_has_no_slope_goes_on() -> None:
    """People differ in level by a thirtieth of what they do from condition to condition."""
    rng = np.random.default_rng(5)
    level = rng.normal(0, 0.1, 25)[:, None] + np.arange(3)
    level += rng.normal(0, 3, level.shape)
    felt = level[..., None] + rng.normal(size=(*level.shape, 4))
    found = interaction(np.clip(np.round(felt + 4), 0, 10).astype(np.int64))
    assert found.sd == pytest.approx(2.54, abs=0.01)
    assert found.subject_sd == pytest.approx(0.40, abs=0.01)


@pytest.mark.parametrize(
    ("scores", "reason"),
    [
        (drawn(1, interaction_sd=0.5, repeats=1), "no subject scored a condition twice"),
        (np.repeat(drawn(1, interaction_sd=0.5, repeats=1), 2, axis=2), "do not determine"),
    ],
)
def test_scores_without_it_give_the_reason(scores: IntArray, reason: str) -> None:
    found = fit(scores, "probit").interaction
    assert isinstance(found, NotEstimable)
    assert reason in found.reason
