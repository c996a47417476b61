"""The ordinal model against quadrature, published values and known effects."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import integrate, stats

from analysis.estimates import FloatArray, NotEstimable, ScoreTable
from analysis.statistics.ordinal import (
    Link,
    OrdinalEffects,
    ScoreCounts,
    log_likelihood,
    ordinal_effects_of_trials,
)

TableOf = Callable[[FloatArray], ScoreTable]
LINKS: tuple[Link, ...] = ("probit", "logit")


def ordinal_effects(table: ScoreTable, *, link: Link) -> OrdinalEffects | NotEstimable:
    subject, condition = np.nonzero(table.given)
    return ordinal_effects_of_trials(
        scores=table.scores[subject, condition],
        subject=subject,
        condition=condition,
        conditions=table.conditions,
        link=link,
    )


def result_of(table: ScoreTable, link: Link) -> OrdinalEffects:
    result = ordinal_effects(table, link=link)
    assert isinstance(result, OrdinalEffects)
    return result


def likelihoods(table: ScoreTable, fit: OrdinalEffects, level: FloatArray) -> FloatArray:
    """Each subject's likelihood given the subject's level, shape (subjects, levels)."""
    cdf = stats.norm.cdf if fit.link == "probit" else stats.logistic.cdf
    edges = np.array([-np.inf, *fit.thresholds, np.inf])
    effects = np.array([0.0, *fit.effects.values()])
    rows = []
    for row in table.scores:
        seen = ~np.isnan(row)
        category = np.searchsorted(fit.categories, row[seen])
        location = effects[seen, None] + fit.subject_sd * level
        upper, lower = edges[category + 1, None], edges[category, None]
        rows.append(np.prod(cdf(upper - location) - cdf(lower - location), axis=0))
    return np.array(rows)


def by_many_points(table: ScoreTable, fit: OrdinalEffects) -> float:
    # Of people whose levels differ by several SDs Gauss and Hermite's 150 points miss a thousandth.
    levels = np.linspace(-9, 9, 4001)
    weights = stats.norm.pdf(levels)
    per_subject = likelihoods(table, fit, levels) @ weights / weights.sum()
    return float(np.log(per_subject).sum())


def by_adaptive_quadrature(table: ScoreTable, fit: OrdinalEffects) -> float:
    def integrand(level: float, index: int) -> float:
        density = stats.norm.pdf(level)
        return float(likelihoods(table, fit, np.array([level]))[index, 0] * density)

    parts = [
        integrate.quad(integrand, -9, 9, args=(index,), epsabs=0, epsrel=1e-9)[0]
        for index in range(len(table.subjects))
    ]
    return float(np.log(parts).sum())


@pytest.mark.parametrize(
    ("link", "effects", "subject_sd", "value"),
    [
        ("probit", [0.714, 1.896, -0.193, -2.439], 0.882, -44.5116),
        ("logit", [1.182, 3.187, -0.439, -4.582], 1.628, -44.7368),
    ],
)
def test_table_4(
    published: ScoreTable, link: Link, effects: list[float], subject_sd: float, value: float
) -> None:
    result = result_of(published, link)
    assert result.reference == "frequency"
    assert list(result.effects) == ["structure", "voltage", "direction", "pressure"]
    assert list(result.effects.values()) == pytest.approx(effects, abs=6e-4)
    assert result.subject_sd == pytest.approx(subject_sd, abs=6e-4)
    assert result.log_likelihood == pytest.approx(value, abs=6e-5)
    assert result.categories == (4.0, 5.0, 7.0, 8.0, 9.0, 10.0)


@pytest.mark.parametrize("link", LINKS)
def test_the_likelihood_agrees_with_adaptive_quadrature(published: ScoreTable, link: Link) -> None:
    result = result_of(published, link)
    assert result.log_likelihood == pytest.approx(
        by_adaptive_quadrature(published, result), abs=1e-8
    )


@pytest.mark.parametrize("link", LINKS)
def test_the_gradient_is_that_of_the_likelihood(link: Link) -> None:
    rng = np.random.default_rng(1)
    data = ScoreCounts(counts=rng.integers(0, 3, (6, 3, 4)).astype(np.float64), link=link)
    packed = np.array([-1.0, 0.1, -0.4, 0.5, -0.7, 0.8])
    gradient = log_likelihood(packed, data, 81)[1]
    for direction, slope in zip(np.eye(6) * 1e-6, gradient, strict=True):
        ahead = log_likelihood(packed + direction, data, 81)[0]
        behind = log_likelihood(packed - direction, data, 81)[0]
        assert slope == pytest.approx((ahead - behind) / 2e-6, rel=1e-6, abs=1e-6)


@settings(max_examples=25, deadline=None)
@given(
    st.tuples(st.integers(2, 7), st.integers(2, 4)).flatmap(
        lambda shape: arrays(
            np.float64, shape, elements=st.integers(1, 4).map(float) | st.just(np.nan)
        )
    ),
    st.sampled_from(LINKS),
)
def test_random_tables_have_a_maximum_or_a_reason(
    table_of: TableOf, scores: FloatArray, link: Link
) -> None:
    table = table_of(scores)
    result = ordinal_effects(table, link=link)
    if isinstance(result, NotEstimable):
        return
    assert result.log_likelihood == pytest.approx(by_many_points(table, result), abs=1e-5)
    for name in result.effects:
        for step in (-0.05, 0.05):
            beside = {**result.effects, name: result.effects[name] + step}
            moved = OrdinalEffects(**{**vars(result), "effects": beside})
            assert by_many_points(table, moved) < result.log_likelihood


def test_missing_scores_and_a_ceiling_do_not_bias_the_effects() -> None:
    rng = np.random.default_rng(6)
    subject, condition = np.repeat(np.arange(150), 12), np.tile(np.arange(3), 600)
    latent = rng.normal(0, 0.8, 150)[subject] + np.array([0.0, 1.0, 2.5])[condition]
    latent += rng.normal(size=latent.size)
    scores = np.digitize(latent, [-1.0, 0.0, 0.7, 1.5]).astype(np.float64)
    kept = rng.random(latent.size) > 0.2
    assert (scores == 4).mean() > 0.38
    result = ordinal_effects_of_trials(
        scores=scores[kept],
        subject=subject[kept],
        condition=condition[kept],
        conditions=("a", "b", "c"),
        link="probit",
    )
    assert isinstance(result, OrdinalEffects)
    assert list(result.effects.values()) == pytest.approx([1.0, 2.5], abs=0.2)
    assert result.subject_sd == pytest.approx(0.8, abs=0.15)
    assert result.thresholds == pytest.approx((-1.0, 0.0, 0.7, 1.5), abs=0.25)
    assert 0.03 < result.standard_errors["b"] < 0.2


@pytest.mark.parametrize(
    ("scores", "reason"),
    [
        ([[1.0, 2.0]], "at least 2 subjects, got 1"),
        ([[1.0, 1.0], [1.0, 1.0]], "2 to 21 different scores, got 1"),
        ([[1.0, np.nan], [2.0, np.nan]], "no score was given under c1"),
        ([[1.0, 9.0], [2.0, 8.0], [1.0, 8.0], [2.0, 9.0]], "because scores do not overlap"),
        # Three effects diverge alike, and rounding chose one to be named.
        (
            [[4.0, 5.0, 6.0, 10.0, 9.0], [4.0, 5.0, 9.0, 6.0, 9.0]],
            "do not overlap between conditions or subjects",
        ),
        # One score per subject differs, so levels and residuals cannot be told apart.
        (
            [[7.0, score] for score in (5.0, 6.0, 7.0, 7.0, 8.0, 9.0, 6.0, 8.0)],
            "do not determine the standard deviation between subjects",
        ),
    ],
)
def test_tables_without_a_maximum_give_the_reason(
    table_of: TableOf, scores: list[list[float]], reason: str
) -> None:
    for link in LINKS:
        result = ordinal_effects(table_of(np.array(scores)), link=link)
        assert isinstance(result, NotEstimable)
        assert reason in result.reason


@pytest.mark.parametrize("link", LINKS)
def test_the_slope_at_the_maximum_is_none(table_of: TableOf, link: Link) -> None:
    scores = np.array(
        [
            [6, 9, 9, 6, 6],
            [10, 6, 10, 6, 6],
            [8, 5, 8, 7, 10],
            [10, 6, 9, 9, 10],
            [10, 5, 8, 5, 5],
            [7, 6, 7, 8, 9],
            [9, 6, 10, 6, 10],
            [9, 8, 8, 7, 7],
            [7, 5, 8, 8, 6],
        ],
        dtype=float,
    )
    found = result_of(table_of(scores), link)
    categories = np.searchsorted(found.categories, scores)
    thresholds, effects = np.array(found.thresholds), [*found.effects.values()]
    packed = [thresholds[0], *np.log(np.diff(thresholds)), *effects, found.subject_sd]
    data = ScoreCounts(counts=np.eye(len(found.categories))[categories], link=link)
    slope = log_likelihood(np.array(packed), data, 81)[1]
    assert slope == pytest.approx(0, abs=1e-10)
