"""Claims about perception: verdicts that move with the people's scores and with the law."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.claims import human_factors, published_scores
from analysis.claims.published_scores import HumanScores
from analysis.estimates import ScoreTable
from device.friction.changes import CONDITIONS, predicted_contrast
from device.friction.laws import LAWS
from tests.analysis.claims.conftest import Find

NAMES = ("frequency", "structure", "voltage", "direction", "pressure")


def clear_scores(*means: float) -> HumanScores:
    """Return twelve people who all order the conditions by these means."""
    scores = np.tile(means, (12, 1)) + np.arange(12.0)[:, None] / 10
    subjects = tuple(str(row) for row in range(12))
    return HumanScores(ScoreTable(subjects=subjects, conditions=NAMES, scores=scores))


@pytest.fixture
def clear(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let people order the conditions clearly: voltage, structure, ..., pressure last."""
    monkeypatch.setattr(human_factors, "PUBLISHED", clear_scores(6, 7, 8, 5, 2))


def test_nine_means_leave_all_but_one_comparison_open(find: Find) -> None:
    assert find("voltage-best", "coulomb").scope == (None, None, None, True)
    assert find("pressure-weakest", "consistent").scope == (None, None, True, None)
    assert find("structure-and-voltage-lead", "coulomb").scope.count(True) == 1
    for name in ("voltage-best", "pressure-weakest", "structure-and-voltage-lead"):
        for law in LAWS:
            found = find(name, law)
            assert found.verdict == "partly"
            assert "Holm p of" in found.evidence
            assert "pressure .039" in found.evidence or "voltage .039" in found.evidence
            assert "p_holm" in found.computed


@pytest.mark.usefixtures("clear")
def test_clear_scores_decide_with_the_law() -> None:
    by_name = {claim.id: claim.find for claim in human_factors.CLAIMS}
    assert by_name["voltage-best"]("coulomb").verdict == "holds"
    assert by_name["voltage-best"]("consistent").verdict == "partly"  # its largest is direction
    assert by_name["pressure-weakest"]("consistent").verdict == "holds"
    assert by_name["structure-and-voltage-lead"]("coulomb").verdict == "partly"


def test_scores_in_another_order_contradict_the_claims(
    find: Find, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(human_factors, "PUBLISHED", clear_scores(6, 5, 2, 7, 8))
    for name in ("voltage-best", "pressure-weakest", "structure-and-voltage-lead"):
        assert find(name, "coulomb").verdict == "fails"


def test_the_ranking_rests_on_the_pairs_that_people_tell_apart(
    find: Find, monkeypatch: pytest.MonkeyPatch
) -> None:
    verdicts = {law: find("ranking-follows-model", law) for law in LAWS}
    assert {law: found.verdict for law, found in verdicts.items()} == {
        "printed": "fails",
        "consistent": "partly",
        "coulomb": "partly",
    }
    assert verdicts["consistent"].scope.count(None) == 9
    assert verdicts["consistent"].evidence == "pairs told apart: voltage > pressure, Holm p .039"
    assert verdicts["consistent"].computed["spearman"] == pytest.approx(0.3)
    monkeypatch.setattr(human_factors, "PUBLISHED", clear_scores(5, 4, 8, 6, 2))
    assert find("ranking-follows-model", "coulomb").verdict == "holds"
    monkeypatch.setattr(human_factors, "PUBLISHED", clear_scores(5, 6, 2, 4, 8))
    assert find("ranking-follows-model", "coulomb").verdict == "fails"


def test_smoother_at_the_smooth_place_is_not_smoother_along_the_path(find: Find) -> None:
    found = {law: find("all-nine-smoother", law) for law in LAWS}
    assert {law: of.scope for law, of in found.items()} == {
        "printed": (True, False),
        "consistent": (True, False),
        "coulomb": (True, True),
    }
    numbers = found["consistent"].computed
    signal = predicted_contrast(CONDITIONS["signal"], "consistent")
    assert np.log(0.4 / numbers["mu_at_smooth_place"]) == pytest.approx(signal)
    assert numbers["mean_mu_along_path"] == pytest.approx(0.507, abs=5e-4)
    assert found["consistent"].evidence == "9 of 9 people, 95% CI 0.66 to 1.00"


@pytest.mark.parametrize(
    ("place", "path", "verdict"),
    [(0.3, 0.3, "holds"), (0.3, 0.5, "partly"), (0.5, 0.5, "fails"), (0.5, 0.3, "partly")],
)
def test_the_verdict_on_smoothness_takes_both_places(
    find: Find, monkeypatch: pytest.MonkeyPatch, place: float, path: float, verdict: str
) -> None:
    monkeypatch.setattr(human_factors, "mu", lambda *_: place)
    monkeypatch.setattr(human_factors, "along_path", lambda *_: np.full(711, path))
    assert find("all-nine-smoother", "consistent").verdict == verdict


@pytest.mark.parametrize(
    ("steps", "verdict"),
    [((0.3, 0.2, 0.1), "holds"), ((0.41, 0.3, 0.1), "partly"), ((0.41, 0.42, 0.43), "fails")],
)
def test_each_step_of_voltage_must_be_felt(
    find: Find, monkeypatch: pytest.MonkeyPatch, steps: tuple[float, ...], verdict: str
) -> None:
    by_voltage = dict(zip((0.0, 50.0, 100.0, 200.0), (0.4, *steps), strict=True))
    monkeypatch.setattr(
        human_factors, "mu", lambda _, scene, *__: by_voltage[scene.drive.voltage_v]
    )
    assert find("voltage-felt-at-every-step", "consistent").verdict == verdict


def test_the_first_step_of_voltage_depends_on_the_rung(find: Find) -> None:
    found = find("voltage-felt-at-every-step", "consistent")
    assert found.verdict == "holds"
    on_the_top_rung = found.computed["mu_at_0_50_100_200_v"][1]
    assert found.computed["mu_at_50_v_on_rung_mode"] > 0.4 > on_the_top_rung


def test_all_answers_agreed_with_what_each_law_expects_or_not(
    find: Find, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = {law: find("all-as-expected", law) for law in LAWS}
    assert [of.verdict for of in found.values()] == ["partly", "holds", "partly"]
    assert found["coulomb"].details == (True, True, True, True, False)  # load plays no role in it
    assert found["printed"].evidence.startswith("45 of 45 answers; 9 of 9 people, 95% CI 0.66")
    withheld = published_scores.SCORES.copy()
    withheld[2, 4] = 0
    monkeypatch.setattr(human_factors, "SCORES", withheld)
    assert find("all-as-expected", "consistent").verdict == "fails"


def test_no_condition_without_a_change_shows_how_well_the_device_performs(
    find: Find, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = find("device-performs-well")
    assert found.verdict == "not testable"
    assert found.computed["control_conditions"] == []
    still = replace(CONDITIONS["pressure"], after=CONDITIONS["pressure"].before)
    monkeypatch.setattr(published_scores, "CONDITIONS", {**CONDITIONS, "pressure": still})
    assert find("device-performs-well").verdict == "holds"
    still = replace(CONDITIONS["voltage"], after=CONDITIONS["voltage"].before)
    monkeypatch.setattr(published_scores, "CONDITIONS", {**CONDITIONS, "voltage": still})
    assert find("device-performs-well").verdict == "fails"
