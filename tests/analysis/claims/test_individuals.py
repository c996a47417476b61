"""Claims about single participants: when people can be said to differ in their sensitivity."""

import numpy as np
import pytest
from scipy import stats

from analysis.claims import human_factors
from analysis.claims.human_factors import GainSpread, gain_spread, prediction_interval
from analysis.claims.published_scores import PUBLISHED, SCORES
from analysis.estimates import FloatArray
from analysis.statistics.additive import GainHeterogeneity, gain_heterogeneity
from device.friction.laws import LAWS
from tests.analysis.claims.conftest import Find

X = np.array([0.19, 0.1, 0.35, 0.45, 0.07])


def simulated(
    random: np.random.Generator, *, people: int = 9, gain_sd: float, noise: float = 1.0
) -> FloatArray:
    gains = random.normal(6.0, gain_sd, people)
    levels = random.normal(7.0, 1.0, people)
    conditions = random.normal(0.0, 1.0, X.size)
    errors = random.normal(0.0, noise, (people, X.size))
    return np.asarray(levels[:, None] + gains[:, None] * X + conditions + errors)


def test_on_the_conditions_effects_the_test_is_mandels() -> None:
    mandel = gain_heterogeneity(PUBLISHED.table)
    assert isinstance(mandel, GainHeterogeneity)
    found = gain_spread(SCORES, SCORES.mean(axis=0))
    assert found.f == pytest.approx(mandel.f)
    assert found.df == (8, 24)
    assert found.mean == pytest.approx(1.0)


@pytest.mark.parametrize("gain_sd", [0.0, 3.0, 10.0])
def test_the_interval_covers_the_true_spread(gain_sd: float) -> None:
    random = np.random.default_rng(1)
    found = [gain_spread(simulated(random, gain_sd=gain_sd), X).sd_interval for _ in range(2000)]
    covered = np.mean([low <= gain_sd <= high for low, high in found])
    # 0 is covered unless the lower limit is above it: one-sided, .975.
    assert covered == pytest.approx(0.975 if gain_sd == 0 else 0.95, abs=0.015)


def test_the_detectable_spread_is_found_with_its_power() -> None:
    random = np.random.default_rng(2)
    # The residuals' variance is 1 here, and the estimate of one study scatters about it.
    studies = [gain_spread(simulated(random, gain_sd=0.0), X) for _ in range(500)]
    sd = float(np.sqrt(np.mean([study.detectable_sd**2 for study in studies])))
    found = [gain_spread(simulated(random, gain_sd=sd), X).p < 0.05 for _ in range(2000)]
    assert np.mean(found) == pytest.approx(0.8, abs=0.03)


def spread(low: float, high: float, mean: float = 4.0) -> GainSpread:
    return GainSpread(
        f=1.0, df=(8, 24), p=0.5, mean=mean, sd_interval=(low, high), detectable_sd=1.0
    )


@pytest.mark.parametrize(
    ("low", "high", "differ"), [(0.1, 9.0, True), (0.0, 9.0, None), (0.0, 0.9, False)]
)
def test_people_differ_only_if_the_interval_says_so(
    low: float, high: float, differ: bool | None
) -> None:
    assert spread(low, high).differ is differ


def test_table_4_cannot_tell_whether_people_differ_in_sensitivity(find: Find) -> None:
    for law in LAWS:
        found = find("receptor-sensitivity-differs", law)
        assert found.verdict == "not testable"
        gains = found.computed["gains"]
        assert gains.sd_interval[0] == 0
        assert gains.detectable_sd > 0.25 * abs(gains.mean)
        assert found.computed["m2_subjects_with_another_gain"] == []
        # It can tell that people differ in the level of their scores.
        assert found.computed["levels_f"] == pytest.approx(3.5)
        assert found.computed["levels_p"] < 0.05
    assert found.evidence.startswith("equal gains: F(8, 24) = 0.98, p = .476")


@pytest.mark.parametrize(
    ("people", "gain_sd", "noise", "verdict"),
    [(30, 10.0, 0.3, "holds"), (30, 0.0, 0.05, "fails"), (9, 0.0, 1.5, "not testable")],
)
def test_the_verdict_on_sensitivity_moves_with_the_scores(
    find: Find,
    monkeypatch: pytest.MonkeyPatch,
    people: int,
    gain_sd: float,
    noise: float,
    verdict: str,
) -> None:
    random = np.random.default_rng(3)
    scores = simulated(random, people=people, gain_sd=gain_sd, noise=noise)
    original = human_factors.gain_spread
    monkeypatch.setattr(human_factors, "gain_spread", lambda _, x: original(scores, X))
    assert find("receptor-sensitivity-differs", "consistent").verdict == verdict


def test_a_prediction_interval_is_that_of_one_more_value() -> None:
    others = np.array([10.0, 10, 10, 10, 10, 9, 10, 10])
    half = stats.t.ppf(0.975, 7) * others.std(ddof=1) * np.sqrt(9 / 8)
    assert prediction_interval(others) == pytest.approx((9.875 - half, 9.875 + half))


def test_the_third_subject_stands_out_in_voltage_alone(
    find: Find, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = find("third-subject-like-others")
    assert found.scope == (True, True, False, True)
    assert found.verdict == "partly"
    assert found.evidence == "outside the 95% prediction interval: voltage 8, others 9.0 to 10.8"
    alike = SCORES.copy()
    alike[2, 2] = 10
    monkeypatch.setattr(human_factors, "SCORES", alike)
    assert find("third-subject-like-others").verdict == "holds"
    alike[2, :4] = 0
    assert find("third-subject-like-others").verdict == "fails"
